"""Noise that the readings themselves show: an axis that vibrates is believed less, and only that
axis. E-131.
"""

import math
import pickle

import numpy as np
import pytest

from inertial.core import navigation as core
from inertial.navigation.error_model import ImuNoise, make_model
from inertial.rotation import turn_matrix

DT = 0.01
LEVEL = np.array([0.0, 0.0, -9.8])


def leg_after(
    f: np.ndarray, w: np.ndarray, C_nb: np.ndarray = np.eye(3), shake: float = 1.0, cuts: int = 1
):
    """A leg and its model after the samples f, w (n, 3), given in `cuts` calls."""
    model = make_model(ImuNoise(shake=shake))
    leg = core.new_leg(model.states)
    leg.x.latitude, leg.x.longitude, leg.x.height = 0.7, -1.8, 1600.0
    leg.x.C_nb = C_nb
    t = DT * np.arange(1, len(f) + 1)
    imu = np.column_stack([t, f, w])
    k = 0
    for end in np.linspace(0.0, t[-1], cuts + 1)[1:]:
        k = leg.run(model, imu, k, until=float(end) if cuts > 1 else math.inf)
    return leg, model


def densities(leg) -> np.ndarray:
    """(6,): accelerometer, gyro."""
    return np.concatenate([leg.shake.accel, leg.shake.gyro])


def white(seed: int, n: int, sigma: np.ndarray) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(n, len(sigma))) * sigma


def test_white_noise_is_found_at_its_density() -> None:
    sigma = np.array([0.1, 0.3, 0.2, 0.01, 0.04, 0.02])
    means = []
    for seed in range(20):
        noise = white(seed, 1000, sigma)
        leg, _ = leg_after(LEVEL + noise[:, :3], noise[:, 3:])
        means.append(densities(leg))
    np.testing.assert_allclose(np.mean(means, axis=0), sigma**2 * DT, rtol=0.15)


def test_a_steady_turn_and_a_steady_force_are_no_noise() -> None:
    n = 500
    leg, _ = leg_after(np.tile(LEVEL + [2.0, 1.0, 0.0], (n, 1)), np.tile([0.1, -0.2, 0.5], (n, 1)))
    assert np.all(densities(leg) == 0.0)


def test_only_the_axis_that_shakes_grows_and_in_the_frame_of_n() -> None:
    n, sigma = 1000, math.radians(10.0)
    w = np.zeros((n, 3))
    w[:, 1] = sigma * (-1.0) ** np.arange(n)  # pitch to and fro: no angle is gathered
    C_nb = turn_matrix(
        np.array([0.0, 0.0, math.radians(90.0)])
    )  # b forward looks east: pitch turns about -north
    calm, model = leg_after(np.tile(LEVEL, (n, 1)), w, C_nb, shake=0.0)
    shaken, _ = leg_after(np.tile(LEVEL, (n, 1)), w, C_nb)
    for leg in (calm, shaken):
        leg.close(model)
    more = np.diag(shaken.Q - calm.Q)
    # each of two differences is 2 sigma: density sigma^2 2 dt, over 10 s, the first second of
    # memory being less
    assert more[0] == pytest.approx(2.0 * sigma**2 * DT * 9.2, rel=0.1)
    assert more[1] < 1e-3 * more[0] and more[2] < 1e-3 * more[0]
    np.testing.assert_allclose(shaken.Q, shaken.Q.T, atol=1e-18)
    assert np.linalg.eigvalsh(shaken.Q)[0] > -1e-12


def test_the_state_does_not_depend_on_how_samples_are_cut_into_calls() -> None:
    noise = white(7, 400, np.full(6, 0.1))
    whole, _ = leg_after(LEVEL + noise[:, :3], noise[:, 3:])
    cut, _ = leg_after(LEVEL + noise[:, :3], noise[:, 3:], cuts=200)
    assert np.array_equal(densities(whole), densities(cut))
    assert pickle.loads(pickle.dumps(whole)) == whole
