"""A driven table follows orders with limited acceleration, and its readings are those of its
motion.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from inertial.constants import GRAVITY
from inertial.rate.field import cube_angular_acceleration, cube_specific_force
from inertial.simulation.driven import ACCELERATION, DrivenTable
from inertial.simulation.table import IDEAL

DEG = np.pi / 180.0


def driven(**options) -> DrivenTable:
    return DrivenTable(seed=3, sensor=IDEAL, tilt=0.0, **options)


def run(table: DrivenTable, seconds: float, n: int = 5):
    parts = [table.step(n) for _ in range(round(seconds / table.period_s / n))]
    join = lambda name: np.concatenate([getattr(block, name) for block, _ in parts])  # noqa: E731
    return join, [pulse for _, pulses in parts for pulse in pulses]


@settings(max_examples=20, deadline=None)
@given(st.lists(st.floats(-300.0, 300.0), min_size=1, max_size=4), st.integers(1, 9))
def test_rate_follows_with_limited_acceleration_and_pulses_count_the_angle(rates, n):
    table = driven()
    angles, omegas, pulses = [], [], []
    for rate in rates:
        table.set_rate(rate * DEG)
        join, seen = run(table, 2.0, n)
        angles.append(join("angle_z"))
        omegas.append(join("omega_b")[:, 2])
        pulses += seen
    angle, omega = np.concatenate(angles), np.concatenate(omegas)
    assert np.abs(np.diff(omega)).max() <= ACCELERATION * table.period_s + 1e-9
    pitch = 2.0 * np.pi / table.pulses_per_rev
    assert abs(sum(p.direction for p in pulses) * pitch - table._angle) <= pitch
    assert all(b.t_s > a.t_s for a, b in zip(pulses, pulses[1:], strict=False))
    grown = np.diff(angle) - 0.5 * (omega[1:] + omega[:-1]) * table.period_s
    assert np.abs(grown).max() < 1e-9
    if abs(rates[-1]) < 200.0:  # reached within two seconds from any of the others
        assert len(rates) > 1 or omega[-1] == pytest.approx(rates[-1] * DEG, abs=1e-9)


def test_readings_are_those_of_the_motion():
    table = driven()
    table.set_rate(200.0 * DEG)
    join, _ = run(table, 0.5)
    rows = join("readings")
    alpha = np.array([cube_angular_acceleration(row, 0.1) for row in rows])
    assert np.abs(alpha - join("alpha_b")).max() < 1e-9
    f = np.array([cube_specific_force(row) for row in rows])
    assert np.abs(f - join("f_b")).max() < 1e-9


@pytest.mark.parametrize("up", [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, -1)])
def test_the_cube_is_turned_over_as_its_own_motion_says(up):
    table = driven()
    assert table.turn_over(np.array(up, dtype=float))
    join, _ = run(table, 1.6)
    omega, alpha = join("omega_b"), join("alpha_b")
    numeric = np.gradient(omega, table.period_s, axis=0)
    assert np.abs(numeric - alpha)[2:-12].max() < 0.05 * np.abs(alpha).max()
    said = np.array([cube_angular_acceleration(row, 0.1) for row in join("readings")])
    assert np.abs(said - alpha).max() < 1e-9
    join, _ = run(table, 0.2)
    np.testing.assert_allclose(join("f_b")[-1], GRAVITY * np.array(up), atol=1e-9)


def test_a_hand_and_the_drive_do_not_meet():
    table = driven()
    table.set_rate(50.0 * DEG)
    run(table, 0.5)
    assert not table.turn_over(np.array([1.0, 0.0, 0.0]))
    table.stop()
    run(table, 1.0)
    assert table.turn_over(np.array([1.0, 0.0, 0.0]))
    table.set_rate(50.0 * DEG)  # waits until the hand is gone
    join, _ = run(table, 1.0)
    assert np.ptp(join("angle_z")) == 0.0
    run(table, 1.0)
    assert table.rate() == pytest.approx(50.0 * DEG)


def test_what_the_drive_cannot_is_refused():
    table = driven()
    for order in ((800.0 * DEG, None), (10.0, 1000.0), (float("nan"), None), (1.0, 0.0)):
        with pytest.raises(ValueError, match="°/s"):
            table.set_rate(*order)
