"""The paper's way: angular acceleration by least squares, Runge-Kutta to rate and angle.

    [omega'; p] = S (a - q(omega))                                                           (E-3)

Biases come from the standstill at the start, after which nothing corrects the integral any more: its error is what
the other estimators are measured against. Works with every layout that sees omega' and p (rank 6).
"""

from dataclasses import dataclass, field

import numpy as np
from numba import njit
from numpy.typing import NDArray

from estimator.attitude.rotation import level, to_dcm
from estimator.layouts.layout import Layout, products
from estimator.rate import still as stillness
from estimator.rate.field import checked

Array = NDArray[np.float64]

GRAVITY = 9.80665  # m/s^2, standard
OMEGA, Q_NB, ANGLE, V_N, P_N = slice(0, 3), slice(3, 7), 7, slice(8, 11), slice(11, 14)
UNKNOWN_RATE = 10.0  # rad/s, sigma before any standstill
UNSEEN_RATE = 0.05  # rad/s, sigma at rest: a turn begins before the still detector sees it


@dataclass(frozen=True)
class Config:
    """Settings of the estimator."""

    still: stillness.Config = field(default_factory=stillness.Config)
    shortest_standstill: int = 100  # samples that biases need
    longest_step_s: float = 0.5  # s; a longer silence is a gap


@dataclass(frozen=True)
class State:
    """Everything that one step hands to the next."""

    y: Array  # (14,): omega_b rad/s, q_nb, angle_z rad, v_n m/s, p_n m
    bias: Array  # (6,): equivalent biases of omega' (rad/s^2) and p (m/s^2)
    u: Array  # (6,): S a - bias of the last sample
    samples: int  # of the standstill that gave the biases; 0: none yet
    moving_s: float  # s of integration since
    steps: int


def start() -> State:
    """Before any sample."""
    y = np.zeros(14)
    y[3] = 1.0
    return State(y, np.zeros(6), np.zeros(6), 0, 0.0, 0)


@njit(cache=True)
def derivative(y: Array, u: Array, SQ: Array) -> Array:
    """dy/dt of (omega, q_nb, angle, v_n, p_n) for u = S a - bias (6,) and SQ = S Q (6, 6) (E-6)."""
    x, z = u.copy(), np.empty(6)
    w0, w1, w2 = y[0], y[1], y[2]
    z[0], z[1], z[2], z[3], z[4], z[5] = w0 * w0, w0 * w1, w0 * w2, w1 * w1, w1 * w2, w2 * w2
    x -= SQ @ z
    d = np.empty(14)
    d[0:3] = x[0:3]
    d[3] = 0.5 * (-y[4] * w0 - y[5] * w1 - y[6] * w2)
    d[4] = 0.5 * (y[3] * w0 + y[5] * w2 - y[6] * w1)
    d[5] = 0.5 * (y[3] * w1 - y[4] * w2 + y[6] * w0)
    d[6] = 0.5 * (y[3] * w2 + y[4] * w1 - y[5] * w0)
    d[7] = w2
    q = y[3:7] / np.sqrt(np.sum(y[3:7] ** 2))
    d[8:11] = to_dcm(q) @ x[3:6]
    d[10] += GRAVITY
    d[11:14] = y[8:11]
    return d


@njit(cache=True)
def runge_kutta(y: Array, before: Array, after: Array, SQ: Array, dt: float) -> Array:
    """One RK4 step over dt (s) with u linear between two samples (E-6)."""
    middle = 0.5 * (before + after)
    k1 = derivative(y, before, SQ)
    k2 = derivative(y + 0.5 * dt * k1, middle, SQ)
    k3 = derivative(y + 0.5 * dt * k2, middle, SQ)
    k4 = derivative(y + dt * k3, after, SQ)
    y = y + dt / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    y[3:7] /= np.sqrt(np.sum(y[3:7] ** 2))
    return y


def align(state: State, S: Array, mean_axis: Array, samples: int) -> State:
    """Biases and tilt from the mean axis readings (N,) of a standstill (E-7).

    All of omega' is bias; of p, what exceeds gravity along the measured vertical. A bias across the vertical
    reads like a tilt and stays in it.
    """
    x = S @ mean_axis
    f_b = x[3:]
    q_nb = level(f_b)
    bias = np.concatenate([x[:3], f_b * (1.0 - GRAVITY / np.linalg.norm(f_b))])
    y = np.zeros(14)
    y[Q_NB] = q_nb
    return State(y, bias, x - bias, samples, 0.0, state.steps)


def step(state: State, u: Array, SQ: Array, dt: float) -> State:
    """Integrate over dt to the sample whose S a - bias is u (6,)."""
    y = runge_kutta(state.y, state.u, u, SQ, dt)
    return State(y, state.bias, u, state.samples, state.moving_s + dt, state.steps + 1)


def covariance(state: State, R_alpha: Array, dt: float) -> Array:
    """Covariance of omega (3, 3), (rad/s)^2: white noise of omega' summed, its bias error times time (E-8)."""
    if state.samples == 0:
        return UNKNOWN_RATE**2 * np.eye(3)
    if state.moving_s == 0.0:
        return UNSEEN_RATE**2 * np.eye(3)
    return R_alpha * (dt * state.moving_s + state.moving_s**2 / state.samples)


class LeastSquares:
    """Runs the functions above over samples; holds the standstill at the start and nothing else."""

    def __init__(self, layout: Layout, config: Config = Config()) -> None:
        """Raises GeometryError when the layout cannot see omega' and p."""
        self.layout = layout
        self.config = config
        self.state = start()
        self.still = False
        self.f_b = np.zeros(3)
        self.alpha_b = np.zeros(3)
        self.S = np.ascontiguousarray(layout.S)
        self.SQ = np.ascontiguousarray(layout.S @ layout.Q)
        self._R_alpha = config.still.sigma_axis**2 * self.S[:3] @ self.S[:3].T
        self._detector = stillness.StillDetector(layout.axes, stillness.quiet_map(layout), config.still)
        self._standstill = stillness.Standstill(layout.axes, config.still.window)
        self._dt = 0.01
        self.P = covariance(self.state, self._R_alpha, self._dt)

    @property
    def phase(self) -> str:
        """For people: what it is doing."""
        if self.state.samples == 0:
            return "finding biases: keep still"
        return "still at the start" if self.state.moving_s == 0.0 else "integrating"

    def step(self, f_axis: Array, dt: float | None) -> None:
        """One sample (N,), m/s^2, dt after the last; None at the first. A long silence starts anew."""
        f_axis = checked(self.layout, f_axis)
        if dt is not None and dt > self.config.longest_step_s:
            self._restart()
        elif dt is not None:
            self._dt = dt
        waiting = self.state.moving_s == 0.0
        self.still = self._detector.update(f_axis, self.state.y[OMEGA], self.P, self._dt)
        if not (waiting and self._at_start(f_axis)):
            self.state = step(self.state, self.S @ f_axis - self.state.bias, self.SQ, self._dt)
        self._publish(f_axis)

    def gap(self) -> None:
        """Samples are missing: the next step integrates across, with omega' linear in between."""
        self._detector.forget()

    def _restart(self) -> None:
        self._detector.forget()
        self._standstill.clear()
        self.state = start()

    def _at_start(self, f_axis: Array) -> bool:
        """Collect the first standstill; True while it lasts or has not come."""
        enough = self._standstill.samples >= self.config.shortest_standstill
        if self.still:
            self._standstill.add(f_axis)
            if enough:
                self._align(self._standstill.samples % self.config.still.window == 0)
        elif enough:
            # the turn began before the detector saw it: integrate what was held back
            for held in self._standstill.held:
                self.state = step(self.state, self.S @ held - self.state.bias, self.SQ, self._dt)
            return False
        else:
            self._standstill.clear()
        return True

    def _align(self, learn: bool) -> None:
        mean, samples = self._standstill.mean(), self._standstill.samples
        self.state = align(self.state, self.S, mean, samples)
        if learn:  # now and then: costly
            self._detector.learn(mean, samples)

    def _publish(self, f_axis: Array) -> None:
        z = products(self.state.y[OMEGA])
        x = self.S @ f_axis - self.state.bias - self.SQ @ z
        self.alpha_b, self.f_b = x[:3], x[3:]
        self.P = covariance(self.state, self._R_alpha, self._dt)
