"""Phi and H against finite differences of the mechanisation; the filter's algebra against numpy."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from support.estimator_drive import DT, exact

from inertial.navigation import update
from inertial.navigation.earth import ned_between
from inertial.navigation.error_model import STATES, ImuNoise
from inertial.navigation.leg import (
    Leg,
    close,
    current_covariance,
    make_model,
    new_leg,
    reset,
    run_leg,
)
from inertial.navigation.mechanise import NOMINAL, TIME
from inertial.navigation.strapdown import LAT, LON, C, H, V, rotation_vector, step, workspace

Array = NDArray[np.float64]

# inmotion-alignment, section 12: what second-order terms of one second of this motion leave
LARGEST = {
    ("v", "psi"): 1e-4,
    ("v", "B"): 1e-3,
    ("v", "D"): 5e-3,
    ("v", "v"): 1e-6,
    ("p", "p"): 1e-6,
    ("psi", "D"): 1e-3,
}
BLOCKS = {
    "psi": slice(0, 3),
    "v": slice(3, 6),
    "p": slice(6, 9),
    "B": slice(9, 12),
    "D": slice(12, 15),
}
MODEL = make_model(ImuNoise(tau=1e9))
STEPS = np.repeat([1e-4, 1e-2, 1.0, 1e-3, 1e-4], 3)


def disturbed(x: Array, error: Array) -> Array:
    """Nominal state whose error (computed - true) against true x is `error`."""
    out = full(x)
    reset(out, -error, MODEL)
    return out


def full(x: Array) -> Array:
    """A nominal state with the numbers that only some filters use, all zero."""
    return np.concatenate([x[:21], np.zeros(NOMINAL - 21)])


def error_of(x: Array, true: Array) -> Array:
    """Error state of x against the truth."""
    north, east, _ = ned_between(true[LAT], true[LON], true[H], x[LAT], x[LON], x[H])
    psi = rotation_vector(true[C].reshape(3, 3) @ x[C].reshape(3, 3).T)
    return np.concatenate(
        [
            psi,
            x[V] - true[V],
            [north, east, x[H] - true[H]],
            true[15:18] - x[15:18],
            true[18:21] - x[18:21],
        ]
    )


def run(x: Array, imu: Array, model=None, cuts: tuple[int, ...] = ()) -> Leg:
    model = model or MODEL
    leg = new_leg(model.n)
    leg.x[:] = full(x)
    t, f, w = imu[:, 0].copy(), imu[:, 1:4].copy(), imu[:, 4:7].copy()
    leg.acc[TIME] = t[0] - DT
    k = 0
    for stop in (*cuts, len(t)):
        k = run_leg(leg, model, t, f, w, k, stop, math.inf, math.inf)
    close(leg, model)
    return leg


def test_error_and_disturbance_agree() -> None:
    truth, _ = exact(8.0)
    error = 1e-4 * np.arange(1.0, 16.0)
    assert np.allclose(error_of(disturbed(truth[-1], error), truth[-1]), error, atol=1e-9)


def test_transition_matches_finite_differences() -> None:
    truth, imu = exact(9.0)
    start, second = truth[800], imu[800:900]
    Phi = run(start, second).Phi
    numeric = np.empty((STATES, STATES))
    for j in range(STATES):
        e = np.zeros(STATES)
        e[j] = STEPS[j]
        plus, minus = run(disturbed(start, e), second).x, run(disturbed(start, -e), second).x
        numeric[:, j] = (error_of(plus, truth[900]) - error_of(minus, truth[900])) / (
            2.0 * STEPS[j]
        )
    for (row, column), largest in LARGEST.items():
        difference = np.abs(Phi - numeric)[BLOCKS[row], BLOCKS[column]].max()
        assert difference < largest, (row, column, difference)
    assert np.abs(Phi - numeric).max() < 0.01


def test_registers_compute_what_the_reference_step_does() -> None:
    truth, imu = exact(20.0, ba=np.array([0.1, -0.2, 0.05]), bg=np.array([0.01, 0.002, -0.004]))
    x, work = truth[0].copy(), workspace()
    for row in imu:
        step(x, row[1:4], row[4:7], DT, work)
    leg = run(truth[0], imu)
    assert np.abs(ned_between(*x[:3], *leg.x[:3])).max() < 1e-8
    assert np.abs(leg.x[3:15] - x[3:15]).max() < 1e-10


def test_cutting_the_samples_changes_no_bit() -> None:
    truth, imu = exact(7.3)
    whole, cut = run(truth[0], imu), run(truth[0], imu, cuts=(1, 2, 57, 100, 333, 334, 729))
    assert (
        np.array_equal(whole.x, cut.x)
        and np.array_equal(whole.Phi, cut.Phi)
        and np.array_equal(whole.Q, cut.Q)
    )


@pytest.mark.parametrize("lever", [np.array([0.8, -0.4, -1.1]), np.zeros(3)])
@pytest.mark.parametrize("lags", [(0.0, 0.0), (0.03, 0.12)])
def test_measurement_matches_finite_differences(lever: Array, lags: tuple[float, float]) -> None:
    truth, imu = exact(9.0)
    model = make_model(ImuNoise(tau=1e9), lag=True)
    leg = run(truth[800], imu[800:850], model)
    x, w = leg.x.copy(), imu[850, 4:7] + np.array([0.1, -0.2, 0.3])
    x[27:29] = lags
    row = np.zeros(update.FIX_COLUMNS)
    row[1:4], row[4:7], row[7] = x[:3], x[V], 0.3
    y, H_rows, unused = np.empty(7), np.empty((7, model.n)), np.empty((7, model.n))
    leg.x[:] = x
    update.residual(leg, model, w, lever, row, y, H_rows)
    numeric = np.empty((7, model.n))
    steps = np.concatenate([STEPS, [1e-3, 1e-3]])
    for j in range(model.n):
        ends = []
        for side in (1.0, -1.0):
            e = np.zeros(model.n)
            e[j] = side * steps[j]
            leg.x[:] = x
            reset(leg.x, -e, model)
            value = np.empty(7)
            update.residual(leg, model, w, lever, row, value, unused)
            ends.append(value)
        numeric[:, j] = (ends[0] - ends[1]) / (2.0 * steps[j])
    if (
        lags[1] > 0.0
    ):  # what moved the velocity now moved it then too: the ring does not know of the disturbance
        H_rows[:, 3:6], numeric[:, 3:6] = 0.0, 0.0
    off = np.abs(H_rows - numeric)
    assert (
        off[:, 15:].max() < 0.1
    )  # of 12 m/s and 3 m/s^2: how the speed itself changed within the lag
    assert off[:, :15].max() < 2e-4  # lever arm times Earth's rate is left out of H


def test_gain_covariance_and_nis_are_the_textbook_ones() -> None:
    draw = np.random.default_rng(4)
    A = draw.normal(size=(STATES, STATES))
    P = A @ A.T + np.eye(STATES)
    H_rows, y = np.zeros((7, STATES)), np.zeros(7)
    H_rows[:6], y[:6] = draw.normal(size=(6, STATES)), draw.normal(size=6)
    B = draw.normal(size=(6, 6))
    R = np.zeros((7, 7))
    R[:6, :6] = B @ B.T + np.eye(6)
    PHt, S, G, u, c = (
        np.empty((STATES, 7)),
        np.empty((7, 7)),
        np.empty((7, 7)),
        np.empty(7),
        np.empty(STATES),
    )
    update.innovate(P, y, H_rows, R, 6, PHt, S)
    nis = update.factor(S, y, 6, G, u)
    Hm, Rm, ym, Sm = H_rows[:6], R[:6, :6], y[:6], S[:6, :6]
    K = P @ Hm.T @ np.linalg.inv(Sm)
    U = np.eye(STATES) - K @ Hm
    joseph = U @ P @ U.T + K @ Rm @ K.T
    after = P.copy()
    update.absorb(after, PHt, G, u, 6, c)
    assert np.allclose(Sm, Hm @ P @ Hm.T + Rm)
    assert nis == pytest.approx(ym @ np.linalg.solve(Sm, ym))
    assert (
        np.allclose(c, K @ ym)
        and np.allclose(after, joseph, atol=1e-9)
        and np.allclose(after, after.T)
    )
    inflated = P.copy()
    factor = update.consistent(inflated, 1e3 * y, H_rows, R, 6, PHt, S, G, u)
    assert factor > 1.0 and np.allclose(inflated, factor * P)
    assert update.factor(S, 1e3 * y, 6, G, u) <= 6.0


def test_process_noise_of_standing_still_grows_as_it_should() -> None:
    truth, imu = exact(10.0, still=100.0)
    noise = ImuNoise()
    model = make_model(noise)
    leg = new_leg(model.n)
    leg.x[:21] = truth[0]
    leg.P[:] = 0.0
    t, f, w = imu[:, 0].copy(), imu[:, 1:4].copy(), imu[:, 4:7].copy()
    run_leg(leg, model, t, f, w, 0, len(t), math.inf, math.inf)
    P = current_covariance(leg, model)
    walk = 2.0 / noise.tau * noise.sigma_bias_gyro**2 * 10.0**3 / 3.0
    assert P[2, 2] == pytest.approx(noise.gyro**2 * 10.0 + walk, rel=0.02)
    tilt = (9.8 * noise.gyro) ** 2 * 10.0**3 / 3.0  # of velocity, by tilt that walks
    bias = 2.0 / noise.tau * noise.sigma_bias_accel**2 * 10.0**3 / 3.0
    assert P[3, 3] == pytest.approx(noise.accel**2 * 10.0 + tilt + bias, rel=0.03)
