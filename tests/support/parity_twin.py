"""Twins in numpy of the axis monitor's kernels, as one would write them down: tests compare
inertial/core/rate with them. Equations H-1 to H-8 of docs/equations-layouts.md.
"""

import numpy as np
from numpy.typing import NDArray

from inertial.rate.axis_samples import (
    AT_LIMIT,
    FILLED,
    HEARD,
    KNOWN,
    LIMIT_AGE,
    SAME,
    SPIKE_AGE,
    SPIKES,
)
from inertial.rate.parity import (
    IGNORE,
    MIRROR_REFERENCE,
    MIRROR_ZERO,
    NONE,
    OFFSET,
    OFFSET_OF,
    STATES,
    SWAP,
    SWAP_CHANGES,
)

Integers = NDArray[np.int64]
AGE_LONG = 1_000_000
SPIKE_SIGMAS = 9.0
SPIKE_MEMORY = 200
UNUSED_SIGMA = 10.0
Array = NDArray[np.float64]


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


def observe(x: Array, P: Array, J: Array, Q: Array, offset_axis: int) -> tuple[Array, Array, Array]:
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


def inverse(C: Array) -> tuple[Array, float]:
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
    reading, H, spread = observe(x, P, J, Q, offset_axis)
    Hu, nu, C = np.empty((m, STATES)), np.empty(m), np.empty((m, m))
    for a in range(m):
        Hu[a] = H[index[a]]
        nu[a] = f[index[a]] - reading[index[a]]
        for b in range(m):
            C[a, b] = spread[index[a], index[b]]
        C[a, a] += R[index[a]]
    PHt = P @ Hu.T
    C += Hu @ PHt
    Ci, logdet = inverse(C)
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
        reading, H, spread = observe(x, P, J, Q, offset_axis)
        for i in range(n):
            if not used[i]:
                residual[i] = f[i] - reading[i]
                sigma[i] = np.sqrt(max(H[i] @ P @ H[i], 0.0) + spread[i, i] + R[i])
    return x, P, nis, logdet, residual, sigma


def variances(
    f: Array, white: Array, offset: Array, scale: float, cross: float, reference: Array
) -> Array:
    """Variance (N,) of one block's readings (H-5): noise, offset not known, scale error times what
    has changed, and what of other axes' changes comes in by its direction.
    """
    others = cross**2 * np.mean((f - reference) ** 2)
    return white + offset + (scale * (f - reference)) ** 2 + others


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
    reference = np.where(learned, reference, block)
    R = variances(block, white, offset, tuning[2], tuning[3], reference)
    x, P = predict(x, P, dt, tuning[0], tuning[1])
    return correct(x, P, block - bias, R, used, J, Q, -1)


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
    sigma_force, scale, cross.
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
        R = variances(f + bias, white, offset, tuning[2], tuning[3], reference)
        x, P = predict(x, P, dt[k], tuning[0], tuning[1])
        x, P, nis, logdet, _, _ = correct(x, P, f, R, used, J, Q, offset_axis)
        score += nis + logdet + (len(used) - used.sum()) * 2.0 * np.log(UNUSED_SIGMA)
        total += nis
        degrees += int(used.sum())
    return score, total, degrees, x, P


def gather(
    f: Array,
    begin: int,
    per_block: int,
    near: Array,
    marks: Integers,
    noise: Array,
    limit: Array,
    free: Array,
    count: Integers,
) -> int:
    """Take samples f[begin:] (n, N), m/s^2, until a block is full or there are no more; returns the
    next one's row.

    near (7, N): the samples before the last but one, before the last, the last, and the sum of the
    block, spikes removed; the usual distance from the middle of the neighbours; the running mean of
    squared third differences that no motion explains, over the noise's; the smallest change between
    samples. marks: how many of the first three are known, samples in the block, in that mean.
    free (N, N): the projection.
    """
    for k in range(begin, len(f)):
        if marks[KNOWN] > 0:
            change = np.abs(f[k] - near[2])
            least = np.where(near[6] > 0.0, np.minimum(near[6], change), change)
            near[6] = np.where(change > 0.0, least, near[6])
        clean = look(f[k], near[2], near[1], marks[KNOWN], noise, limit, count, near[4])
        if marks[KNOWN] == 3:
            hear(f[k] - 3.0 * clean + 3.0 * near[1] - near[0], near[5], marks, noise, free)
        if marks[KNOWN] > 0:
            near[3] += clean
            marks[FILLED] += 1
        near[0] = near[1]
        near[1] = clean if marks[KNOWN] >= 2 else near[2]
        near[2] = f[k]
        marks[KNOWN] = min(marks[KNOWN] + 1, 3)
        if marks[FILLED] >= per_block:
            return k + 1
    return len(f)


def hear(third: Array, mean: Array, marks: Integers, noise: Array, free: Array) -> None:
    """One third difference (N,) into the running means (N,) of its ratio to the noise (H-11)."""
    marks[HEARD] = min(marks[HEARD] + 1, 256)
    left, share = free @ third, np.diag(free)
    for i in np.nonzero(share >= 0.05)[0]:
        ratio = left[i] ** 2 / (20.0 * share[i] * noise[i] ** 2)
        mean[i] += (min(ratio, 6.0 * max(mean[i], 1.0)) - mean[i]) / marks[HEARD]


def measured_noise(near: Array, marks: Integers, free: Array) -> float:
    """Variance of the axes' noise over the configured one; 1 where chance may make it so."""
    share = np.diag(free)
    if not (share >= 0.05).any() or marks[HEARD] == 0:
        return 1.0
    ratio = float(np.median(near[5][share >= 0.05])) / 0.9
    return 1.0 if ratio < 1.0 + 0.25 * np.sqrt(256.0 / marks[HEARD]) else ratio


def resolution(near: Array, noise: Array) -> float:
    """What readings are rounded to, where that hides their noise."""
    changed = near[6] > 0.0
    if 2 * np.count_nonzero(changed) < near.shape[1]:
        return 0.0
    middle = float(np.median(near[6][changed]))
    return middle if middle > 2.0 * np.median(noise[changed]) else 0.0


def flags(
    count: Integers,
    stuck: int,
    at_limit: int,
    spikes: int,
    coarse: bool,
    out: NDArray[np.bool_],
) -> bool:
    """Rows of out (3, N): axes that are stuck, at the end of their range, spiking, by counts. True
    for any.
    """
    n, standing, found = count.shape[1], 0, False
    for i in range(n):
        out[0, i], out[1, i] = (
            not coarse and count[SAME, i] >= stuck,
            count[AT_LIMIT, i] >= at_limit,
        )
        out[2, i] = count[SPIKES, i] >= spikes
        standing += 1 if out[0, i] else 0
    if standing * 2 > n:  # most stand still exactly: a source without noise, not a fault
        out[0] = False
    for i in range(n):
        found = found or out[0, i] or out[1, i] or out[2, i]
    return found


def look(
    f: Array,
    last: Array,
    before: Array,
    known: int,
    noise: Array,
    limit: Array,
    count: Integers,
    usual_of: Array,
) -> Array:
    """Take sample f (N,), m/s^2, after `last` and `before` (known: how many of the two are there).
    Counts per axis:

    SAME samples in a row that equal their neighbour exactly, AT_LIMIT in a row at the end of the
    range, samples since that and since a spike, and SPIKES close to one another. Returns `last`
    with spikes replaced by the middle of their neighbours. A knock moves all axes: a spike must
    stand out six times from the median axis; vibration is usual: six times from what the axis
    always does (usual_of, changed in place); and more than two at once are a motion.
    """
    n = len(f)
    clean = last.copy()
    for i in range(n):
        count[SAME, i] = count[SAME, i] + 1 if known >= 1 and f[i] == last[i] else 0
        if abs(f[i]) >= 0.998 * limit[i]:
            count[AT_LIMIT, i] += 1
            count[LIMIT_AGE, i] = 0
        else:
            count[AT_LIMIT, i] = 0
            count[LIMIT_AGE, i] = min(count[LIMIT_AGE, i] + 1, AGE_LONG)
        count[SPIKE_AGE, i] = min(count[SPIKE_AGE, i] + 1, AGE_LONG)
        if count[SPIKE_AGE, i] > SPIKE_MEMORY:
            count[SPIKES, i] = 0
    if known < 2:
        return clean
    off = np.abs(last - 0.5 * (f + before))
    usual, floor = np.median(off), SPIKE_SIGMAS * noise
    spike = (off > np.maximum(np.maximum(floor, 6.0 * usual_of), 6.0 * usual)) & (
        np.abs(f - before) < 0.6 * off
    )
    usual_of += (np.minimum(off, np.maximum(3.0 * usual_of, floor)) - usual_of) / 32.0
    if spike.sum() > 2:
        return clean
    for i in np.nonzero(spike)[0]:
        count[SPIKES, i] += 1
        count[SPIKE_AGE, i] = 0
        clean[i] = 0.5 * (f[i] + before[i])
    return clean
