"""Parity of accelerometer axes by the structure of the field: a small filter that believes in rigid
bodies only.

    x = [omega (3) | omega' (3) | p (3) | offset of one axis]                                (H-1)

Axis readings must be J [omega'; p] + Q z(omega), E-3: N equations, omega' and p free at every step,
omega tied by its own integral. So N - 6 conditions stay; the innovation of the filter is their
residual, its NIS the chi-square. Runs on means of a few samples (blocks). Compiled; no time of day,
no files. docs/equations-layouts.md, H-1 to H-6.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

STATES = 10
OFFSET = 9
# m/s^2, spread of readings of an axis that says nothing: what ignoring it costs in likelihood
UNUSED_SIGMA = 10.0
NONE, OFFSET_OF, IGNORE, MIRROR_ZERO, MIRROR_REFERENCE, SWAP, SWAP_CHANGES = range(
    7
)  # hypotheses about axes


@njit(cache=True)
def predict(
    x: Array, P: Array, dt: float, sigma_alpha: float, sigma_force: float
) -> tuple[Array, Array]:
    """State (10,) and covariance after dt, s (H-2): omega' walks, p turns with the body and walks;
    per root s.
    """
    y, F = x.copy(), np.eye(STATES)
    wx, wy, wz = x[0], x[1], x[2]
    v = np.array([x[7] * wz - x[8] * wy, x[8] * wx - x[6] * wz, x[6] * wy - x[7] * wx])  # p x omega
    v2 = np.array([v[1] * wz - v[2] * wy, v[2] * wx - v[0] * wz, v[0] * wy - v[1] * wx])
    for i in range(3):
        y[i] += dt * x[3 + i]
        y[6 + i] += dt * v[i] + 0.5 * dt * dt * v2[i]
        F[i, 3 + i] = dt
    F[6, 7], F[6, 8], F[7, 6], F[7, 8], F[8, 6], F[8, 7] = (
        dt * wz,
        -dt * wy,
        -dt * wz,
        dt * wx,
        dt * wy,
        -dt * wx,
    )
    F[6, 1], F[6, 2], F[7, 0], F[7, 2], F[8, 0], F[8, 1] = (
        -dt * x[8],
        dt * x[7],
        dt * x[8],
        -dt * x[6],
        -dt * x[7],
        dt * x[6],
    )
    P = F @ P @ F.T
    q = sigma_alpha * sigma_alpha * dt
    for i in range(3):
        P[i, i] += 0.25 * dt * dt * q + 2.5e-5
        P[i, 3 + i] += 0.5 * dt * q
        P[3 + i, i] += 0.5 * dt * q
        P[3 + i, 3 + i] += q
        P[6 + i, 6 + i] += sigma_force * sigma_force * dt
    return y, P


@njit(cache=True)
def _observe(
    x: Array, P: Array, J: Array, Q: Array, offset_axis: int
) -> tuple[Array, Array, Array]:
    """Predicted readings (N,), their Jacobian (N, 10) and the spread (N, N) of the products, second
    order (H-3).
    """
    n = len(J)
    first, second = (0, 0, 0, 1, 1, 2), (0, 1, 2, 1, 2, 2)
    z, D, S = np.empty(6), np.zeros((6, 3)), np.empty((6, 6))
    for a in range(6):
        i, j = first[a], second[a]
        z[a] = x[i] * x[j] + P[i, j]
        D[a, i] += x[j]
        D[a, j] += x[i]
        for b in range(6):
            k, l = first[b], second[b]
            S[a, b] = P[i, k] * P[j, l] + P[i, l] * P[j, k]
    H = np.zeros((n, STATES))
    H[:, 0:3] = Q @ D
    H[:, 3:9] = J
    reading = J @ x[3:9] + Q @ z
    if offset_axis >= 0:
        H[offset_axis, OFFSET] = 1.0
        reading[offset_axis] += x[OFFSET]
    return reading, H, Q @ S @ Q.T


@njit(cache=True)
def _inverse(C: Array) -> tuple[Array, float]:
    """Inverse and log determinant of a positive definite matrix, by Cholesky."""
    n = len(C)
    L, M, logdet = np.zeros((n, n)), np.zeros((n, n)), 0.0
    for j in range(n):
        s = C[j, j]
        for k in range(j):
            s -= L[j, k] * L[j, k]
        L[j, j] = np.sqrt(max(s, 1e-12))
        logdet += 2.0 * np.log(L[j, j])
        for i in range(j + 1, n):
            s = C[i, j]
            for k in range(j):
                s -= L[i, k] * L[j, k]
            L[i, j] = s / L[j, j]
    for j in range(n):
        M[j, j] = 1.0 / L[j, j]
        for i in range(j + 1, n):
            s = 0.0
            for k in range(j, i):
                s -= L[i, k] * M[k, j]
            M[i, j] = s / L[i, i]
    return M.T @ M, logdet


@njit(cache=True)
def correct(
    x: Array, P: Array, f: Array, R: Array, used: Array, J: Array, Q: Array, offset_axis: int
) -> tuple[Array, Array, float, float, Array, Array]:
    """Correction by readings f (N,) with variances R (N,) of the axes `used` (N,) bool (H-4).

    Returns x, P, NIS, log determinant, and for every axis its residual against all others and the
    sigma of that: for a used one C^-1 nu / diag C^-1, for another one its reading minus the
    prediction after the correction.
    """
    n = len(f)
    index = np.nonzero(used)[0]
    m = len(index)
    reading, H, spread = _observe(x, P, J, Q, offset_axis)
    Hu, nu, C = np.empty((m, STATES)), np.empty(m), np.empty((m, m))
    for a in range(m):
        Hu[a] = H[index[a]]
        nu[a] = f[index[a]] - reading[index[a]]
        for b in range(m):
            C[a, b] = spread[index[a], index[b]]
        C[a, a] += R[index[a]]
    PHt = P @ Hu.T
    C += Hu @ PHt
    Ci, logdet = _inverse(C)
    w = Ci @ nu
    K = PHt @ Ci
    nis = float(nu @ w)
    x = x + K @ nu
    P = P - K @ PHt.T
    P = 0.5 * (P + P.T)
    residual, sigma = np.empty(n), np.empty(n)
    for a in range(m):
        residual[index[a]] = w[a] / Ci[a, a]
        sigma[index[a]] = 1.0 / np.sqrt(Ci[a, a])
    if m < n:
        reading, H, spread = _observe(x, P, J, Q, offset_axis)
        for i in range(n):
            if not used[i]:
                residual[i] = f[i] - reading[i]
                sigma[i] = np.sqrt(max(H[i] @ P @ H[i], 0.0) + spread[i, i] + R[i])
    return x, P, nis, logdet, residual, sigma


@njit(cache=True)
def variances(f: Array, white: Array, offset: Array, scale: float, reference: Array) -> Array:
    """Variance (N,) of one block's readings (H-5): noise, offset not known, scale error times what
    has changed.
    """
    return white + offset + (scale * (f - reference)) ** 2


@njit(cache=True)
def altered(f: Array, bias: Array, reference: Array, kind: int, i: int, j: int) -> Array:
    """Readings without bias as they were if hypothesis `kind` about axes i and j holds (H-6)."""
    g = f - bias
    if kind == MIRROR_ZERO:
        g[i] = -f[i] - bias[i]
    elif kind == MIRROR_REFERENCE:
        g[i] = 2.0 * reference[i] - f[i] - bias[i]
    elif kind == SWAP:
        g[i], g[j] = f[j] - bias[i], f[i] - bias[j]
    elif kind == SWAP_CHANGES:
        g[i] = reference[i] + f[j] - reference[j] - bias[i]
        g[j] = reference[j] + f[i] - reference[i] - bias[j]
    return g


@njit(cache=True)
def step(
    x: Array,
    P: Array,
    block: Array,
    dt: float,
    used: Array,
    learned: Array,
    constants: tuple[Array, Array, Array, Array, Array, Array],
    tuning: tuple[float, float, float],
) -> tuple[Array, Array, float, float, Array, Array]:
    """One block (N,) dt (s) after the last, as correct() says it; an axis that is not `learned` has
    no scale error.
    """
    J, Q, bias, reference, white, offset = constants
    R = variances(block, white, offset, tuning[2], np.where(learned, reference, block))
    x, P = predict(x, P, dt, tuning[0], tuning[1])
    return correct(x, P, block - bias, R, used, J, Q, -1)


@njit(cache=True)
def replay(
    x: Array,
    P: Array,
    blocks: Array,
    dt: Array,
    used: Array,
    kind: int,
    i: int,
    j: int,
    since: int,
    constants: tuple[Array, Array, Array, Array, Array, Array],
    tuning: tuple[float, float, float],
) -> tuple[float, float, int, Array, Array]:
    """Run the filter over blocks (n, N) under a hypothesis: score (-2 log likelihood), NIS, its
    degrees, x, P.

    The hypothesis holds after block `since`; in that block, which may be mixed, its axes are not
    used. -1: always.
    constants: J, Q, bias, reference, white variance, offset variance; tuning: sigma_alpha,
    sigma_force, scale.
    """
    J, Q, bias, reference, white, offset = constants
    used = used.copy()
    x, P = x.copy(), P.copy()
    x[OFFSET], P[OFFSET, :], P[:, OFFSET] = 0.0, 0.0, 0.0
    if kind == OFFSET_OF:
        P[OFFSET, OFFSET] = UNUSED_SIGMA**2
    score, total, degrees = 0.0, 0.0, 0
    before = used.copy()
    without = used.copy()
    if kind != NONE:
        without[i] = False
        if j >= 0:
            without[j] = False
    for k in range(len(blocks)):
        now = NONE if k <= since else kind
        used = before if k < since else without if k == since or kind == IGNORE else before
        offset_axis = i if now == OFFSET_OF else -1
        f = altered(blocks[k], bias, reference, now, i, j)
        R = variances(f + bias, white, offset, tuning[2], reference)
        x, P = predict(x, P, dt[k], tuning[0], tuning[1])
        x, P, nis, logdet, _, _ = correct(x, P, f, R, used, J, Q, offset_axis)
        score += nis + logdet + (len(used) - used.sum()) * 2.0 * np.log(UNUSED_SIGMA)
        total += nis
        degrees += int(used.sum())
    return score, total, degrees, x, P
