"""The still detector on simulated standstill and turning."""

import numpy as np
import pytest

from estimator.layouts.layout import CUBE, LAYOUTS
from estimator.rate.still import Config, Standstill, StillDetector, quiet_map
from estimator.simulation.table import TableTest

SURE = 0.02**2 * np.eye(3)


def answers(profile, rates=None, seed=1):
    """The detector's word for three blocks (30 s), told the true rate or `rates`."""
    table = TableTest(seed, profile=profile)
    detector = StillDetector(12, quiet_map(table.layout))
    detector.learn(table.block(0).readings[:450].mean(axis=0), 450)
    said, turning = [], []
    for number in range(3):
        block = table.block(number)
        for row in range(len(block.t_s)):
            omega = block.omega_b[row] if rates is None else rates
            said.append(detector.update(block.readings[row], omega, SURE, table.period_s))
            turning.append(abs(block.omega_b[row, 2]))
    return np.array(said), np.array(turning)


def test_a_cube_at_rest_is_still_after_one_window():
    said, _ = answers("still")
    assert not said[:24].any()
    assert said[24:].mean() > 0.98


def test_a_turning_cube_is_not_still():
    said, rate = answers("published")
    assert not said[rate > 0.3].any()


def test_wobble_never_looks_still_at_its_slowest():
    said, rate = answers("wobble")
    assert not said[rate > 0.4].any()


def test_standstill_is_found_within_half_a_second():
    said, _ = answers("published")
    assert said[1550:1790].mean() > 0.95  # still from 15 to 18 s
    assert said[2850:3000].mean() > 0.95


def test_a_wrong_rate_is_overruled_by_axes_that_keep_still():
    said, _ = answers("still", rates=np.array([0.0, 0.0, 1.0]))
    assert not said[:200].any()
    assert said[300:].mean() > 0.9


def test_a_gap_empties_the_window():
    detector = StillDetector(12, quiet_map(CUBE(0.05)))
    for _ in range(30):
        still = detector.update(np.zeros(12), np.zeros(3), SURE, 0.01)
    assert still
    detector.forget()
    assert not detector.update(np.zeros(12), np.zeros(3), SURE, 0.01)


def test_layouts_without_products_watch_the_angular_acceleration():
    assert quiet_map(CUBE(0.05)).shape == (9, 12)
    assert quiet_map(LAYOUTS["nine"](0.05)).shape == (3, 9)


def test_the_newest_samples_of_a_standstill_are_held_back():
    standstill = Standstill(1, guard=2)
    with pytest.raises(ValueError, match="keep the body still longer"):
        standstill.mean()
    for value in (1.0, 2.0, 3.0, 100.0, 100.0):
        standstill.add(np.array([value]))
    assert standstill.samples == 3
    assert standstill.mean() == pytest.approx([2.0])


def test_noise_alone_seldom_denies_a_standstill():
    table = TableTest(9, profile="still")
    detector = StillDetector(12, quiet_map(table.layout), Config())
    block = table.block(0)
    detector.learn(block.readings[:500].mean(axis=0), 500)
    said = [detector.update(a, np.zeros(3), SURE, 0.01) for a in block.readings]
    assert np.mean(said[25:]) > 0.98
