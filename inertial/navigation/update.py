"""One measurement: residual of a fix, NIS, gain, robust weights. Compiled; matrices up to (n, 7).
E-30 to E-33, E-38.

Rows of a fix: position north, east, height (m), v_n (m/s), heading (rad); absent ones are left out
from the end of each group. Row k of H belongs to y[k] = computed - measured.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from inertial.navigation.arrays import fill2
from inertial.navigation.earth import earth_rate, ned_between
from inertial.navigation.leg import R_TIME, R_V, RING, Leg, Model

Array = NDArray[np.float64]

ROWS = 7
# columns of a fix in a table: its numbers, 1-sigma of each row, what it has
F_T, F_GEO, F_V, F_YAW, F_SIGMA, F_HAS_V, F_HAS_YAW, F_WITHHELD, F_TIMING = (
    0,
    1,
    4,
    7,
    8,
    15,
    16,
    17,
    18,
)
FIX_COLUMNS = 19


@njit(cache=True)
def _velocity_before(leg: Leg, lag: float, v: Array, a: Array) -> None:
    """v_n `lag` s before the leg's time and its derivative, both (3,), from the ring; a straight
    line between ticks.
    """
    x, ring, now = leg.x, leg.ring, leg.acc[19]
    t1, k = now, RING - 1
    while k >= 0 and ring[k, R_TIME] > 0.0 and ring[k, R_TIME] >= t1 - 1e-9:
        k -= 1
    later = np.empty(3)
    for i in range(3):
        later[i] = x[3 + i]
        v[i] = x[3 + i]
        a[i] = 0.0
    while k >= 0 and ring[k, R_TIME] > 0.0 and now - ring[k, R_TIME] < 2.0:
        t0 = ring[k, R_TIME]
        for i in range(3):
            a[i] = (later[i] - ring[k, R_V + i]) / (t1 - t0)
            v[i] = later[i] + a[i] * (now - lag - t1)
        if t0 <= now - lag:
            return
        for i in range(3):
            later[i] = ring[k, R_V + i]
        t1 = t0
        k -= 1


@njit(cache=True)
def residual(leg: Leg, m: Model, w: Array, lever: Array, fix: Array, y: Array, H: Array) -> None:
    """y (7,) and H (7, n) of a fix (a row of the table) at the leg's state (E-30, E-38).

    w (3,) is the measured rate, lever (3,) the antenna from the IMU in b, m.
    """
    x = leg.x
    C = x[6:15].reshape(3, 3)
    fill2(H, 0.0)
    ie0, ie1, ie2 = earth_rate(x[0])
    eb = np.empty(3)
    for i in range(3):
        eb[i] = (
            w[i] - x[18 + i] - x[24 + i] * w[i] - (C[0, i] * ie0 + C[1, i] * ie1 + C[2, i] * ie2)
        )
    a = lever
    swing = np.array(
        (eb[1] * a[2] - eb[2] * a[1], eb[2] * a[0] - eb[0] * a[2], eb[0] * a[1] - eb[1] * a[0])
    )
    arm_n, swing_n = np.empty(3), np.empty(3)
    for i in range(3):
        arm_n[i] = C[i, 0] * a[0] + C[i, 1] * a[1] + C[i, 2] * a[2]
        swing_n[i] = C[i, 0] * swing[0] + C[i, 1] * swing[1] + C[i, 2] * swing[2]
    # from the fix to us, measured with our own radii: the same metres as the error state
    north, east, _ = ned_between(x[0], x[1], x[2], fix[1], fix[2], fix[3])
    y[0] = arm_n[0] - north
    y[1] = arm_n[1] - east
    y[2] = x[2] - fix[3] - arm_n[2]
    for i in range(3):
        y[3 + i] = x[3 + i] + swing_n[i] - fix[F_V + i]
        H[3 + i, 3 + i] = 1.0
        H[i, 6 + i] = 1.0
    _cross_rows(arm_n, H, 0)
    for j in range(3):
        H[2, j] = -H[2, j]  # height is up, the lever's third row is down
    _cross_rows(swing_n, H, 3)
    for i in range(3):  # -C [a x]
        H[3 + i, 12] = -(C[i, 1] * a[2] - C[i, 2] * a[1])
        H[3 + i, 13] = -(C[i, 2] * a[0] - C[i, 0] * a[2])
        H[3 + i, 14] = -(C[i, 0] * a[1] - C[i, 1] * a[0])
    if m.lag >= 0:
        _late(leg, m, y, H)
    flat = C[0, 0] * C[0, 0] + C[1, 0] * C[1, 0]
    y[6] = _wrap(math.atan2(C[1, 0], C[0, 0]) - fix[F_YAW])
    H[6, 0], H[6, 1], H[6, 2] = C[0, 0] * C[2, 0] / flat, C[1, 0] * C[2, 0] / flat, -1.0


@njit(cache=True)
def _late(leg: Leg, m: Model, y: Array, H: Array) -> None:
    """The receiver speaks of a moment x[27] (position) and x[28] (velocity) s before its time
    (E-38).
    """
    v, a = np.empty(3), np.empty(3)
    _velocity_before(leg, 0.5 * leg.x[27], v, a)
    for i in range(3):
        down = -1.0 if i == 2 else 1.0
        y[i] -= down * v[i] * leg.x[27]
        H[i, m.lag] = -down * v[i]
    _velocity_before(leg, leg.x[28], v, a)
    for i in range(3):
        y[3 + i] += v[i] - leg.x[3 + i]
        H[3 + i, m.lag + 1] = -a[i]


@njit(cache=True)
def _wrap(angle: float) -> float:
    return angle - 2.0 * math.pi * math.floor(angle / (2.0 * math.pi) + 0.5)


@njit(cache=True)
def _cross_rows(v: Array, H: Array, k: int) -> None:
    """Columns 0 to 2 of the three rows from k := [v x]."""
    H[k, 1], H[k, 2] = -v[2], v[1]
    H[k + 1, 0], H[k + 1, 2] = v[2], -v[0]
    H[k + 2, 0], H[k + 2, 1] = -v[1], v[0]


@njit(cache=True)
def pick(fix: Array, y: Array, H: Array, R: Array) -> int:
    """Keep the rows that the fix has, in place, and R (7, 7) of them (E-31); returns their
    number.
    """
    rows = 6 if fix[F_HAS_V] > 0.0 else 3
    fill2(R, 0.0)
    for i in range(rows):
        R[i, i] = fix[F_SIGMA + i] * fix[F_SIGMA + i]
    if fix[F_HAS_V] > 0.0 and fix[F_TIMING] > 0.0:
        for i in range(3):
            for j in range(3):
                sign = (-1.0 if i == 2 else 1.0) * (-1.0 if j == 2 else 1.0)
                R[i, j] += sign * fix[F_V + i] * fix[F_V + j] * fix[F_TIMING] * fix[F_TIMING]
    if fix[F_HAS_YAW] > 0.0:
        y[rows] = y[6]
        for j in range(H.shape[1]):
            H[rows, j] = H[6, j]
        R[rows, rows] = fix[F_SIGMA + 6] * fix[F_SIGMA + 6]
        rows += 1
    return rows


@njit(cache=True)
def innovate(P: Array, y: Array, H: Array, R: Array, m: int, PHt: Array, S: Array) -> None:
    """PHt (n, 7) := P H^T and S (7, 7) := H P H^T + R of the first m rows (E-32); zeros of H cost
    nothing.
    """
    n = P.shape[0]
    for i in range(n):
        for j in range(m):
            PHt[i, j] = 0.0
    for j in range(m):
        for k in range(n):
            a = H[j, k]
            if a != 0.0:
                for i in range(n):
                    PHt[i, j] += a * P[k, i]
    for i in range(m):
        for j in range(m):
            s = R[i, j]
            for k in range(n):
                a = H[i, k]
                if a != 0.0:
                    s += a * PHt[k, j]
            S[i, j] = s


@njit(cache=True)
def factor(S: Array, y: Array, m: int, G: Array, u: Array) -> float:
    """G (7, 7) := lower Cholesky factor of S, u (7,) := G^-1 y; returns NIS = u^T u, or NaN when S
    is not positive.
    """
    nis = 0.0
    for j in range(m):
        for i in range(j, m):
            s = S[i, j]
            for k in range(j):
                s -= G[i, k] * G[j, k]
            if i == j:
                if not s > 0.0:
                    return math.nan
                G[j, j] = math.sqrt(s)
            else:
                G[i, j] = s / G[j, j]
        s = y[j]
        for k in range(j):
            s -= G[j, k] * u[k]
        u[j] = s / G[j, j]
        nis += u[j] * u[j]
    return nis


@njit(cache=True)
def absorb(P: Array, PHt: Array, G: Array, u: Array, m: int, c: Array) -> None:
    """c (n,) := K y and P := (I - K H) P in place, by W = P H^T G^-T: P - W W^T, symmetric
    (E-33).
    """
    n = P.shape[0]
    W = np.empty((m, n))
    for r in range(n):
        s = 0.0
        for i in range(m):
            a = PHt[r, i]
            for k in range(i):
                a -= G[i, k] * W[k, r]
            W[i, r] = a / G[i, i]
            s += W[i, r] * u[i]
        c[r] = s
    P -= np.dot(W.T, W)


@njit(cache=True)
def block_weights(S: Array, y: Array, m: int, k: float, G: Array, u: Array, weight: Array) -> None:
    """Huber weights of position, velocity and heading: k/d where their Mahalanobis distance d
    exceeds k (E-39).

    weight (3,) stays 1 for a group without rows.
    """
    first = 0
    for group in range(3):
        weight[group] = 1.0
    while first < m:
        size = 3 if first < 6 and m - first >= 3 else 1
        d = math.sqrt(
            factor(
                S[first : first + size, first : first + size], y[first : first + size], size, G, u
            )
        )
        if d > k:
            weight[group_of(first, size)] = k / d
        first += size


@njit(cache=True)
def group_of(first: int, size: int) -> int:
    """0 position, 1 velocity, 2 heading."""
    return 2 if size == 1 else first // 3


@njit(cache=True)
def inflate(S: Array, R: Array, m: int, weight: Array) -> None:
    """Raise R so that each group of S grows by 1 / weight: the gain is then Huber's (E-39). In
    place, both.
    """
    first = 0
    while first < m:
        size = 3 if first < 6 and m - first >= 3 else 1
        w = weight[group_of(first, size)]
        if w < 1.0:
            for i in range(first, first + size):
                for j in range(first, first + size):
                    more = S[i, j] * (1.0 / w - 1.0)
                    S[i, j] += more
                    R[i, j] += more
        first += size


@njit(cache=True)
def consistent(
    P: Array, y: Array, H: Array, R: Array, m: int, PHt: Array, S: Array, G: Array, u: Array
) -> float:
    """Multiply P in place by the smallest power of 2 that brings NIS down to m; returns it.

    For a filter that many fixes in a row contradict: its covariance is wrong, and by how much the
    fixes say. The correlations stay, so tilt and biases are found again too. Ends at 2^60, where
    the fix itself must be wrong.
    """
    total = 1.0
    while total < 2.0**60:
        innovate(P, y, H, R, m, PHt, S)
        if factor(S, y, m, G, u) <= m:
            break
        total *= 2.0
        for i in range(P.shape[0]):
            for j in range(P.shape[0]):
                P[i, j] *= 2.0
    return total
