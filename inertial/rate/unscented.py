"""Unscented transform of the products filter's model: prediction and correction by sigma points
(E-44).

Symmetric set of 2 n + 1 points with weight w0 = 1 - n / spread in the middle; spread = 3 keeps the
fourth moment of a Gaussian. Only the components that the functions are not linear in need points:
omega and u. The other components are carried linearly, which gives the same numbers as points of
all 22 and a tenth of the work (marginalised transform).
"""

import numpy as np
from numpy.typing import NDArray

from inertial.attitude.rotation import from_rotation_vector, to_dcm
from inertial.rate.compiling import making
from inertial.rate.observed import Sensor
from inertial.rate.products_kernel import (
    COV,
    INNOVATION,
    RESIDUAL,
    ROWS,
    SIGMA,
    STRIDE,
    Six,
    Three,
    Tuning,
    absorb_six,
)
from inertial.rate.products_model import FIRST, SECOND, STATES

Array = NDArray[np.float64]

SPREAD = 3.0
INSIDE = np.array(
    [0, 1, 2, 12, 13, 14, 3, 4, 5, 21]
)  # omega, u, b_alpha, angle: what the transition takes


@making
def root(A: Array) -> Array:
    """Lower triangular L with L L^T = A for a positive semidefinite A (n, n); columns of zero
    variance are zero.
    """
    n = len(A)
    L = np.zeros((n, n))
    for j in range(n):
        value = A[j, j]
        for l in range(j):
            value -= L[j, l] * L[j, l]
        if value <= 1e-14 * A[j, j]:
            continue
        L[j, j] = np.sqrt(value)
        for i in range(j + 1, n):
            value = A[i, j]
            for l in range(j):
                value -= L[i, l] * L[j, l]
            L[i, j] = value / L[j, j]
    return L


@making
def predict(
    x: Array,
    flat: Array,
    alpha_m: Three,
    N: Six,
    dt: float,
    turning: bool,
    s: Sensor,
    earth_b: Three,
) -> None:
    """E-31 through sigma points of [omega, u, b_alpha], in place, without process noise; P flat
    (484,).
    """
    n, m, P = len(INSIDE), len(x), flat.reshape(STATES, STATES)
    A, mean = np.empty((n, n)), np.empty(n)
    for i in range(n):
        mean[i] = x[INSIDE[i]]
        for j in range(n):
            A[i, j] = P[INSIDE[i], INSIDE[j]]
    L = root(A)
    points = np.empty((2 * n + 1, n))
    points[0] = mean
    for k in range(n):
        for i in range(n):
            points[1 + k, i] = mean[i] + np.sqrt(SPREAD) * L[i, k]
            points[1 + n + k, i] = mean[i] - np.sqrt(SPREAD) * L[i, k]
    for k in range(2 * n + 1):
        _move(points[k], alpha_m, N, dt, turning, s, earth_b)
    w, w0 = 0.5 / SPREAD, 1.0 - n / SPREAD
    new = w0 * points[0]
    for k in range(1, 2 * n + 1):
        new += w * points[k]
    cross, square = np.zeros((n, n)), np.zeros((n, n))  # with L's columns, of the result
    for k in range(2 * n + 1):
        weight = w0 if k == 0 else w
        for i in range(n):
            for j in range(n):
                square[i, j] += weight * (points[k, i] - new[i]) * (points[k, j] - new[j])
    for k in range(n):
        for i in range(n):
            cross[i, k] = (points[1 + k, i] - points[1 + n + k, i]) * 0.5 / np.sqrt(SPREAD)
    F = _slope(cross, L)
    _carry(P, F, m)
    for i in range(n):
        x[INSIDE[i]] = new[i]
        for j in range(n):
            P[INSIDE[i], INSIDE[j]] = 0.5 * (square[i, j] + square[j, i])


@making
def _slope(cross: Array, L: Array) -> Array:
    """F with F L = cross: the statistical linearisation; a direction without variance keeps slope
    one.
    """
    n = len(L)
    F = np.zeros((n, n))
    for i in range(n):
        for j in range(n - 1, -1, -1):
            if L[j, j] == 0.0:
                F[i, j] = 1.0 if i == j else 0.0
                continue
            value = cross[i, j]
            for l in range(j + 1, n):
                value -= F[i, l] * L[l, j]
            F[i, j] = value / L[j, j]
    return F


@making
def _carry(P: Array, F: Array, m: int) -> None:
    """Cross covariance of what moves with what does not."""
    n = len(INSIDE)
    old = np.empty(n)
    for j in range(m):
        inside = False
        for i in range(n):
            inside = inside or INSIDE[i] == j
            old[i] = P[INSIDE[i], j]
        if inside:
            continue
        for i in range(n):
            value = 0.0
            for l in range(n):
                value += F[i, l] * old[l]
            P[INSIDE[i], j] = P[j, INSIDE[i]] = value


@making
def _move(
    p: Array, alpha_m: Three, N: Six, dt: float, turning: bool, s: Sensor, earth_b: Three
) -> None:
    w = p[0:3].copy()
    if turning:
        alpha = np.array([alpha_m[0] - p[6], alpha_m[1] - p[7], alpha_m[2] - p[8]])
        if s.feedback:
            for i in range(3):
                for k in range(6):
                    alpha[i] -= s.SQ[i, k] * w[FIRST[k]] * w[SECOND[k]]
        p[0] += dt * (N[0] * alpha[0] + N[1] * alpha[1] + N[2] * alpha[2])
        p[1] += dt * (N[1] * alpha[0] + N[3] * alpha[1] + N[4] * alpha[2])
        p[2] += dt * (N[2] * alpha[0] + N[4] * alpha[1] + N[5] * alpha[2])
    p[9] += 0.5 * dt * (w[2] + p[2])
    mean = 0.5 * (w + p[0:3])
    turn = np.array([earth_b[0] - mean[0], earth_b[1] - mean[1], earth_b[2] - mean[2]])
    C = to_dcm(from_rotation_vector(dt * turn))
    u0, u1, u2 = p[3], p[4], p[5]
    for i in range(3):
        p[3 + i] = C[i, 0] * u0 + C[i, 1] * u1 + C[i, 2] * u2


@making
def by_products(
    x: Array, flat: Array, work: Array, y: Array, s: Sensor, t: Tuning, out: Array
) -> tuple[float, float]:
    """Correction by c_m = y[3:9] through sigma points of omega (three, so seven points); NIS and 1
    / sqrt(det C).
    """
    if s.m == 0:
        return 0.0, 1.0
    P = flat.reshape(STATES, STATES)
    L = root(P[0:3, 0:3].copy())
    z = np.empty((7, 6))
    w = np.empty(3)
    for k in range(7):
        for i in range(3):
            w[i] = x[i]
            if 1 <= k <= 3:
                w[i] += np.sqrt(SPREAD) * L[i, k - 1]
            elif k > 3:
                w[i] -= np.sqrt(SPREAD) * L[i, k - 4]
        for r in range(6):
            z[k, r] = 0.0
            for q in range(6):
                if s.M[r, q] != 0.0:
                    z[k, r] += s.M[r, q] * w[FIRST[q]] * w[SECOND[q]]
    mean = (1.0 - 3.0 / SPREAD) * z[0]
    for k in range(1, 7):
        mean += 0.5 / SPREAD * z[k]
    cross = np.empty((3, 6))
    for k in range(3):
        for r in range(6):
            cross[k, r] = (z[1 + k, r] - z[4 + k, r]) * 0.5 / np.sqrt(SPREAD)
    H = np.zeros((6, 3))
    for r in range(s.m):
        for j in range(2, -1, -1):
            value = cross[j, r]
            for l in range(j + 1, 3):
                value -= H[r, l] * L[l, j]
            H[r, j] = value / L[j, j] if L[j, j] > 0.0 else 0.0
    return _absorb_products(x, flat, work, y[3:9], mean, z, H, s, t, out)


@making
def _absorb_products(
    x: Array,
    flat: Array,
    work: Array,
    c_m: Array,
    mean: Array,
    z: Array,
    H: Array,
    s: Sensor,
    t: Tuning,
    out: Array,
) -> tuple[float, float]:
    n, P = len(x), flat.reshape(STATES, STATES)
    HP, C = work[ROWS : ROWS + 6 * STRIDE].reshape(6, STRIDE), work[COV : COV + 36].reshape(6, 6)
    y = work[RESIDUAL : RESIDUAL + 6]
    HP[:, :], C[:, :], y[:] = 0.0, np.eye(6), 0.0
    for r in range(s.m):
        for j in range(n):
            HP[r, j] = H[r, 0] * P[0, j] + H[r, 1] * P[1, j] + H[r, 2] * P[2, j] + P[6 + r, j]
        y[r] = c_m[r] - mean[r] - x[6 + r]
    for r in range(s.m):
        for q in range(s.m):
            value = s.R_c[r, q] + P[6 + r, 6 + q]
            for i in range(3):
                value += H[r, i] * P[i, 6 + q] + P[6 + r, i] * H[q, i]
            for k in range(7):
                weight = 1.0 - 3.0 / SPREAD if k == 0 else 0.5 / SPREAD
                value += weight * (z[k, r] - mean[r]) * (z[k, q] - mean[q])
            C[r, q] = value
        out[INNOVATION + r], out[SIGMA + r] = y[r], np.sqrt(C[r, r])
    return absorb_six(x, flat, work, t.products_gate)
