"""Tilt filters: the article's numbers, its angles, and what the filters do with a known motion."""

import pickle

import numpy as np
import pytest
import vqf
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from support.twins import tilt as twins

from inertial.attitude import filters, tilt
from inertial.attitude.filters import ATTITUDES, PublishedTilt, VectorTilt
from inertial.core import _core_plain, attitude
from inertial.rotation import multiply, to_matrix

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
    down = to_matrix(q_nb)[:, 2]
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
    np.testing.assert_allclose(attitude.from_projection_angles(xz, yz, np.sign(z)), R, atol=1e-9)


def test_the_published_filter_is_the_published_arithmetic():
    """One step by hand: R = (0, 0, 1), 0.2 rad/s and -0.1 rad/s for 10 ms, accelerometer (0.1, 0,
    1).
    """
    one = attitude.PublishedTilt(
        period=0.01, w_gyro=5.0, started=True, R_a=[0.0, 0.0, 1.0], rate_xz=0.2, rate_yz=-0.1
    )
    one.batch(np.array([[0.1, 0.0, -1.0]]), np.array([[-0.1, 0.2, 0.0]]))
    xz, yz = 0.002, -0.001
    x = np.sin(xz) / np.sqrt(1 + np.cos(xz) ** 2 * np.tan(yz) ** 2)
    y = np.sin(yz) / np.sqrt(1 + np.cos(yz) ** 2 * np.tan(xz) ** 2)
    gyro = np.array([x, y, np.sqrt(1 - x * x - y * y)])
    blend = (np.array([0.1, 0.0, 1.0]) / np.sqrt(1.01) + 5.0 * gyro) / 6.0
    np.testing.assert_allclose(one.R_a, blend / np.linalg.norm(blend), atol=1e-15)


def test_near_the_horizon_of_z_the_published_filter_keeps_its_estimate():
    before = np.array([1.0, 0.0, 0.05])
    one = attitude.PublishedTilt(
        period=0.01, w_gyro=10.0, started=True, R_a=before, rate_xz=3.0, rate_yz=3.0
    )
    one.batch(np.array([[1.0, 0.0, -0.05]]), np.array([[3.0, 3.0, 0.0]]))
    np.testing.assert_allclose(one.R_a, before / np.linalg.norm(before), atol=1e-3)


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
    np.testing.assert_allclose(to_matrix(q)[2], [0.0, 0.0, -1.0], atol=1e-6)


def test_vqf_finds_the_bias_of_its_gyro_at_rest():
    attitude = ATTITUDES["vqf"](1 / RATE)
    bias = np.array([0.01, -0.008, 0.005])
    for _ in range(round(20 * RATE)):
        state = attitude.step(np.array([0.0, 0.0, -G]), bias)
    assert state.resting
    np.testing.assert_allclose(state.bias_omega_b, bias, atol=1e-4)


def shaken(seed: int = 4) -> tuple[np.ndarray, np.ndarray]:
    """Ten minutes' worth of turns, blows, rest and silence, force and rate (n, 3)."""
    draw = np.random.default_rng(seed)
    _, f, w = swing(60.0, bias=0.012)
    f, w = f + draw.normal(0.0, 0.4, f.shape), w + draw.normal(0.0, 0.01, w.shape)
    still = 2000
    f[:still], w[:still] = [1.0, 0.5, -9.7], [0.004, -0.002, 0.003]
    f[4000::37] *= -1.0
    f[5000::301] = 0.0
    return f, w


@pytest.mark.parametrize("name", ATTITUDES)
def test_both_builds_give_the_same_bits(name, monkeypatch):
    f, w = shaken()
    found = ATTITUDES[name](1 / RATE).batch(f, w)
    monkeypatch.setattr(filters, "attitude", _core_plain.attitude)
    np.testing.assert_array_equal(ATTITUDES[name](1 / RATE).batch(f, w), found)


@pytest.mark.parametrize("name", ATTITUDES)
def test_a_filter_that_was_saved_goes_on_to_the_bit(name):
    f, w = shaken()
    whole = ATTITUDES[name](1 / RATE)
    whole.batch(f[:5000], w[:5000])
    other = pickle.loads(pickle.dumps(whole))
    np.testing.assert_array_equal(other.batch(f[5000:], w[5000:]), whole.batch(f[5000:], w[5000:]))


@pytest.mark.parametrize("name", ["tilt-published", "tilt-vector"])
def test_the_readable_twin_has_the_same_bits(name):
    f, w = shaken()
    twin = {"tilt-published": twins.PublishedTilt, "tilt-vector": twins.VectorTilt}[name]
    made = ATTITUDES[name](1 / RATE)
    twin = twin(1 / RATE, made._native.w_gyro)
    expected = [twin.step(a, b) for a, b in zip(f[:4500], w[:4500], strict=True)]
    np.testing.assert_array_equal(made.batch(f[:4500], w[:4500]), expected)


def test_vqf_is_that_of_its_authors():
    f, w = shaken()
    authors = vqf.VQF(1 / RATE)
    q_eb = authors.updateBatch(w, f)["quat6D"]
    ours = ATTITUDES["vqf"](1 / RATE)
    q_nb = ours.batch(f, w)
    q_ne = np.array([0.0, 1.0, 1.0, 0.0]) / np.sqrt(2.0)
    np.testing.assert_allclose(q_nb, multiply(q_ne, q_eb), atol=1e-9)
    bias = authors.getBiasEstimate()[0]
    np.testing.assert_allclose(ours._native.bias_b, bias, atol=1e-12)
    assert np.linalg.norm(bias) > 1e-3
    assert ours._native.resting == authors.getRestDetected()
