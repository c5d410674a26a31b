"""Phi and H against finite differences of the mechanisation; the filter's algebra against numpy."""

import math

import numpy as np
import pytest
from estimator_drive import DT, exact
from numpy.typing import NDArray

from estimator.ins import ekf as ins_ekf
from estimator.ins.earth import ned_between
from estimator.ins.error_model import STATES, ImuNoise, fix_residual
from estimator.ins.strapdown import LAT, LON, C, H, V, rotation_vector

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
BLOCKS = {"psi": slice(0, 3), "v": slice(3, 6), "p": slice(6, 9), "B": slice(9, 12), "D": slice(12, 15)}
STEPS = np.repeat([1e-4, 1e-2, 1.0, 1e-3, 1e-4], 3)


def disturbed(x: Array, error: Array) -> Array:
    """Nominal state whose error (computed - true) against true x is `error`."""
    out = x.copy()
    ins_ekf.reset(out, -error)
    return out


def error_of(x: Array, true: Array) -> Array:
    """Error state of x against the truth."""
    north, east, _ = ned_between(true[LAT], true[LON], true[H], x[LAT], x[LON], x[H])
    psi = rotation_vector(true[C].reshape(3, 3) @ x[C].reshape(3, 3).T)
    return np.concatenate(
        [psi, x[V] - true[V], [north, east, x[H] - true[H]], true[15:18] - x[15:18], true[18:] - x[18:]]
    )


def run(x: Array, imu: Array) -> ins_ekf.InsState:
    state, work = ins_ekf.InsState(x=x.copy()), ins_ekf.Workspace(ImuNoise(tau=1e9))
    t, f, w = imu[:, 0].copy(), imu[:, 1:4].copy(), imu[:, 4:7].copy()
    state.acc[ins_ekf.ACC_TIME] = t[0] - DT
    k = 0
    while k < len(t):
        k = ins_ekf.advance_state(state, t, f, w, k, len(t), math.inf, work)
    ins_ekf.close(state, work)
    return state


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
        numeric[:, j] = (error_of(plus, truth[900]) - error_of(minus, truth[900])) / (2.0 * STEPS[j])
    for (row, column), largest in LARGEST.items():
        difference = np.abs(Phi - numeric)[BLOCKS[row], BLOCKS[column]].max()
        assert difference < largest, (row, column, difference)
    assert np.abs(Phi - numeric).max() < 0.01


@pytest.mark.parametrize("lever", [np.array([0.8, -0.4, -1.1]), np.zeros(3)])
def test_measurement_matches_finite_differences(lever: Array) -> None:
    truth, imu = exact(9.0)
    x, w = truth[850], imu[850, 4:7] + np.array([0.1, -0.2, 0.3])
    fix = np.array([x[LAT], x[LON], x[H], *x[V]])
    y, H_rows = np.empty(6), np.empty((6, STATES))
    fix_residual(x, w, lever, fix, y, H_rows)
    unused = np.empty((6, STATES))
    numeric = np.empty((6, STATES))
    for j in range(STATES):
        e = np.zeros(STATES)
        e[j] = STEPS[j]
        plus, minus = np.empty(6), np.empty(6)
        fix_residual(disturbed(x, e), w, lever, fix, plus, unused)
        fix_residual(disturbed(x, -e), w, lever, fix, minus, unused)
        numeric[:, j] = (plus - minus) / (2.0 * STEPS[j])
    assert np.abs(H_rows - numeric).max() < 2e-4  # lever arm times Earth's rate is left out of H


def test_gain_joseph_and_nis_are_the_textbook_ones() -> None:
    draw = np.random.default_rng(4)
    A = draw.normal(size=(STATES, STATES))
    P = A @ A.T + np.eye(STATES)
    H_rows, y = draw.normal(size=(6, STATES)), draw.normal(size=6)
    B = draw.normal(size=(6, 6))
    R = B @ B.T + np.eye(6)
    K, S, nis = ins_ekf.gain(P, y, H_rows, R)
    assert np.allclose(S, H_rows @ P @ H_rows.T + R)
    assert np.allclose(K, P @ H_rows.T @ np.linalg.inv(S))
    assert nis == pytest.approx(y @ np.linalg.solve(S, y))
    U = np.eye(STATES) - K @ H_rows
    joseph = ins_ekf.joseph(P, K, H_rows, R)
    assert np.allclose(joseph, U @ P @ U.T + K @ R @ K.T)
    assert np.array_equal(joseph, joseph.T)
    inflated, factor = ins_ekf.consistent(P, 1e3 * y, H_rows, R, 6)
    assert factor > 1.0
    assert ins_ekf.gain(inflated, 1e3 * y, H_rows, R)[2] <= 6.0


def test_process_noise_of_standing_still_grows_as_it_should() -> None:
    truth, imu = exact(10.0, still=100.0)
    noise = ImuNoise()
    work = ins_ekf.Workspace(noise)
    state = ins_ekf.InsState(x=truth[0].copy(), P=np.zeros((STATES, STATES)))
    t, f, w = imu[:, 0].copy(), imu[:, 1:4].copy(), imu[:, 4:7].copy()
    k = 0
    while k < len(t):
        k = ins_ekf.advance_state(state, t, f, w, k, len(t), math.inf, work)
    P = ins_ekf.current_covariance(state, work)
    walk = 2.0 / noise.tau * noise.sigma_bias_gyro**2 * 10.0**3 / 3.0
    assert P[2, 2] == pytest.approx(noise.gyro**2 * 10.0 + walk, rel=0.02)
    tilt = (9.8 * noise.gyro) ** 2 * 10.0**3 / 3.0  # of velocity, by tilt that walks
    bias = 2.0 / noise.tau * noise.sigma_bias_accel**2 * 10.0**3 / 3.0
    assert P[3, 3] == pytest.approx(noise.accel**2 * 10.0 + tilt + bias, rel=0.03)
