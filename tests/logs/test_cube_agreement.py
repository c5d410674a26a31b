"""Whether the axes of a log agree is measured where a layout has axes to spare."""

import numpy as np
import pytest
from support.array_log import calibrate_at_rest, read_array

from inertial.layouts.catalogue import find
from inertial.simulation.table import TableTest
from logs.cube_axes import agreement


def readings(layout, extra=0.0):
    """A table that turns, seen by the layout; extra: m/s^2 of disagreement, RMS."""
    table, draw = TableTest(2, profile="fast", layout=layout), np.random.default_rng(4)
    blocks = [table.block(k) for k in range(2)]
    f = np.concatenate([b.readings for b in blocks])
    turning = np.abs(np.concatenate([b.omega_b for b in blocks])).max(axis=1) > 0.1
    f[turning] += extra * draw.normal(size=f[turning].shape)
    return f, turning


def test_axes_that_disagree_while_they_turn_are_told_with_the_noise_that_they_have():
    layout = find("array-24")
    found = agreement(layout, *readings(layout, 2.0))
    assert found.turning == pytest.approx(2.0, rel=0.15) and found.sigma_axis == found.turning
    assert "no motion of a rigid body explains" in found.text


def test_a_cube_has_no_axis_to_spare():
    assert agreement(find("cube"), *readings(find("cube"))) is None


def test_the_real_array_disagrees_beyond_its_noise_while_it_is_shaken(data_dir):
    log, layout = read_array(data_dir / "accelerometer_array" / "exp_1.npz"), find("array-24")
    card, omega_b = calibrate_at_rest(log, layout, 470.0, "2026-01-02T00:00:00Z")
    turning = np.abs(omega_b).max(axis=1) > 0.2
    found = agreement(card.layout(layout), card.correct(log.f_axis), turning)
    assert found.still < 0.1 < 1.0 < found.turning
    assert found.text
