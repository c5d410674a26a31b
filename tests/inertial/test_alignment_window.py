"""The window of the alignment under way: its twin, its bits in both builds, its answer."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.twins.alignment import carried

from inertial import rotation
from inertial.core import _core_plain, native
from inertial.elementary import applied
from inertial.navigation.alignment_motion import MotionSettings, MotionWindow

RNG = np.random.default_rng(11)
T = 3.0 + np.arange(1, 1001) * 0.01
F, OMEGA = RNG.normal(0.0, 3.0, (1000, 3)), RNG.normal(0.0, 0.4, (1000, 3))
TIMES = np.array([3.0, 3.5, 4.123, 4.13, 7.0, 12.987])
BIAS_ACCEL, BIAS_GYRO = np.array([0.1, -0.05, 0.2]), np.array([0.01, 0.0, -0.02])


def test_core_and_readable_twin_give_the_same_bits():
    expected = carried(T, F, OMEGA, TIMES, BIAS_ACCEL, BIAS_GYRO)
    for build in (native, _core_plain):
        found = build.alignment.carried(T, F, OMEGA, TIMES, BIAS_ACCEL, BIAS_GYRO)
        for mine, his in zip(found, expected, strict=True):
            assert mine.tobytes() == his.tobytes()


def test_constant_force_and_rate_have_their_closed_form():
    omega, f = np.array([0.0, 0.0, 0.2]), np.array([1.0, 0.0, 0.0])
    C, u = native.alignment.carried(
        T, np.tile(f, (1000, 1)), np.tile(omega, (1000, 1)), TIMES, np.zeros(3), np.zeros(3)
    )
    for k, passed in enumerate(TIMES[1:] - TIMES[0]):
        np.testing.assert_allclose(
            C[k], Rotation.from_rotvec(omega * passed).as_matrix(), atol=1e-12
        )
        angle = 0.2 * passed
        np.testing.assert_allclose(u[k][:2] * 0.2, [np.sin(angle), 1 - np.cos(angle)], atol=1e-6)


def test_what_does_not_fit_is_refused():
    with pytest.raises(ValueError, match="samples: want"):
        native.alignment.carried(T, F[:5], OMEGA, TIMES, BIAS_ACCEL, BIAS_GYRO)
    with pytest.raises(ValueError, match="bias_gyro: want 3"):
        native.alignment.carried(T, F, OMEGA, TIMES, BIAS_ACCEL, np.zeros(2))


def test_a_circle_of_perfect_data_gives_its_attitude():
    """A level car on a circle of 8 m/s and 0.3 rad/s; the board sits askew by some degrees."""
    window = MotionWindow(MotionSettings())
    mounted = rotation.euler_matrix(0.02, -0.03, 0.0)
    for k in range(2001):
        t = 0.01 * k
        yaw = 0.5 + 0.3 * (t - 0.005)  # in the middle of the sample
        C_nb = rotation.euler_matrix(0.0, 0.0, yaw) @ mounted
        a_n = 8.0 * 0.3 * np.array([-np.sin(yaw), np.cos(yaw), 0.0])
        window.imu(t, C_nb.T @ (a_n - [0.0, 0.0, 9.80665]), C_nb.T @ [0.0, 0.0, 0.3])
        if k and k % 100 == 0:
            yaw = 0.5 + 0.3 * t
            v_n = 8.0 * np.array([np.cos(yaw), np.sin(yaw), 0.0])
            window.fix(t, v_n, np.full(3, 0.1))
    found = window.solve()
    truth = rotation.euler_matrix(0.0, 0.0, 0.5 + 0.3 * 20.0) @ mounted
    error = applied(truth, rotation.rotation_vector(truth.T @ found.C_nb))
    assert np.all(np.abs(error) < np.radians(0.5))
    assert found.chi2_per_dof < 0.1
