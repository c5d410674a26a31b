"""Error-state Kalman filter of the INS: closed loop, Joseph form, NIS gate. Equations E-28 to E-34.

The filter's memory is one flat InsState; `advance` is the compiled loop over IMU samples, `correct` one fix. Between
fixes Phi and Q are gathered at 10 Hz and applied to P when the fix comes, so that every estimator that works on the
list of (Phi, Q, y, H, R, c) can share this file.
"""

import math
from dataclasses import dataclass, field

import numpy as np
from numba import njit
from numpy.typing import NDArray

from estimator.ins.earth import radii
from estimator.ins.error_model import STATES, ImuNoise, accumulate, fill_error_matrix
from estimator.ins.strapdown import SIZE, orthonormalise, rotation, step, turn

Array = NDArray[np.float64]

INTERVAL = 0.1  # s, over which F is taken as constant
# acc: integral of f_n over the open interval (3), its length (s), time of the state (s), integral of C_nb (9)
ACC_LENGTH, ACC_TIME = 3, 4


@dataclass
class InsState:
    """Everything the filter knows at time t."""

    x: Array = field(default_factory=lambda: np.zeros(SIZE))  # nominal, see strapdown
    P: Array = field(default_factory=lambda: np.eye(STATES))  # covariance just after the last fix
    Phi: Array = field(default_factory=lambda: np.eye(STATES))  # since the last fix, closed intervals
    Q: Array = field(default_factory=lambda: np.zeros((STATES, STATES)))
    acc: Array = field(default_factory=lambda: np.zeros(14))

    @property
    def t(self) -> float:
        """Time of x, s."""
        return float(self.acc[ACC_TIME])

    def copy(self) -> "InsState":
        """An independent state; P is shared, because it is replaced and never written to."""
        return InsState(self.x.copy(), self.P, self.Phi.copy(), self.Q.copy(), self.acc.copy())


class Workspace:
    """Scratch memory of the compiled functions: one per filter, never part of its state."""

    def __init__(self, noise: ImuNoise) -> None:
        self.noise = noise.vector()
        self.step = np.zeros((13, 3))
        self.F = np.zeros((STATES, STATES))
        self.matrices = np.zeros((4, STATES, STATES))


@njit(cache=True)
def _close(x: Array, Phi: Array, Q: Array, acc: Array, noise: Array, F: Array, matrices: Array) -> None:
    """Close the open interval: Phi and Q reach the time of x."""
    T = acc[3]
    if T <= 0.0:
        return
    f_n = np.empty(3)
    for i in range(3):
        f_n[i] = acc[i] / T
        acc[i] = 0.0
    middle = x.copy()  # C_nb averaged: at its end a turning body would be half an interval ahead
    for i in range(9):
        middle[6 + i] = acc[5 + i] / T
        acc[5 + i] = 0.0
    fill_error_matrix(middle, f_n, noise[15], noise[16], F)
    accumulate(F, T, noise, Phi, Q, matrices)
    orthonormalise(x)
    acc[3] = 0.0


@njit(cache=True)
def advance(
    x: Array, Phi: Array, Q: Array, acc: Array, t: Array, f: Array, w: Array, start: int, stop: int, until: float,
    noise: Array, work: Array, F: Array, matrices: Array,
) -> int:  # fmt: skip
    """Mechanise samples start..stop-1 of t (n,), f and w (n, 3), as far as time `until`, in place (E-25, E-28).

    Sample k acts from the time of the state to t[k]; the one that reaches over `until` acts in part. Returns the
    first sample not used up: after the end of a 0.1 s interval (the caller may keep a snapshot there), at `until`,
    or `stop`.
    """
    k = start
    while k < stop:
        end = t[k] if t[k] < until else until
        dt = end - acc[4]
        if dt > 0.0:
            step(x, f[k], w[k], dt, work)
            for i in range(3):
                acc[i] += work[12, i] * dt
                for j in range(3):
                    acc[5 + 3 * i + j] += 0.5 * (work[9 + i, j] + x[6 + 3 * i + j]) * dt
            acc[3] += dt
            acc[4] = end
        if t[k] > until:
            return k
        k += 1
        if acc[3] >= 0.1 - 1e-6:
            _close(x, Phi, Q, acc, noise, F, matrices)
            return k
    return k


@njit(cache=True)
def covariance(P: Array, Phi: Array, Q: Array) -> Array:
    """Phi P Phi^T + Q, symmetric (E-31)."""
    n = P.shape[0]
    scratch = np.zeros((n, n))
    out = np.empty((n, n))
    for i in range(n):
        for k in range(n):
            a = Phi[i, k]
            if a != 0.0:
                for j in range(n):
                    scratch[i, j] += a * P[k, j]
    for i in range(n):
        for j in range(i + 1):
            s = Q[i, j]
            for k in range(n):
                s += scratch[i, k] * Phi[j, k]
            out[i, j] = s
            out[j, i] = s
    return out


@njit(cache=True)
def gain(P: Array, y: Array, H: Array, R: Array) -> tuple[Array, Array, float]:
    """K (15, m), S (m, m) and NIS = y^T S^-1 y of a measurement (E-32). S is solved by its Cholesky factor."""
    m, n = H.shape
    PHt = np.zeros((n, m))
    for i in range(n):
        for j in range(m):
            for k in range(n):
                PHt[i, j] += P[i, k] * H[j, k]
    S = R.copy()
    for i in range(m):
        for j in range(m):
            for k in range(n):
                S[i, j] += H[i, k] * PHt[k, j]
    G = np.zeros((m, m))
    for j in range(m):
        for i in range(j, m):
            s = S[i, j]
            for k in range(j):
                s -= G[i, k] * G[j, k]
            if i == j:
                G[j, j] = math.sqrt(s)
            else:
                G[i, j] = s / G[j, j]
    nis = 0.0
    u = np.empty(m)
    for i in range(m):
        s = y[i]
        for k in range(i):
            s -= G[i, k] * u[k]
        u[i] = s / G[i, i]
        nis += u[i] * u[i]
    K = np.empty((n, m))
    for r in range(n):  # rows of K: K S = P H^T, forward and back substitution
        for i in range(m):
            s = PHt[r, i]
            for k in range(i):
                s -= G[i, k] * u[k]
            u[i] = s / G[i, i]
        for i in range(m - 1, -1, -1):
            s = u[i]
            for k in range(i + 1, m):
                s -= G[k, i] * K[r, k]
            K[r, i] = s / G[i, i]
    return K, S, nis


@njit(cache=True)
def joseph(P: Array, K: Array, H: Array, R: Array) -> Array:
    """(I - KH) P (I - KH)^T + K R K^T, symmetric and positive whatever K is (E-33)."""
    n, m = K.shape
    U = np.eye(n)
    KR = np.zeros((n, m))
    for i in range(n):
        for k in range(m):
            for j in range(n):
                U[i, j] -= K[i, k] * H[k, j]
            for j in range(m):
                KR[i, j] += K[i, k] * R[k, j]
    noise = np.zeros((n, n))
    for i in range(n):
        for j in range(n):
            for k in range(m):
                noise[i, j] += KR[i, k] * K[j, k]
    return covariance(P, U, noise)


@njit(cache=True)
def reset(x: Array, c: Array) -> None:
    """Take the estimated error c (15,) out of the nominal x (21,): closed loop (E-34)."""
    L, h = x[0], x[2]
    R_N, R_E = radii(L)
    x[0] = L - c[6] / (R_N + h)
    x[1] -= c[7] / ((R_E + h) * math.cos(L))
    x[2] = h - c[8]
    for i in range(3):
        x[3 + i] -= c[3 + i]
        x[15 + i] += c[9 + i]
        x[18 + i] += c[12 + i]
    left = np.empty((3, 3))
    right = np.zeros((6, 3))
    rotation(c[0], c[1], c[2], left)
    right[0, 0] = right[1, 1] = right[2, 2] = 1.0
    turn(x, left, right)


def advance_state(s: InsState, t: Array, f: Array, w: Array, start: int, stop: int, until: float, ws: Workspace) -> int:
    """`advance` on an InsState."""
    return advance(
        s.x, s.Phi, s.Q, s.acc, t, f, w, start, stop, until, ws.noise, ws.step, ws.F, ws.matrices
    )  # fmt: skip


def close(s: InsState, ws: Workspace) -> None:
    """Bring Phi and Q of s to the time of its x, in place."""
    _close(s.x, s.Phi, s.Q, s.acc, ws.noise, ws.F, ws.matrices)


def current_covariance(s: InsState, ws: Workspace) -> Array:
    """P (15, 15) at the time of s, which stays as it is."""
    if s.acc[ACC_LENGTH] > 0.0:
        s = s.copy()
        close(s, ws)
    return covariance(s.P, s.Phi, s.Q)


def consistent(P: Array, y: Array, H: Array, R: Array, dof: int) -> tuple[Array, float]:
    """P times the smallest power of 2 that brings NIS down to dof, and that factor.

    For a filter that many fixes in a row contradict: its covariance is wrong, and by how much the fixes say. The
    correlations stay, so tilt and biases are found again too. Ends at 2^60, where the fix itself must be wrong.
    """
    factor = 1.0
    while factor < 2.0**60 and gain(P * factor, y, H, R)[2] > dof:
        factor *= 2.0
    return P * factor, factor


def correct(s: InsState, P: Array, y: Array, H: Array, R: Array, K: Array) -> Array:
    """Apply gain K to s in place, with P its covariance before; returns the correction c (15,).

    Afterwards s starts a new leg: Phi = I, Q = 0.
    """
    c = K @ y
    reset(s.x, c)
    s.P = joseph(P, K, H, R)
    s.Phi = np.eye(STATES)
    s.Q = np.zeros((STATES, STATES))
    return c
