"""Phi and H against finite differences of the mechanisation; the filter's algebra against numpy."""

import pickle

import numpy as np
import pytest
from numpy.typing import NDArray
from support.estimator_drive import DT, exact

from inertial.core import navigation as core
from inertial.earth import ned_between
from inertial.navigation.error_model import STATES, ImuNoise, make_model
from inertial.rotation import rotation_vector
from tests.inertial.twins.strapdown import State, step

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


def leg_at(x: State, model=None):
    """A leg whose nominal state is x."""
    leg = core.new_leg((model or MODEL).states)
    for name in ("latitude", "longitude", "height", "v_n", "C_nb", "bias_accel", "bias_gyro"):
        setattr(leg.x, name, getattr(x, name))
    return leg


def state_of(x) -> State:
    """The core's nominal state as the twin's."""
    place = x.latitude, x.longitude, x.height
    return State(*place, x.v_n, x.C_nb, x.bias_accel, x.bias_gyro)


def disturbed(x: State, error: Array) -> State:
    """Nominal state whose error (computed - true) against true x is `error`."""
    leg = leg_at(x)
    leg.reset(-error, MODEL)
    return state_of(leg.x)


def error_of(x: State, true: State) -> Array:
    """Error state of x against the truth."""
    north, east, _ = ned_between(true.place, x.place)
    return np.concatenate(
        [
            rotation_vector(true.C_nb @ x.C_nb.T),
            x.v_n - true.v_n,
            [north, east, x.height - true.height],
            true.bias_accel - x.bias_accel,
            true.bias_gyro - x.bias_gyro,
        ]
    )


def run(x: State, imu: Array, model=None, cuts: tuple[int, ...] = ()):
    """The closed leg after samples imu from x."""
    model = model or MODEL
    leg = leg_at(x, model)
    leg.time = imu[0, 0] - DT
    k = 0
    for stop in (*cuts, len(imu)):
        k = leg.run(model, imu, k, stop)
    leg.close(model)
    return leg


def test_error_and_disturbance_agree() -> None:
    truth, _ = exact(8.0)
    error = 1e-4 * np.arange(1.0, 16.0)
    assert np.allclose(error_of(disturbed(truth[-1], error), truth[-1]), error, atol=1e-9)


def test_transition_matches_finite_differences() -> None:
    truth, imu = exact(9.0)
    start, second = truth[800], imu[800:900]
    Phi = run(start, second).transition()
    numeric = np.empty((STATES, STATES))
    for j in range(STATES):
        e = np.zeros(STATES)
        e[j] = STEPS[j]
        plus = state_of(run(disturbed(start, e), second).x)
        minus = state_of(run(disturbed(start, -e), second).x)
        numeric[:, j] = (error_of(plus, truth[900]) - error_of(minus, truth[900])) / (
            2.0 * STEPS[j]
        )
    for (row, column), largest in LARGEST.items():
        difference = np.abs(Phi - numeric)[BLOCKS[row], BLOCKS[column]].max()
        assert difference < largest, (row, column, difference)
    assert np.abs(Phi - numeric).max() < 0.01


def test_the_core_computes_what_the_twin_does() -> None:
    truth, imu = exact(20.0, ba=np.array([0.1, -0.2, 0.05]), bg=np.array([0.01, 0.002, -0.004]))
    x = truth[0]
    for row in imu:
        x = step(x, row[1:4], row[4:7], DT)
    end = state_of(run(truth[0], imu).x)
    assert np.abs(ned_between(x.place, end.place)).max() < 1e-8
    assert np.abs(end.v_n - x.v_n).max() < 1e-10
    assert np.abs(end.C_nb - x.C_nb).max() < 1e-10


def test_cutting_the_samples_changes_no_bit() -> None:
    truth, imu = exact(7.3)
    assert run(truth[0], imu) == run(truth[0], imu, cuts=(1, 2, 57, 100, 333, 334, 729))


@pytest.mark.parametrize("lever", [np.array([0.8, -0.4, -1.1]), np.zeros(3)])
@pytest.mark.parametrize("lags", [(0.0, 0.0), (0.03, 0.12)])
def test_measurement_matches_finite_differences(lever: Array, lags: tuple[float, float]) -> None:
    truth, imu = exact(9.0)
    model = make_model(ImuNoise(tau=1e9), lag=True)
    leg = run(truth[800], imu[800:850], model)
    w = imu[850, 4:7] + np.array([0.1, -0.2, 0.3])
    x = leg.x
    fix = core.Fix(latitude=x.latitude, longitude=x.longitude, height=x.height, v_n=x.v_n, yaw=0.3)
    x.lag_position, x.lag_velocity = lags
    kept = pickle.dumps(leg)
    H_rows = leg.compared(model, w, lever, fix).H
    numeric = np.empty((7, model.states))
    steps = np.concatenate([STEPS, [1e-3, 1e-3]])
    for j in range(model.states):
        ends = []
        for side in (1.0, -1.0):
            e = np.zeros(model.states)
            e[j] = side * steps[j]
            moved = pickle.loads(kept)
            moved.reset(-e, model)
            ends.append(moved.compared(model, w, lever, fix).y)
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
    H, y, B = draw.normal(size=(6, STATES)), draw.normal(size=6), draw.normal(size=(6, 6))
    R = B @ B.T + np.eye(6)
    z = core.Measurement(y=y, H=H, R=R)
    _, S = core.innovate(P, z)
    error, after, nis = core.absorb(P, z)
    K = P @ H.T @ np.linalg.inv(S)
    U = np.eye(STATES) - K @ H
    joseph = U @ P @ U.T + K @ R @ K.T
    assert np.allclose(S, H @ P @ H.T + R)
    assert nis == pytest.approx(y @ np.linalg.solve(S, y))
    assert np.allclose(error, K @ y)
    assert np.allclose(after, joseph, atol=1e-9) and np.array_equal(after, after.T)
    z.y = 1e3 * y
    factor, inflated = core.make_consistent(P, z)
    assert factor > 1.0 and np.allclose(inflated, factor * P)
    assert core.absorb(inflated, z)[2] <= 6.0


def test_process_noise_of_standing_still_grows_as_it_should() -> None:
    truth, imu = exact(10.0, still=100.0)
    noise = ImuNoise()
    model = make_model(noise)
    leg = leg_at(truth[0], model)
    leg.P = np.zeros((STATES, STATES))
    leg.run(model, imu)
    P = leg.covariance(model)
    walk = 2.0 / noise.tau * noise.sigma_bias_gyro**2 * 10.0**3 / 3.0
    assert P[2, 2] == pytest.approx(noise.gyro**2 * 10.0 + walk, rel=0.02)
    tilt = (9.8 * noise.gyro) ** 2 * 10.0**3 / 3.0  # of velocity, by tilt that walks
    bias = 2.0 / noise.tau * noise.sigma_bias_accel**2 * 10.0**3 / 3.0
    assert P[3, 3] == pytest.approx(noise.accel**2 * 10.0 + tilt + bias, rel=0.03)
