"""Simulated drives: their truth holds for a mechanisation that had no part in it, and their sensors
are as stated.
"""

import numpy as np
import pytest

from inertial.simulation.drive import CONDITIONS, DEG, Condition, Sensors, gauss_markov, simulate
from inertial.simulation.drive_path import RATE, drive_truth
from tests.inertial.twins.strapdown import State, step

PERFECT = Condition(
    "no errors at all",
    Sensors(
        accel_noise=0.0,
        gyro_noise=0.0,
        accel_still=0.0,
        gyro_still=0.0,
        accel_bias=0.0,
        gyro_bias=0.0,
        accel_wander=0.0,
        gyro_wander=0.0,
        scale=0.0,
        fix_white=(0.0,) * 3,
        fix_wander=(0.0,) * 3,
        fix_velocity=(0.0,) * 3,
        latency=0.0,
    ),
)


@pytest.mark.parametrize("seed", [1, 2])
def test_the_filters_mechanisation_follows_the_truth(seed):
    """Two ways to the same motion: Newton in the Earth's frame, and the strapdown equations in the
    local one.
    """
    truth = drive_truth(seed)
    place = truth.latitude[0], truth.longitude[0], truth.height[0]
    x = State(*place, truth.v_n[0], truth.C_nb[0])
    for k in range(1, len(truth.t)):
        x = step(x, truth.f_b[k], truth.omega_ib_b[k], 1.0 / RATE)
    north = x.latitude - truth.latitude[-1]
    east = (x.longitude - truth.longitude[-1]) * np.cos(x.latitude)
    assert (
        max(abs(north), abs(east)) * 6.37e6 < 1.0
    )  # after 300 s; 1e-5 m/s^2 of difference would give 0.45 m
    assert abs(x.height - truth.height[-1]) < 0.05
    np.testing.assert_allclose(x.v_n, truth.v_n[-1], atol=0.01)
    np.testing.assert_allclose(x.C_nb, truth.C_nb[-1], atol=1e-5)


def test_a_drive_is_a_drive():
    truth = drive_truth(3, climb=90.0)
    speed = np.linalg.norm(truth.v_n, axis=1)
    assert speed[: 20 * RATE - 200].max() < 1e-6  # it waits first
    assert 8.0 < speed.max() < 17.0
    assert 40.0 < np.ptp(truth.height) < 110.0
    assert np.abs(truth.omega_ib_b[:, 2]).max() > 20 * DEG  # corners
    assert np.abs(np.linalg.norm(truth.f_b[: 10 * RATE], axis=1) - 9.8).max() < 0.05


def test_a_seed_is_a_drive_and_a_condition_changes_only_what_it_says():
    a, b, c = (
        simulate(4, "B", seconds=120.0),
        simulate(4, "B", seconds=120.0),
        simulate(4, "C", seconds=120.0),
    )
    np.testing.assert_array_equal(a.imu, b.imu)
    np.testing.assert_array_equal(a.imu, c.imu)
    assert [f.latitude for f in a.fixes] == [f.latitude for f in b.fixes]
    assert c.gross and not a.gross
    for k, (one, other) in enumerate(zip(a.fixes, c.fixes, strict=True)):
        assert (one.latitude == other.latitude) == (k not in c.gross)


def test_without_errors_samples_and_fixes_are_the_truth():
    drive = simulate(5, PERFECT, seconds=100.0, lever_arm_b=(1.0, 0.5, -1.2))
    np.testing.assert_allclose(drive.imu[:, 1:4], drive.truth.f_b[1:], atol=1e-12)
    np.testing.assert_allclose(drive.imu[:, 4:7], drive.truth.omega_ib_b[1:], atol=1e-12)
    fix = drive.fixes[-1]
    k = drive.row_of(fix.t)
    arm = drive.truth.C_nb[k] @ [1.0, 0.5, -1.2]
    north = (fix.latitude - drive.truth.latitude[k]) * 6.36e6
    assert north == pytest.approx(arm[0], abs=0.02)
    assert fix.height - drive.truth.height[k] == pytest.approx(-arm[2], abs=1e-9)


def test_sensors_have_the_errors_they_state():
    drive = simulate(6, "B", seconds=200.0)
    error = drive.imu[:, 1:4] - drive.truth.f_b[1:] - drive.accel_bias
    moving = np.linalg.norm(drive.truth.v_n[1:], axis=1) > 6.0
    assert error[moving].std(axis=0) == pytest.approx(0.05 * np.sqrt(RATE), rel=0.15)
    assert error[: 10 * RATE].std(axis=0) == pytest.approx(0.006 * np.sqrt(RATE), rel=0.1)
    stepped, plain = simulate(6, "H2", seconds=200.0), drive
    jump = (stepped.accel_bias - plain.accel_bias)[-1]
    np.testing.assert_allclose(np.abs(jump), 0.3)
    assert not (stepped.accel_bias - plain.accel_bias)[:14_000].any()


def test_outages_withhold_the_fixes_in_them():
    drive = simulate(1, "I")
    hidden = [f.t for f in drive.fixes if f.withheld]
    assert len(hidden) == 60
    assert all(any(a <= t < a + 20.0 for a, _ in CONDITIONS["I"].outages) for t in hidden)


def test_gauss_markov_keeps_its_size_and_forgets_with_its_time():
    x = gauss_markov(np.random.default_rng(1), 200_000, np.array([2.0]), 50.0)[:, 0]
    assert x.std() == pytest.approx(2.0, rel=0.05)
    assert np.mean(x[50:] * x[:-50]) / np.mean(x * x) == pytest.approx(np.exp(-1.0), abs=0.05)


def test_wrong_asks_are_answered():
    with pytest.raises(ValueError, match="no condition 'Z'; want one of A, B, C"):
        simulate(1, "Z")
    with pytest.raises(ValueError, match="want at least 60 s of driving"):
        simulate(1, "B", seconds=70.0)
