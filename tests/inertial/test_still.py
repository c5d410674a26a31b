"""The zero-velocity detector on simulated standstill and turning."""

import numpy as np
import pytest
from support.still_twin import StillTwin

from inertial.core import native
from inertial.layouts.catalogue import CUBE, LAYOUTS
from inertial.rate import still
from inertial.rate.observed import sensor
from inertial.simulation.table import TableTest

SURE = 0.02**2 * np.eye(3)
LIMITS = still.limits(still.Config())
SENSOR = sensor(CUBE(0.05), 0.0408)


def answers(profile, rates=None, seed=1):
    """The detector's word for three blocks (30 s), told the true rate or `rates`, and the depths it
    names.
    """
    table = TableTest(seed, profile=profile)
    watch = native.RateDetector()
    said, turning, depths = [], [], []
    for number in range(3):
        block = table.block(number)
        for row in range(len(block.t_s)):
            watch.take(SENSOR, block.readings[row], table.period_s)
            # who stands believes to stand: what the filter would say
            omega = (
                (np.zeros(3) if said and said[-1] else block.omega_b[row])
                if rates is None
                else rates
            )
            answer, depth = watch.detect(SENSOR, LIMITS, omega, SURE, table.period_s)
            said.append(answer)
            depths.append(depth)
            turning.append(abs(block.omega_b[row, 2]))
    return np.array(said), np.array(turning), np.array(depths)


def test_a_cube_at_rest_is_still_once_gravity_has_kept_its_direction():
    said, _, _ = answers("still")
    assert not said[:124].any()
    assert said[124:].mean() > 0.97


def test_a_slow_turn_about_a_tilted_axis_is_not_still_though_the_rate_is_not_known():
    """10 deg/s, two degrees from the vertical: the readings scatter like noise and the products say
    nothing.
    """
    watch, rate, tilt = native.RateDetector(), np.deg2rad(10.0), np.deg2rad(2.0)
    noise = np.random.default_rng(4).normal(0.0, 0.04, (1000, 12))
    said = []
    for k in range(1000):
        angle = rate * 0.01 * k
        force = -9.80665 * np.array(
            [np.sin(tilt) * np.cos(angle), -np.sin(tilt) * np.sin(angle), np.cos(tilt)]
        )
        watch.take(SENSOR, CUBE(0.05).theta_b @ force + noise[k], 0.01)
        said.append(watch.detect(SENSOR, LIMITS, np.zeros(3), 100.0 * np.eye(3), 0.01)[0])
    assert np.mean(said) < 0.02


def test_a_turning_cube_is_not_still():
    said, rate, _ = answers("published")
    assert not said[rate > 0.15].any()


def test_wobble_never_looks_still_at_its_slowest():
    said, rate, _ = answers("wobble")
    assert not said[rate > 0.2].any()


def test_a_slow_start_is_noticed_and_dated():
    """The ramp of the fast profile reaches 5 deg/s after half a second."""
    said, rate, depths = answers("fast")
    noticed = 500 + int(np.argmin(said[500:]))
    assert noticed < 575 and np.rad2deg(rate[noticed]) < 11.0
    assert 500 <= noticed + 1 < 500 + 2 * depths[noticed]


def test_standstill_is_found_within_half_a_second():
    said, _, _ = answers("published")
    assert said[1550:1790].mean() > 0.95  # still from 15 to 18 s
    assert said[2850:3000].mean() > 0.95


def test_a_wrong_rate_is_overruled_by_axes_that_keep_still():
    said, _, _ = answers("still", rates=np.array([0.0, 0.0, 1.0]))
    assert not said[:600].any()
    assert said[700:].mean() > 0.6


def test_a_gap_empties_the_window():
    watch = native.RateDetector()
    for _ in range(130):
        watch.take(SENSOR, np.zeros(12), 0.01)
        answer, _ = watch.detect(SENSOR, LIMITS, np.zeros(3), SURE, 0.01)
    assert answer
    watch.forget()
    watch.take(SENSOR, np.zeros(12), 0.01)
    assert not watch.detect(SENSOR, LIMITS, np.zeros(3), SURE, 0.01)[0]


def test_the_newest_samples_of_a_standstill_are_not_learnt():
    table = TableTest(2)
    watch, block = native.RateDetector(), table.block(0)
    for row in range(480):
        watch.take(SENSOR, block.readings[row], 0.01)
        watch.detect(SENSOR, LIMITS, np.zeros(3), SURE, 0.01)
    n = watch.learning
    assert 0 < n <= 480 - 64 - 24
    y = SENSOR.W @ block.readings[480 - 64 - n : 480 - 64].mean(axis=0)
    np.testing.assert_allclose(watch.reference, y, atol=1e-9)


def test_noise_alone_seldom_denies_a_standstill():
    said, _, depths = answers("still", seed=9)
    assert np.mean(said[125:]) > 0.97
    assert np.count_nonzero(depths) <= 2


def test_windows_that_do_not_fit_are_refused():
    with pytest.raises(ValueError, match="windows 8 <= 25 <= 200 < 128"):
        still.limits(still.Config(guard=200))


def test_layouts_without_products_watch_the_angular_acceleration():
    assert sensor(LAYOUTS["nine"](0.05), 0.04).m == 0


@pytest.mark.parametrize("profile", ["published", "slow", "wobble"])
@pytest.mark.parametrize("kind", ["cube", "nine"])
def test_the_detector_is_that_of_its_definitions(profile, kind):
    table = TableTest(3, profile=profile, layout=LAYOUTS[kind](0.05))
    s, watch = sensor(table.layout, 0.0408), native.RateDetector()
    twin, block, still_now = StillTwin(s, still.Config()), table.block(0), 0
    for row in range(len(block.t_s)):
        omega = np.zeros(3) if still_now else block.omega_b[row]
        watch.take(s, block.readings[row], 0.01)
        said = watch.detect(s, LIMITS, omega, SURE, 0.01)
        assert said == twin.step(block.readings[row], omega, SURE, 0.01)
        still_now = said[0]
        assert watch.learning == twin.learning
    np.testing.assert_allclose(watch.reference, twin.reference, atol=1e-9)
