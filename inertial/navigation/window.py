"""The predictive estimator: the last N fixes solved anew from a state N fixes ago. E-42 to E-45.

Muske and Rawlings' linear moving horizon, in the form "restart a Kalman filter N fixes ago with
covariance P_arr". With the Kalman filter's own covariance there it is the Kalman filter; with a
fixed one its gain never sinks, so that it forgets a wrong model of the biases, and pays with noise.
Epochs without a fix used are part of a leg, not of N.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from inertial.navigation.arrays import copy1, copy2, fill1, fill2
from inertial.navigation.leg import R_F, R_LENGTH, R_W, RING, Leg, carry
from inertial.navigation.update import absorb, block_weights, factor, innovate

Array = NDArray[np.float64]

CAPACITY = 11  # fixes kept; N is at most 10
ARRIVAL_P0, ARRIVAL_MEAN, ARRIVAL_KF = 0, 1, 2
W_COUNT, W_HEAD, W_SEEN = (
    0,
    1,
    2,
)  # places of Window.count: fixes held, where the oldest is, fixes since the start


class Window(NamedTuple):
    """The shared linearisation of the last fixes, as a ring, and the covariances that an arrival
    may take.
    """

    Phi: Array  # (CAPACITY, n, n)
    Q: Array  # (CAPACITY, n, n)
    y: Array  # (CAPACITY, 7)
    H: Array  # (CAPACITY, 7, n)
    R: Array  # (CAPACITY, 7, 7)
    c: Array  # (CAPACITY, n) the correction applied after each
    # (CAPACITY, n, n) covariance after the fix before each: of the Kalman filter, or the
    # estimator's own
    start: Array
    rows: Array  # (CAPACITY,) int64
    count: Array  # (3,) int64
    P0: Array  # (n, n) at the start of navigation
    Pk: Array  # (n, n) of a Kalman filter beside it, after the last fix
    mean: Array  # (n, n) sum of Pk over all fixes, or a given mean where seen is negative
    m: Array  # (CAPACITY, 2, n) states of a pass, before and after each fix
    P: Array  # (CAPACITY, 2, n, n) their covariances
    work: Array  # (3, n, n)


def new_window(n: int, size: int = CAPACITY) -> Window:
    """Memory of a moving horizon over n states; size 0 for filters without one."""
    k = max(size, 1)
    return Window(
        np.zeros((k, n, n)),
        np.zeros((k, n, n)),
        np.zeros((k, 7)),
        np.zeros((k, 7, n)),
        np.zeros((k, 7, 7)),
        np.zeros((k, n)),
        np.zeros((k, n, n)),
        np.zeros(k, np.int64),
        np.zeros(3, np.int64),
        np.eye(n),
        np.eye(n),
        np.zeros((n, n)),
        np.zeros((k, 2, n)),
        np.zeros((k, 2, n, n)),
        np.zeros((3, n, n)),
    )


@njit(cache=True)
def push(
    win: Window, Phi: Array, Q: Array, y: Array, H: Array, R: Array, rows: int, start: Array
) -> None:
    """Append a fix; the oldest goes when the ring is full."""
    size = win.y.shape[0]
    if win.count[W_COUNT] == size:
        win.count[W_HEAD] = (win.count[W_HEAD] + 1) % size
        win.count[W_COUNT] -= 1
    k = (win.count[W_HEAD] + win.count[W_COUNT]) % size
    copy2(Phi, win.Phi[k])
    copy2(Q, win.Q[k])
    copy2(start, win.start[k])
    copy1(y, win.y[k])
    copy2(H, win.H[k])
    copy2(R, win.R[k])
    fill1(win.c[k], 0.0)
    win.rows[k] = rows
    win.count[W_COUNT] += 1


@njit(cache=True)
def kf_beside(win: Window) -> None:
    """Bring the Kalman covariance over the newest fix, and its sum."""
    k = (win.count[W_HEAD] + win.count[W_COUNT] - 1) % win.y.shape[0]
    n = win.Pk.shape[0]
    PHt, S, G, u, c = np.empty((n, 7)), np.empty((7, 7)), np.empty((7, 7)), np.empty(7), np.empty(n)
    P = win.work[0]
    carry(win.Pk, win.Phi[k], win.Q[k], 1.0, win.work[1], P)
    innovate(P, win.y[k], win.H[k], win.R[k], win.rows[k], PHt, S)
    factor(S, win.y[k], win.rows[k], G, u)
    absorb(P, PHt, G, u, win.rows[k], c)
    copy2(P, win.Pk)
    if win.count[W_SEEN] >= 0:
        win.count[W_SEEN] += 1
        for i in range(n):
            for j in range(n):
                win.mean[i, j] += P[i, j]


@njit(cache=True)
def arrival(win: Window, N: int, mode: int, kappa: float, out: Array) -> int:
    """out (n, n) := covariance at the start of the last N fixes (E-43); returns how many fixes
    there are, at most N.

    While fewer than N have come, the horizon begins at the start of navigation, whose covariance is
    known: P0.
    """
    n = min(N, win.count[W_COUNT])
    if mode == ARRIVAL_KF:
        copy2(win.start[(win.count[W_HEAD] + win.count[W_COUNT] - n) % win.y.shape[0]], out)
    elif mode == ARRIVAL_P0 or win.count[W_COUNT] < N:
        copy2(win.P0, out)
    else:
        seen = win.count[W_SEEN]
        factor = kappa / (seen if seen > 0 else 1)
        for i in range(out.shape[0]):
            for j in range(out.shape[0]):
                out[i, j] = factor * win.mean[i, j]
    return n


@njit(cache=True)
def forward(win: Window, n: int, P_arr: Array, scale: Array) -> int:
    """A Kalman pass over the last n fixes from mean 0 and P_arr (E-44); states and covariances stay
    in win.m, win.P.

    scale (CAPACITY, 3) divides R of position, velocity and heading of each fix of the pass. Returns
    the place of the newest fix: the estimate is win.m[place, 1], win.P[place, 1].
    """
    size, states = win.y.shape[0], P_arr.shape[0]
    PHt, S, G = np.empty((states, 7)), np.empty((7, 7)), np.empty((7, 7))
    u, c, e, R = np.empty(7), np.empty(states), np.empty(7), np.empty((7, 7))
    mean = np.zeros(states)
    P = win.work[0]
    copy2(P_arr, P)
    k = 0
    for j in range(n):
        k = (win.count[W_HEAD] + win.count[W_COUNT] - n + j) % size
        rows = win.rows[k]
        for i in range(states):
            s = 0.0
            for r in range(states):
                s += win.Phi[k, i, r] * mean[r]
            win.m[k, 0, i] = s
        copy1(win.m[k, 0], mean)
        carry(P, win.Phi[k], win.Q[k], 1.0, win.work[1], win.work[2])
        copy2(win.work[2], P)
        copy2(P, win.P[k, 0])
        copy2(win.R[k], R)
        for i in range(rows):
            s = win.y[k, i]
            for r in range(states):
                s -= win.H[k, i, r] * mean[r]
            e[i] = s
            for r in range(rows):
                gi, gr = _group(i, rows), _group(r, rows)
                R[i, r] /= math.sqrt(scale[j, gi] * scale[j, gr])
        innovate(P, e, win.H[k], R, rows, PHt, S)
        factor(S, e, rows, G, u)
        absorb(P, PHt, G, u, rows, c)
        for i in range(states):
            mean[i] += c[i]
        copy1(mean, win.m[k, 1])
        copy2(P, win.P[k, 1])
        if j < n - 1:
            for i in range(states):
                mean[i] -= win.c[k, i]
    return k


@njit(cache=True)
def _group(row: int, rows: int) -> int:
    """Position, velocity or heading: rows count 3, 4, 6 or 7."""
    if row < 3:
        return 0
    return 1 if row < 6 and rows >= 6 else 2


@njit(cache=True)
def smooth(win: Window, n: int, out: Array) -> None:
    """out (CAPACITY, n states) := the state at each of the last n fixes given all of them (E-46),
    after `forward`.
    """
    size, states = win.y.shape[0], win.P0.shape[0]
    gap = np.empty(states)
    k = (win.count[W_HEAD] + win.count[W_COUNT] - 1) % size
    copy1(win.m[k, 1], out[n - 1])
    for j in range(n - 2, -1, -1):
        k = (win.count[W_HEAD] + win.count[W_COUNT] - n + j) % size
        later = (k + 1) % size
        for i in range(states):
            gap[i] = out[j + 1, i] - win.m[later, 0, i]
        back = np.dot(win.Phi[later].T, np.linalg.solve(win.P[later, 0], gap))
        back = np.dot(win.P[k, 1], back)
        for i in range(states):
            out[j, i] = win.m[k, 1, i] + back[i]


@njit(cache=True)
def robust(
    win: Window, n: int, P_arr: Array, k_huber: float, passes: int, scale: Array, out: Array
) -> int:
    """`forward` with Huber weights found from the smoothed residuals of the horizon (E-47); returns
    as `forward`.

    scale is filled, (CAPACITY, 3); out (CAPACITY, n states) is scratch.
    """
    size, states = win.y.shape[0], P_arr.shape[0]
    fill2(scale, 1.0)
    newest = forward(win, n, P_arr, scale)
    G, u, e, weight = np.empty((7, 7)), np.empty(7), np.empty(7), np.empty(3)
    for _ in range(passes):
        smooth(win, n, out)
        changed = 0.0
        for j in range(n):
            k = (win.count[W_HEAD] + win.count[W_COUNT] - n + j) % size
            for i in range(win.rows[k]):
                s = win.y[k, i]
                for r in range(states):
                    s -= win.H[k, i, r] * out[j, r]
                e[i] = s
            block_weights(win.R[k], e, win.rows[k], k_huber, G, u, weight)
            for g in range(3):
                changed = max(changed, abs(weight[g] - scale[j, g]))
                scale[j, g] = weight[g]
        if changed < 1e-3:
            break
        newest = forward(win, n, P_arr, scale)
    return newest


@njit(cache=True)
def motion(leg: Leg, literal: bool, still_f: float, out: Array) -> None:
    """The two inputs of the fuzzy rules (E-48): |f^b| in m/s^2 and |w^b| in rad/s.

    Conditioned: means over the last second, gyro bias off, and g plus how far |mean f| is from its
    value still_f at standstill. Literal: of the last tick, as read.
    """
    f, w, T = np.zeros(3), np.zeros(3), 0.0
    for k in range(RING - (1 if literal else 10), RING):
        T += leg.ring[k, R_LENGTH]
        for i in range(3):
            f[i] += leg.ring[k, R_F + i]
            w[i] += leg.ring[k, R_W + i]
    if T <= 0.0:
        out[0], out[1] = 9.80665, 0.0
        return
    size = turn = 0.0
    for i in range(3):
        size += (f[i] / T) ** 2
        turn += (w[i] / T - (0.0 if literal else leg.x[18 + i])) ** 2
    out[0] = math.sqrt(size) if literal else 9.80665 + abs(math.sqrt(size) - still_f)
    out[1] = math.sqrt(turn)
