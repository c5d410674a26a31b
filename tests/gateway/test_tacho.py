"""Pulses to rate."""

import math
import random

import pytest

from gateway.samples.tacho import Tachometer
from gateway.virtual.pulses import table_pulses

PITCH = 2 * math.pi / 360


@pytest.mark.parametrize("rate", [0.05, 1.0, -7.3, 40.0])
def test_steady_rate_within_its_sigma(rate):
    """Marks off their place by 2 % of a pitch: the error over sigma is about one, at any speed."""
    tacho, draw, ratios = Tachometer(360), random.Random(1), []
    now = 0.0
    pulses = [p.t_s for p in table_pulses(0.0, rate, 0.0, 60 * PITCH / abs(rate), PITCH)]
    times = [t + draw.gauss(0.0, 0.02 * PITCH / abs(rate)) for t in pulses]
    for k, t in enumerate(times):
        tacho.add([t * 1e6], True, rate < 0)
        if k % 5 == 4:
            said = tacho.rate(t * 1e6)
            ratios.append((said.omega_radps - rate) / said.sigma_radps)
        now = t
    assert len(ratios) > 8 and tacho.pulses == len(times)
    assert math.sqrt(sum(r * r for r in ratios) / len(ratios)) < 2.0
    tacho.rate(now * 1e6)
    assert tacho.rate((now + 100 * PITCH / abs(rate) + 1) * 1e6).omega_radps == 0.0


def test_silence_bounds_the_rate():
    tacho = Tachometer(360)
    tacho.add([k * 10_000.0 for k in range(10)], False, False)
    assert tacho.rate(90_000.0).omega_radps == pytest.approx(PITCH / 0.01)
    assert tacho.rate(100_000.0) is None  # one interval: nothing can be said yet
    early, late = tacho.rate(200_000.0), tacho.rate(1_090_000.0)
    assert early.omega_radps == late.omega_radps == 0.0
    assert late.sigma_radps == pytest.approx(PITCH / 1.0 / math.sqrt(3))
    assert late.sigma_radps < early.sigma_radps


def test_pulses_around_a_reversal_are_no_interval():
    tacho = Tachometer(360)
    tacho.add([0.0, 1000.0, 2000.0], True, False)
    assert tacho.rate(2000.0).omega_radps > 0
    tacho.add([2100.0], True, True)
    assert tacho.rate(2100.0) is None
    tacho.add([3100.0], True, True)
    assert tacho.rate(3100.0).omega_radps == pytest.approx(-PITCH / 1e-3)


def test_no_pulse_ever_says_nothing():
    assert Tachometer(360).rate(1e9) is None


def test_table_pulses_stand_where_the_marks_are():
    up = [p.t_s for p in table_pulses(0.0, 1.0, 5.0, 6.0, 0.1)]
    assert up == pytest.approx([5.0 + 0.1 * k for k in range(1, 10)], abs=1e-9) or len(up) == 10
    down = list(table_pulses(0.05, -1.0, 0.0, 0.2, 0.1))
    assert [p.direction for p in down] == [-1, -1] and [p.t_s for p in down] == pytest.approx(
        [0.05, 0.15]
    )
