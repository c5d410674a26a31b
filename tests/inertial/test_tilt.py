"""Tilt filters: the article's numbers, its angles, and what the filters do with a known motion."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from inertial.attitude import tilt
from inertial.attitude.filters import ATTITUDES, PublishedTilt, VectorTilt, to_ned
from inertial.attitude.rotation import to_dcm

RATE = 200.0
G = 9.81
component = st.floats(-1.0, 1.0, allow_nan=False)


def swing(seconds: float, bias: float = 0.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A board that rolls and pitches on the spot: C_nb (n, 3, 3), force and rate (n, 3) with a gyro
    bias, rad/s.
    """
    t = np.arange(round(seconds * RATE)) / RATE
    angles = np.column_stack([0.3 * np.sin(0.4 * t), 0.5 * np.sin(0.9 * t), 0.8 * np.sin(1.3 * t)])
    body = Rotation.from_euler("ZYX", angles)
    turn = (body[:-1].inv() * body[1:]).as_rotvec() * RATE
    omega = np.vstack([turn[:1], turn]) + bias
    return body.as_matrix(), body.inv().apply([0.0, 0.0, -G]), omega


def inclination(q_nb: np.ndarray, C_nb: np.ndarray) -> np.ndarray:
    """Angle between the down of both, rad."""
    down = np.array([to_dcm(q)[2] for q in q_nb])
    return np.arccos(np.clip(np.einsum("ij,ij->i", down, C_nb[:, 2]), -1.0, 1.0))


def test_squares_of_the_direction_cosines_sum_to_one():
    R = np.array([0.5, 0.79, 0.33])
    cosines = tilt.direction_cosines(R)
    assert np.sum(cosines**2) == pytest.approx(1.0, abs=1e-15)
    np.testing.assert_allclose(cosines * np.linalg.norm(R), R)


@settings(deadline=None)  # the first call compiles
@given(x=component, y=component, z=component)
def test_projection_angles_give_the_direction_back(x, y, z):
    R = np.array([x, y, z])
    if np.linalg.norm(R) < 1e-3 or abs(z) / np.linalg.norm(R) < tilt.ILL_CONDITIONED:
        return  # there the article does not use the angles
    R /= np.linalg.norm(R)
    xz, yz = tilt.projection_angles(R)
    np.testing.assert_allclose(tilt.from_projection_angles(xz, yz, np.sign(z)), R, atol=1e-9)


def test_the_published_filter_is_the_published_arithmetic():
    """One step by hand: R = (0, 0, 1), 0.2 rad/s and -0.1 rad/s for 10 ms, accelerometer (0.1, 0,
    1).
    """
    state = np.array([0.0, 0.0, 1.0, 0.2, -0.1, 1.0])
    out = np.empty((1, 3))
    tilt.published(state, np.array([[0.1, 0.0, 1.0]]), np.array([[0.2, -0.1]]), 0.01, 5.0, out)
    xz, yz = 0.002, -0.001
    x = np.sin(xz) / np.sqrt(1 + np.cos(xz) ** 2 * np.tan(yz) ** 2)
    y = np.sin(yz) / np.sqrt(1 + np.cos(yz) ** 2 * np.tan(xz) ** 2)
    gyro = np.array([x, y, np.sqrt(1 - x * x - y * y)])
    blend = (np.array([0.1, 0.0, 1.0]) / np.sqrt(1.01) + 5.0 * gyro) / 6.0
    np.testing.assert_allclose(out[0], blend / np.linalg.norm(blend), atol=1e-15)


def test_near_the_horizon_of_z_the_published_filter_keeps_its_estimate():
    state = np.array([1.0, 0.0, 0.05, 3.0, 3.0, 1.0])
    out = np.empty((1, 3))
    tilt.published(state, np.array([[1.0, 0.0, 0.05]]), np.array([[3.0, 3.0]]), 0.01, 10.0, out)
    np.testing.assert_allclose(
        out[0], np.array([1.0, 0.0, 0.05]) / np.linalg.norm([1.0, 0.0, 0.05]), atol=1e-3
    )


@pytest.mark.parametrize("name", ATTITUDES)
def test_a_board_turning_on_the_spot_is_followed(name):
    C_nb, f, w = swing(20.0)
    error = inclination(ATTITUDES[name](1 / RATE).batch(f, w), C_nb)
    assert np.degrees(error[200:].max()) < 1.0


def test_only_the_vector_form_follows_a_board_that_also_turns_about_its_vertical():
    """The article leaves the third gyro out: without the accelerometer's pull its error grows with
    the yaw rate.
    """
    C_nb, f, w = swing(20.0)
    vector = inclination(VectorTilt(1 / RATE, time_constant=100.0).batch(f, w), C_nb)
    published = inclination(PublishedTilt(1 / RATE, w_gyro=20000.0).batch(f, w), C_nb)
    assert np.degrees(vector.max()) < 0.4
    assert np.degrees(published.max()) > 3.0


@pytest.mark.parametrize("name", ATTITUDES)
def test_samples_one_by_one_give_the_numbers_of_the_batch(name):
    _, f, w = swing(2.0, bias=0.01)
    stepped = ATTITUDES[name](1 / RATE)
    one_by_one = np.array([stepped.step(a, b).q_nb for a, b in zip(f, w, strict=True)])
    np.testing.assert_array_equal(one_by_one, ATTITUDES[name](1 / RATE).batch(f, w))


@pytest.mark.parametrize("name", ATTITUDES)
def test_silence_of_the_accelerometer_gives_no_nan(name):
    attitude = ATTITUDES[name](1 / RATE)
    for k in range(50):
        f = np.zeros(3) if k % 2 else np.array([0.0, 0.0, -G])
        assert np.isfinite(attitude.step(f, np.array([0.1, 0.0, 0.0])).q_nb).all()


@pytest.mark.parametrize("name", ATTITUDES)
def test_a_board_that_lies_on_its_back_is_on_its_back(name):
    attitude = ATTITUDES[name](1 / RATE)
    for _ in range(400):
        q = attitude.step(np.array([0.0, 0.0, G]), np.zeros(3)).q_nb
    np.testing.assert_allclose(to_dcm(q)[2], [0.0, 0.0, -1.0], atol=1e-6)


def test_vqf_finds_the_bias_of_its_gyro_at_rest():
    attitude = ATTITUDES["vqf"](1 / RATE)
    bias = np.array([0.01, -0.008, 0.005])
    for _ in range(round(20 * RATE)):
        state = attitude.step(np.array([0.0, 0.0, -G]), bias)
    assert state.resting
    np.testing.assert_allclose(state.bias_omega_b, bias, atol=1e-4)


def test_east_north_up_becomes_north_east_down():
    q = Rotation.random(20, random_state=3).as_quat()[:, [3, 0, 1, 2]]
    swap = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    for a, b in zip(q, to_ned(q), strict=True):
        np.testing.assert_allclose(to_dcm(b), swap @ to_dcm(a), atol=1e-12)
