"""The mechanisation against its exact inverse, and the rotations against each other."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from support.estimator_drive import DT, exact

from inertial.navigation.earth import ned_between
from inertial.navigation.strapdown import (
    LAT,
    LON,
    C,
    H,
    V,
    dcm_to_euler,
    dcm_to_quaternion,
    euler_to_dcm,
    exp,
    orthonormalise,
    rotation_vector,
    step,
    workspace,
)

ANGLE = st.floats(-1.7, 1.7)


def test_closure_over_120_s() -> None:
    truth, imu = exact(120.0, ba=np.array([0.1, -0.2, 0.05]), bg=np.array([0.01, 0.002, -0.004]))
    x, work = truth[0].copy(), workspace()
    for row in imu:
        step(x, row[1:4], row[4:7], DT, work)
    end = truth[-1]
    assert np.abs(ned_between(end[LAT], end[LON], end[H], x[LAT], x[LON], x[H])).max() < 1e-8
    assert np.abs(x[V] - end[V]).max() < 3e-10
    assert np.abs(x[C] - end[C]).max() < 1e-12


@given(ANGLE, ANGLE, ANGLE)
def test_exp_and_log_are_inverse(a: float, b: float, c: float) -> None:
    v = np.array([a, b, c])
    assert np.allclose(rotation_vector(exp(v)), v, atol=1e-9)
    assert np.allclose(exp(v), Rotation.from_rotvec(v).as_matrix(), atol=1e-12)


@given(st.floats(-3.1, 3.1), st.floats(-1.55, 1.55), st.floats(-3.1, 3.1))
def test_attitude_forms_agree(roll: float, pitch: float, yaw: float) -> None:
    C_nb = euler_to_dcm(roll, pitch, yaw)
    assert np.allclose(C_nb, Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix(), atol=1e-12)
    assert dcm_to_euler(C_nb) == pytest.approx((roll, pitch, yaw), abs=1e-6)
    q = dcm_to_quaternion(C_nb)
    assert q[0] >= 0.0
    assert np.allclose(Rotation.from_quat(q, scalar_first=True).as_matrix(), C_nb, atol=1e-12)


def test_orthonormalise_takes_out_rounding() -> None:
    x = np.zeros(21)
    x[C] = (euler_to_dcm(0.3, -0.2, 2.0) * (1.0 + 1e-6)).ravel()
    orthonormalise(x)
    C_nb = x[C].reshape(3, 3)
    assert np.abs(C_nb @ C_nb.T - np.eye(3)).max() < 1e-11
