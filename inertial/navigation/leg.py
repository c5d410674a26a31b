"""From fix to fix: the nominal state, and Phi and Q of the error since the last measurement. E-27
to E-29, E-31, E-34.

The error state has n = 15 numbers and, where a filter asks for them, further ones at its end (see
Model). All but the first nine (attitude, velocity, position) only decay.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from inertial.navigation.arrays import add, copy1, copy2, fill2, identity
from inertial.navigation.earth import radii
from inertial.navigation.error_model import ImuNoise
from inertial.navigation.mechanise import (
    ACC,
    F1,
    INTERVAL,
    LAST,
    LENGTH,
    M1,
    M2,
    NOMINAL,
    S1,
    S2,
    SINCE,
    TICK,
    TICK_LENGTH,
    TIME,
    U1,
    U2,
    W1,
    mechanise,
)
from inertial.navigation.strapdown import orthonormalise, rotation
from inertial.navigation.transition import CORE, MOVING, Leg, Model, shaken, transition

Array = NDArray[np.float64]

RING = 16  # ticks remembered: 1.6 s
R_TIME, R_LENGTH, R_V, R_F, R_W = (
    0,
    1,
    2,
    5,
    8,
)  # ring columns: t, T, v_n at its end, integrals of f and w
RING_COLUMNS = 11


def make_model(noise: ImuNoise, scale: bool = False, lag: bool = False, car: bool = False) -> Model:
    """The states of a filter; options as in FilterConfig."""
    base = noise.vector()
    density, decay = [*base[:CORE]], [base[15]] * 3 + [base[16]] * 3
    place, sign = list(range(15, 21)), [1.0] * 6
    first = [-1, -1, -1]
    for k, (wanted, more) in enumerate(
        ((scale, range(21, 27)), (lag, (27, 28)), (car, (29, 30, 31)))
    ):
        if wanted:
            first[k] = len(density)
            place += more
            sign += [1.0 if k == 0 else -1.0] * len(more)
            density += [0.0] * len(more)
            decay += [0.0] * len(more)
    return Model(
        len(density),
        np.array(density),
        np.array(decay),
        np.array(place),
        np.array(sign),
        first[0],
        first[1],
        first[2],
        noise.shake,
    )


def new_leg(n: int) -> Leg:
    """A leg with everything zero and unit covariance."""
    return Leg(
        np.zeros(NOMINAL),
        np.eye(n),
        np.eye(n),
        np.zeros((n, n)),
        np.zeros(ACC),
        np.zeros((RING, RING_COLUMNS)),
        np.zeros((5, n, n)),
    )


@njit(cache=True)
def copy_leg(source: Leg, target: Leg) -> None:
    """target := source, without taking memory."""
    copy1(source.x, target.x)
    copy2(source.P, target.P)
    copy2(source.Phi, target.Phi)
    copy2(source.Q, target.Q)
    copy1(source.acc, target.acc)
    copy2(source.ring, target.ring)


@njit(cache=True)
def _fold(leg: Leg) -> None:
    """Take the open tick into the integrals of the interval and into the ring."""
    acc, x, ring = leg.acc, leg.x, leg.ring
    T = acc[TICK_LENGTH]
    if T <= 0.0:
        return
    half = np.empty(9)
    for k in range(9):
        half[k] = acc[U1 + k] + 0.5 * acc[3 + k]
    f0, f1, f2 = acc[0], acc[1], acc[2]
    for j in range(3):
        a, b, c = half[j], half[3 + j], half[6 + j]
        for i, step in ((0, f1 * c - f2 * b), (1, f2 * a - f0 * c), (2, f0 * b - f1 * a)):
            k = 3 * i + j
            acc[M2 + k] += T * (acc[M1 + k] + 0.5 * step)
            acc[M1 + k] += step
    for k in range(9):
        acc[U2 + k] += T * half[k]
        acc[U1 + k] += acc[3 + k]
    for i in range(3):
        acc[S2 + i] += T * (acc[S1 + i] + 0.5 * acc[i])
        acc[S1 + i] += acc[i]
        acc[F1 + i] += acc[12 + i]
        acc[W1 + i] += acc[15 + i]
    for k in range(RING - 1):
        for j in range(RING_COLUMNS):
            ring[k, j] = ring[k + 1, j]
    k = RING - 1
    ring[k, R_TIME], ring[k, R_LENGTH] = acc[TIME], T
    for i in range(3):
        ring[k, R_V + i] = x[3 + i]
        ring[k, R_F + i], ring[k, R_W + i] = acc[12 + i], acc[15 + i]
    acc[SINCE] += T
    acc[LENGTH] += T
    for k in range(19):
        acc[k] = 0.0


@njit(cache=True)
def close(leg: Leg, m: Model) -> None:
    """Close the open interval: Phi and Q reach the time of x (E-28)."""
    _fold(leg)
    acc, n = leg.acc, m.n
    T = acc[LENGTH]
    if T <= 0.0:
        return
    Top, scratch = leg.work[2], leg.work[3]
    d = np.empty(n)  # decay over T
    for j in range(MOVING, n):
        z = -m.decay[j - MOVING] * T
        d[j] = 1.0 + z * (1.0 + z * (0.5 + z / 6.0))
    transition(leg, m, T, d, Top)
    for j in range(MOVING, n):
        Top[j, j] = d[j]
    # Phi_i (Q + T/2 G) Phi_i^T + T/2 G is the trapezoid with one product less
    Q = leg.Q
    shaken(acc, m, T, leg.work[4])
    for i in range(n):
        Q[i, i] += 0.5 * T * m.noise[i]
    add(Q, leg.work[4], 6)
    np.dot(Top, Q, scratch)
    np.dot(scratch, Top.T, Q)
    for i in range(n):
        for j in range(i):
            Q[j, i] = Q[i, j]
        Q[i, i] += 0.5 * T * m.noise[i]
    add(Q, leg.work[4], 6)
    np.dot(Top, leg.Phi, scratch)
    copy2(scratch, leg.Phi)
    orthonormalise(leg.x)
    for k in range(S1, LAST):
        acc[k] = 0.0


@njit(cache=True)
def run_leg(
    leg: Leg,
    m: Model,
    t: Array,
    f: Array,
    w: Array,
    start: int,
    stop: int,
    until: float,
    every: float,
) -> int:
    """Mechanise and close intervals as far as `until`, sample `stop`, or until `every` s passed
    since a constraint.

    Returns the first sample not used up. The caller looks at acc[SINCE] to see whether a constraint
    is due.
    """
    k = start
    while k < stop:
        k = mechanise(leg.x, leg.acc, t, f, w, k, stop, until)
        if leg.acc[TICK_LENGTH] >= TICK - 1e-6:
            _fold(leg)
            if leg.acc[LENGTH] >= INTERVAL - 1e-6:
                close(leg, m)
            if leg.acc[SINCE] >= every - 1e-6:
                return k
        if k < stop and t[k] > until and leg.acc[TIME] >= until:
            return k
    return k


@njit(cache=True)
def carry(P: Array, Phi: Array, Q: Array, factor: float, scratch: Array, out: Array) -> None:
    """out := factor Phi P Phi^T + Q (E-31), symmetric; out and scratch (n, n) are neither P nor
    Q.
    """
    np.dot(Phi, P, scratch)
    np.dot(scratch, Phi.T, out)
    for i in range(P.shape[0]):
        for j in range(i + 1):
            out[i, j] = factor * out[i, j] + Q[i, j]
            out[j, i] = out[i, j]


@njit(cache=True)
def reset(x: Array, c: Array, m: Model) -> None:
    """Take the estimated error c (n,) out of the nominal x: closed loop (E-34)."""
    L, h = x[0], x[2]
    R_N, R_E = radii(L)
    x[0] = L - c[6] / (R_N + h)
    x[1] -= c[7] / ((R_E + h) * np.cos(L))
    x[2] = h - c[8]
    for i in range(3):
        x[3 + i] -= c[3 + i]
    for j in range(m.n - MOVING):
        x[m.place[j]] += m.sign[j] * c[MOVING + j]
    R = np.empty((3, 3))
    rotation(c[0], c[1], c[2], R)
    for j in range(6, 9):
        a, b, d = x[j], x[j + 3], x[j + 6]
        for i in range(3):
            x[3 * i + j] = R[i, 0] * a + R[i, 1] * b + R[i, 2] * d


@njit(cache=True)
def correct(leg: Leg, m: Model, c: Array) -> None:
    """Apply the estimate c (n,) and start a new leg; the ring's velocities are corrected with
    it.
    """
    reset(leg.x, c, m)
    identity(leg.Phi)
    fill2(leg.Q, 0.0)
    for k in range(RING):
        for i in range(3):
            leg.ring[k, R_V + i] -= c[3 + i]


def current_covariance(leg: Leg, m: Model) -> Array:
    """P (n, n) at the time of the leg's state, which stays as it is."""
    trial = new_leg(m.n)
    copy_leg(leg, trial)
    close(trial, m)
    out = np.empty((m.n, m.n))
    carry(trial.P, trial.Phi, trial.Q, 1.0, trial.work[3], out)
    return out
