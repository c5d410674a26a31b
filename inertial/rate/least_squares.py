"""The paper's way: angular acceleration by least squares, Runge-Kutta to rate and angle.

    [omega'; p] = S (a - q(omega))                                                           (E-3)

Biases come from the standstill at the start, after which nothing corrects the integral any more:
its error is what the other estimators are measured against. Works with every layout that sees
omega' and p (rank 6).
"""

from dataclasses import dataclass, field

import numpy as np
from numba import njit
from numpy.typing import NDArray

from inertial.attitude.rotation import to_dcm
from inertial.layouts.layout import Layout
from inertial.rate import still as stillness
from inertial.rate.direct import Direct
from inertial.rate.observed import Sensor, sensor
from inertial.rate.products_start import level
from inertial.rate.still import COUNT, DEPTH, LEARNING, Limits, Watch

Array = NDArray[np.float64]

GRAVITY = 9.80665  # m/s^2, standard
OMEGA, Q_NB, ANGLE, V_N, P_N = slice(0, 3), slice(3, 7), 7, slice(8, 11), slice(11, 14)
UNKNOWN_RATE = 10.0  # rad/s, sigma before any standstill
UNSEEN_RATE = 0.05  # rad/s, sigma at rest: a turn begins before the still detector sees it

SAMPLES, STILL, STEPS = range(3)  # of Memory.marks
LAST_S, DT, MOVING_S = range(3)  # of Memory.clock


@dataclass(frozen=True)
class Config:
    """Settings of the estimator."""

    still: stillness.Config = field(default_factory=stillness.Config)
    shortest_standstill: int = 100  # samples that biases need
    longest_step_s: float = 0.5  # s; a longer silence is a gap


@njit(cache=True, error_model="numpy")
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


@njit(cache=True, error_model="numpy")
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


# Everything that one step hands to the next, beside the detector's Watch.
MEMORY = np.dtype(
    (
        np.record,
        [
            ("y", "f8", (14,)),  # omega_b rad/s, q_nb, angle_z rad, v_n m/s, p_n m
            ("bias", "f8", (6,)),  # equivalent biases of omega' (rad/s^2) and p (m/s^2)
            ("u", "f8", (6,)),  # S a - bias of the last sample
            ("x", "f8", (6,)),  # the same without the rate's part
            ("P", "f8", (3, 3)),  # of omega
            ("marks", "i8", (3,)),  # samples of the standstill that gave the biases, still, steps
            ("clock", "f8", (3,)),  # s
        ],
    )
)
Memory = np.record


def memory() -> Memory:
    """Before any sample."""
    m = np.zeros(1, MEMORY)[0]
    m.clock[:] = (np.nan, 0.01, 0.0)
    restart(m, stillness.memory())
    return m


FASTEST = 300.0  # rad/s; no accelerometer of this kind measures a faster turn


@njit(cache=True, error_model="numpy")
def restart(m: Memory, w: Watch) -> None:
    """The rate is unknown: wait for a standstill."""
    stillness.forget(w)
    m.y[:] = 0.0
    m.y[3] = 1.0
    m.bias[:] = 0.0
    m.marks[SAMPLES], m.marks[STILL], m.clock[MOVING_S] = 0, 0, 0.0


@njit(cache=True, error_model="numpy")
def _align(m: Memory, w: Watch) -> None:
    """Biases and tilt from the mean of the standstill (E-7).

    All of omega' is bias; of p, what exceeds gravity along the measured vertical. A bias across the
    vertical reads like a tilt and stays in it.
    """
    f = w.reference[9:12]
    size = np.sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2])
    m.y[:] = 0.0
    m.y[3:7] = level(f / size)
    for i in range(3):
        m.bias[i], m.bias[3 + i] = w.reference[i], f[i] * (1.0 - GRAVITY / size)
        m.u[i], m.u[3 + i] = 0.0, f[i] - m.bias[3 + i]
    m.marks[SAMPLES] = w.n[LEARNING]


@njit(cache=True, error_model="numpy")
def _publish(m: Memory, w: Watch, s: Sensor) -> None:
    """omega', p of the newest sample, and the covariance of omega (E-8): white noise summed, bias
    error times time.
    """
    y, omega = w.y[(w.n[COUNT] - 1) % DEPTH], m.y
    for i in range(6):
        value = (y[i] if i < 3 else y[6 + i]) - m.bias[i]
        if s.feedback:
            for k in range(6):
                value -= s.SQ[i, k] * omega[(0, 0, 0, 1, 1, 2)[k]] * omega[(0, 1, 2, 1, 2, 2)[k]]
        m.x[i] = value
    n, t = m.marks[SAMPLES], m.clock[MOVING_S]
    for i in range(3):
        for j in range(3):
            m.P[i, j] = (
                s.R_alpha[i, j] * (m.clock[DT] * t + t * t / n) if n > 0 and t > 0.0 else 0.0
            )
        if n == 0:
            m.P[i, i] = UNKNOWN_RATE**2
        elif t == 0.0:
            m.P[i, i] = UNSEEN_RATE**2


@njit(cache=True, error_model="numpy")
def advance(
    m: Memory, w: Watch, s: Sensor, c: Limits, shortest: int, longest_s: float, t_s: float, a: Array
) -> None:
    """One sample of all axes a (N,), m/s^2, read at t_s (s, growing)."""
    dt = t_s - m.clock[LAST_S]
    m.clock[LAST_S] = t_s
    if dt > longest_s:
        restart(m, w)
    elif dt > 0.0:
        m.clock[DT] = dt
    m.marks[STEPS] += 1
    stillness.take(w, s, a, m.clock[DT])
    still, depth = stillness.detect(w, s, c, m.y[0:3], m.P, m.clock[DT])
    m.marks[STILL] = 1 if still else 0
    now = w.n[COUNT] - 1
    first = now
    if m.clock[MOVING_S] == 0.0:
        if still and w.n[LEARNING] >= shortest:
            _align(m, w)
        if still or m.marks[SAMPLES] == 0:
            first = now + 1
        else:
            first = (
                now - depth
            )  # the turn began before the detector saw it: integrate what was held back
    u = np.empty(6)
    for sample in range(first, now + 1):
        y = w.y[sample % DEPTH]
        for i in range(3):
            u[i], u[3 + i] = y[i] - m.bias[i], y[9 + i] - m.bias[3 + i]
        m.y[:] = runge_kutta(m.y, m.u, u, s.SQ, w.dt[sample % DEPTH])
        m.u[:] = u
        m.clock[MOVING_S] += w.dt[sample % DEPTH]
    if (
        not m.y[0] ** 2 + m.y[1] ** 2 + m.y[2] ** 2 < FASTEST**2
    ):  # feedback of a drifting rate diverges
        restart(m, w)
    _publish(m, w, s)


# columns of a row, in the order of the memory
ROW_P, ROW_X, ROW_BIAS, ROW_SAMPLES, ROW_STILL, ROW_MOVING_S, WIDTH = 14, 23, 29, 35, 36, 37, 38


@njit(cache=True, error_model="numpy")
def run(
    m: Memory,
    w: Watch,
    s: Sensor,
    c: Limits,
    shortest: int,
    longest_s: float,
    times: Array,
    samples: Array,
    rows: Array,
) -> None:
    """advance() over samples (n, N) at times (n,), s; rows (n, WIDTH) become the state after
    each.
    """
    for k in range(len(times)):
        advance(m, w, s, c, shortest, longest_s, times[k], samples[k])
        row = rows[k]
        row[:ROW_P], row[ROW_X:ROW_BIAS], row[ROW_BIAS:ROW_SAMPLES] = m.y, m.x, m.bias
        for i in range(3):
            for j in range(3):
                row[ROW_P + 3 * i + j] = m.P[i, j]
        row[ROW_SAMPLES], row[ROW_STILL], row[ROW_MOVING_S] = (
            m.marks[SAMPLES],
            m.marks[STILL],
            m.clock[MOVING_S],
        )


_run = Direct(run)


class LeastSquares:
    """Memory and constants of the estimator for one layout."""

    def __init__(self, layout: Layout, config: Config = Config()) -> None:
        """Raises GeometryError when the layout cannot see omega' and p."""
        self.layout, self.config = layout, config
        self.sensor = sensor(layout, config.still.sigma_axis)
        self.limits = stillness.limits(config.still)
        self.memory, self.watch = memory(), stillness.memory()
        self.excluded = 0

    def rows(self, t_s: Array, f_axis: Array) -> Array:
        """Samples (n, N), m/s^2, at t_s (n,), s, both checked: a row after each. A long silence
        starts anew.
        """
        c, out = self.config, np.empty((len(t_s), WIDTH))
        least, longest = c.shortest_standstill, c.longest_step_s
        _run(self.memory, self.watch, self.sensor, self.limits, least, longest, t_s, f_axis, out)
        return out

    def gap(self) -> None:
        """Samples are missing: the next step integrates across, with omega' linear in between."""
        stillness.forget(self.watch)

    def exclude(self, mask: int) -> None:
        """Go on without some axes: what their biases were in the sum is not known, so the bias of
        the rest stays.

        Raises GeometryError when the rest does not see omega' and p.
        """
        if mask != self.excluded:
            self.sensor, self.excluded = (
                sensor(self.layout, self.config.still.sigma_axis, mask),
                mask,
            )
            self.gap()
