"""A cube in a car: its readings, the closed form of unaided drift, and its estimates through a
navigation filter.
"""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from support.cube_drive import cube_readings

from estimator.devices.gyro_free import NOISE, GyroFreeNavigation, attitude_noise, config_of
from estimator.devices.rate import RateOutput
from inertial.layouts.catalogue import CUBE
from inertial.navigation.navigation import Mode, NavigatorConfig, Solution
from inertial.navigation.unaided import equivalent_drift, position_error
from inertial.simulation.drive import simulate
from inertial.simulation.table import IDEAL


def test_drift_of_unaided_navigation_by_the_closed_form():
    """Against integration of the same errors: dv = b + (d t) x (0, 0, -g)."""
    b, d = np.array([0.04, 0.02, 0.05]), np.radians([0.01, -0.02, 0.03])
    t = np.linspace(0.0, 20.0, 20_001)
    a = b + np.cross(d[None, :] * t[:, None], [0.0, 0.0, -9.80665])
    p = np.cumsum(np.cumsum(a, axis=0), axis=0) * (t[1] - t[0]) ** 2
    np.testing.assert_allclose(position_error(b, d, t[[-1]])[0], p[-1], rtol=1e-3, atol=1e-6)


def test_readings_of_a_cube_hold_the_drives_field():
    drive = simulate(2, "B", seconds=90.0)
    layout = CUBE(0.05)
    z = cube_readings(drive, layout, IDEAL, 1)
    k = 6000
    omega = drive.truth.omega_ib_b[k + 1]
    alpha = (drive.truth.omega_ib_b[k + 2] - drive.truth.omega_ib_b[k]) / 0.02
    for axis in range(layout.axes):
        r = layout.r_b[axis]
        f = drive.truth.f_b[k + 1] + np.cross(alpha, r) + np.cross(omega, np.cross(omega, r))
        assert z[k, axis] == pytest.approx(float(f @ layout.theta_b[axis]), abs=1e-9)


def test_estimates_of_a_rate_estimator_are_navigated_with():
    """Estimates with a gyro-free estimator's kind of error, 2 deg/s that wander; fixes hold
    position and heading.
    """
    drive = simulate(2, "B", seconds=110.0)
    truth, draw = drive.truth, np.random.default_rng(3)
    wander = np.radians(1.0) * np.sin(
        np.arange(len(truth.t))[:, None] / 700.0 + draw.uniform(0, 6, 3)
    )
    navigation = GyroFreeNavigation("cube", NavigatorConfig(), ["kf"], 10.0, "products-ekf", 200.0)
    fixes, errors, sigma, P = list(drive.fixes), [], [], np.radians(1.0) ** 2 * np.eye(3)
    for k in range(0, len(truth.t) - 10, 10):
        t = drive.imu[k : k + 10, 0]
        said = [
            RateOutput(
                i, k + i, name, SimpleNamespace(f_b=truth.f_b[k + i + 1], omega_b=omega, P=P)
            )
            for i in range(10)
            for name, omega in (
                (
                    "products-ekf",
                    truth.omega_ib_b[k + i + 1] + (wander[k + i] if t[i] > 21.0 else 0.0),
                ),
                ("least-squares", np.full(3, 9.0)),  # not believed, so it must not matter
            )
        ]
        for o in navigation.feed(1, 0.01, t, said):
            if isinstance(o.what, Solution) and o.what.mode == Mode.NAVIGATING and o.what.t > 40.0:
                row = drive.row_of(o.what.t)
                assert o.index == row - 1
                north = (o.what.latitude - truth.latitude[row]) * 6.36e6
                errors.append([north, *(o.what.v_n - truth.v_n[row])])
                sigma.append(o.what.sigma[6])
        while fixes and fixes[0].arrival <= t[-1]:
            navigation.board.fix(fixes.pop(0))
    errors = np.array(errors)
    assert len(errors) > 300
    assert np.sqrt(np.mean(errors[:, 0] ** 2)) < 5.0
    assert np.sqrt(np.mean(errors[:, 1:3] ** 2)) < 1.0
    assert 0.3 < np.mean(sigma) < 3.0


def test_process_noise_follows_the_covariance_of_the_rate():
    P, C_nb = (
        np.diag([0.01, 0.04, 100.0]),
        np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
    )
    noise = attitude_noise(P, C_nb) - NOISE.gyro**2
    np.testing.assert_allclose(noise, 2.0 * np.array([0.04, 0.01, np.radians(60.0) ** 2]))


def test_equivalent_drift_is_the_closed_form_turned_round():
    d = np.radians([0.0, 0.02, 0.0])
    error = np.linalg.norm(position_error(np.array([-0.03, 0.0, 0.0]), d, np.array([30.0]))[0])
    assert equivalent_drift(float(error), 0.03, 30.0) == pytest.approx(d[1])
    assert equivalent_drift(1.0, 0.03, 30.0) == 0.0


def test_a_cube_is_not_taken_for_a_gyro():
    config = config_of(NavigatorConfig(lever_arm_b=(1.0, 0.0, 0.0)))
    assert config.lever_arm_b == (1.0, 0.0, 0.0)
    assert config.imu is NOISE and config.sigma_bias_gyro > math.radians(1.0)
    assert not config.alignment.in_motion
