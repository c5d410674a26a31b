"""The simulated table against finite differences of its own attitude, and what it promises to
repeat.
"""

import itertools

import numpy as np
import pytest

from inertial.constants import GRAVITY
from inertial.rotation import to_matrix
from inertial.simulation.profiles import PROFILES
from inertial.simulation.table import BLOCK, COUNTS, IDEAL, SensorModel, TableTest


@pytest.mark.parametrize("name", PROFILES)
def test_rate_and_acceleration_are_derivatives_of_the_angle(name):
    profile, h = PROFILES[name], 1e-4
    t = np.linspace(0.01, profile.seconds - 0.01, 977)
    before, at, after = (profile.motion(t + k * h) for k in (-1, 0, 1))
    np.testing.assert_allclose((after[0] - before[0]) / (2 * h), at[1], atol=1e-5)
    np.testing.assert_allclose((after[1] - before[1]) / (2 * h), at[2], atol=1e-2)


@pytest.mark.parametrize("name", PROFILES)
def test_a_profile_starts_and_ends_at_rest(name):
    profile = PROFILES[name]
    _, rate, acceleration = profile.motion(
        np.array([0.0, 4.9, profile.seconds - 1e-9, profile.seconds])
    )
    np.testing.assert_allclose(rate, 0.0, atol=1e-6)
    np.testing.assert_allclose(acceleration, 0.0, atol=1e-6)


def test_the_published_test_turns_clockwise_first_and_comes_back():
    angle, rate, _ = PROFILES["published"].motion(np.array([10.0, 22.0, 30.0]))
    np.testing.assert_allclose(np.rad2deg(rate), [-171.0, 171.0, 0.0], atol=1e-9)
    assert angle[2] == pytest.approx(0.0, abs=1e-9)


def test_readings_are_the_second_difference_of_sensor_positions():
    table = TableTest(
        profile="published", sensor=IDEAL, rate_hz=2000.0, centre_b=(0.01, -0.02, 0.03)
    )
    block = table.block(11)  # from 5.5 s, in the ramp
    C_nb = np.array([to_matrix(q) for q in block.q_nb])
    h = table.period_s
    R_n = np.einsum("tij,kj->tki", C_nb, table.layout.r_b + [0.01, -0.02, 0.03])
    felt_n = (R_n[2:] - 2 * R_n[1:-1] + R_n[:-2]) / h**2 - [0.0, 0.0, GRAVITY]
    felt_b = np.einsum("tji,tkj->tki", C_nb[1:-1], felt_n)
    expected = np.sum(felt_b * table.layout.theta_b, axis=2)
    np.testing.assert_allclose(block.readings[1:-1], expected, atol=2e-4)


def test_truth_rate_turns_the_truth_attitude():
    block = TableTest(profile="wobble", rate_hz=2000.0).block(16)
    C = np.array([to_matrix(q) for q in block.q_nb])
    turn = np.einsum("tji,tjk->tik", C[:-2], C[2:]) / (2.0 / 2000.0)
    np.testing.assert_allclose(turn[:, 1, 0], block.omega_b[1:-1, 2], atol=1e-4)


def test_a_cube_at_rest_reads_one_g_upward():
    block = TableTest(profile="still", sensor=IDEAL, tilt=0.0).block(0)
    np.testing.assert_allclose(block.f_b[0], [0.0, 0.0, GRAVITY], atol=1e-12)


def test_same_seed_same_counts_and_other_seed_others():
    first, again, other = (TableTest(seed).block(3).counts for seed in (5, 5, 6))
    np.testing.assert_array_equal(first, again)
    assert (first != other).any()


def test_samples_go_on_across_blocks_and_repetitions():
    table = TableTest(2)
    samples = list(itertools.islice(table, 3 * BLOCK + 5))  # 30 s and a little
    assert np.allclose(np.diff([s.t_s for s in samples]), 0.01)
    assert samples[3000].truth.profile_time_s == pytest.approx(0.0, abs=1e-9)
    assert samples[3000].t_s == pytest.approx(30.0)
    np.testing.assert_array_equal(samples[1234].counts, table.block(1).counts[234])


def test_sensors_saturate():
    counts = TableTest(3, profile="still", sensor=SensorModel(bias=100.0)).block(0).counts
    assert counts.max() == COUNTS[1] and counts.min() == COUNTS[0]


def test_pulses_count_the_angle_with_its_direction():
    table = TableTest(1)
    clockwise, back = table.pulses(0.0, 16.0), table.pulses(16.0, 30.0)
    degrees = np.rad2deg(-table.profile.motion(np.array([16.0]))[0][0])
    assert abs(len(clockwise) - degrees) <= 1
    assert {p.direction for p in clockwise} == {-1}
    assert {p.direction for p in back} == {1}
    times = [p.t_s for p in clockwise]
    assert times == sorted(times) and times[0] > 5.0 and times[-1] < 15.0
    in_pieces = [p for k in range(16) for p in table.pulses(k, k + 1.0)]
    np.testing.assert_allclose([p.t_s for p in in_pieces], times, atol=1e-6)


def test_plateau_pulses_come_at_the_rate_of_the_table():
    times = np.array([p.t_s for p in TableTest(1).pulses(8.0, 9.0)])
    np.testing.assert_allclose(1.0 / np.diff(times), 171.0, rtol=1e-6)


def test_a_profile_that_is_not_there_is_named():
    with pytest.raises(
        ValueError, match="no profile 'tumble'; want one of published, wobble, fast, still"
    ):
        TableTest(profile="tumble")
