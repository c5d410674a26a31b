"""Corrections of the products filter: products, gravity, standstill (E-33 to E-38); its arrays:
products_kernel.py.

Each fills H P, C and y of the workspace and has the kernel absorb them, six or three innovations at
a time.
"""

import numpy as np
from numpy.typing import NDArray

from inertial.rate.compiling import fused
from inertial.rate.observed import Sensor
from inertial.rate.products_kernel import (
    B_F,
    COV,
    INNOVATION,
    JACOBIAN,
    PIVOT,
    RESIDUAL,
    ROWS,
    SIGMA,
    SPREAD,
    STRIDE,
    Three,
    Tuning,
    U,
    absorb_six,
    absorb_three,
)
from inertial.rate.products_model import FIRST, SECOND, STATES
from inertial.rate.vectors import combine

Array = NDArray[np.float64]


@fused
def by_products(
    x: Array, P: Array, work: Array, y: Array, at: Three, s: Sensor, t: Tuning, out: Array
) -> tuple[float, float]:
    """Correct by the observed combinations y[3:9] of the products, linear about omega = at (E-33,
    E-34).

    Returns NIS and 1 / sqrt(det C). What a layout does not see are rows of zeros, which say
    nothing.
    """
    if s.m == 0:
        return 0.0, 1.0
    w0, w1, w2 = at
    e = work[RESIDUAL : RESIDUAL + 6]
    z0, z1, z2 = w0 * x[0], w0 * x[1] + w1 * x[0] - w0 * w1, w0 * x[2] + w2 * x[0] - w0 * w2
    z0, z3, z5 = 2.0 * z0 - w0 * w0, 2.0 * w1 * x[1] - w1 * w1, 2.0 * w2 * x[2] - w2 * w2
    z4 = w1 * x[2] + w2 * x[1] - w1 * w2
    z0, z1, z2, z3, z4, z5 = z0 + P[0], z1 + P[1], z2 + P[2], z3 + P[23], z4 + P[24], z5 + P[46]
    if s.plain:
        e[0], e[1], e[2], e[3], e[4], e[5] = z0, z1, z2, z3, z4, z5
    else:
        for r in range(6):
            M = s.M[r]
            e[r] = M[0] * z0 + M[1] * z1 + M[2] * z2 + M[3] * z3 + M[4] * z4 + M[5] * z5
    for r in range(6):
        e[r] = y[3 + r] - x[6 + r] - e[r]
    products_rows(P, work, at, s, 1.0)
    _add_spread(P, work, s)
    for r in range(s.m):
        out[INNOVATION + r], out[SIGMA + r] = e[r], np.sqrt(work[COV + 7 * r])
    return absorb_six(x, P, work, t.products_gate)


@fused
def products_rows(P: Array, work: Array, w: Three, s: Sensor, share: float) -> None:
    """H P and the lower triangle of H P H^T + share R_c, for the products about omega = w
    (E-33).
    """
    n, w0, w1, w2 = STATES, w[0], w[1], w[2]
    G, H, C = work, work[JACOBIAN : JACOBIAN + 18], work[COV : COV + 36]
    for r in range(6):
        M = s.M[r]
        H[3 * r] = 2.0 * M[0] * w0 + M[1] * w1 + M[2] * w2
        H[3 * r + 1] = M[1] * w0 + 2.0 * M[3] * w1 + M[4] * w2
        H[3 * r + 2] = M[2] * w0 + M[4] * w1 + 2.0 * M[5] * w2
    for r in range(6):
        h0, h1, h2 = H[3 * r], H[3 * r + 1], H[3 * r + 2]
        combine(G, STRIDE * r, P, (n * (6 + r), 0, n, 2 * n), (1.0, h0, h1, h2))
    for k in range(6):
        g0, g1, g2 = G[STRIDE * k], G[STRIDE * k + 1], G[STRIDE * k + 2]
        for l in range(k + 1):
            value = g0 * H[3 * l] + g1 * H[3 * l + 1] + g2 * H[3 * l + 2]
            C[6 * k + l] = value + G[STRIDE * k + 6 + l] + share * s.R_c[k, l]


@fused
def _add_spread(P: Array, work: Array, s: Sensor) -> None:
    """C += second-order spread of the products (E-34)."""
    C, S = work[COV : COV + 36], work[SPREAD : SPREAD + 36]
    for a in range(6):
        i, j = FIRST[a], SECOND[a]
        for b in range(a + 1):
            k, l = FIRST[b], SECOND[b]
            S[6 * a + b] = S[6 * b + a] = (
                P[22 * i + k] * P[22 * j + l] + P[22 * i + l] * P[22 * j + k]
            )
    if s.plain:
        for k in range(6):
            for l in range(k + 1):
                C[6 * k + l] += S[6 * k + l]
        return
    for k in range(s.m):
        for l in range(k + 1):
            value = 0.0
            for a in range(6):
                for b in range(6):
                    value += s.M[k, a] * S[6 * a + b] * s.M[l, b]
            C[6 * k + l] += value


@fused
def by_force(
    x: Array,
    P: Array,
    work: Array,
    p: Three,
    alpha: Three,
    late: Three,
    turning: bool,
    s: Sensor,
    t: Tuning,
) -> tuple[float, float]:
    """Correct by gravity and the motion of the centre about its pivot (E-35); NIS and 1 / sqrt(det
    C).

    p: specific force of the centre, m/s^2; alpha: omega', rad/s^2, of this sample; late: its mean
    before. The Jacobian is that of `late`: alpha's noise in it would seem to say that the centre,
    which does not follow it, is on the axis.
    """
    if not turning:  # omega' is noise: it must not seem to measure the pivot
        alpha = late = (0.0, 0.0, 0.0)
    force_rows(x, P, work, p, late, s, 1.0)
    if turning:
        r0, r1, r2 = x[18], x[19], x[20]
        d0, d1, d2 = alpha[0] - late[0], alpha[1] - late[1], alpha[2] - late[2]
        work[RESIDUAL] -= d1 * r2 - d2 * r1
        work[RESIDUAL + 1] -= d2 * r0 - d0 * r2
        work[RESIDUAL + 2] -= d0 * r1 - d1 * r0
        doubt = P[23 * 18] + P[23 * 19] + P[23 * 20]
        noise = (r0 * r0 + r1 * r1 + r2 * r2 + doubt) * s.R_alpha[0, 0] + doubt * (
            d0 * d0 + d1 * d1 + d2 * d2
        )
        for k in range(3):
            work[COV + 7 * k] += t.centre + noise
    return absorb_three(x, P, work, t.force_gate)


@fused
def force_rows(
    x: Array, P: Array, work: Array, p: Three, alpha: Three, s: Sensor, share: float
) -> None:
    """H P, the lower triangle of H P H^T + share R_p, and the innovation of the specific force p
    (E-35).
    """
    w0, w1, w2, r0, r1, r2 = x[0], x[1], x[2], x[18], x[19], x[20]
    e0, e1, e2 = alpha
    wr, ww = w0 * r0 + w1 * r1 + w2 * r2, w0 * w0 + w1 * w1 + w2 * w2
    k00, k01, k02 = w0 * w0 - ww, w0 * w1 - e2, w0 * w2 + e1  # d p / d pivot
    k10, k11, k12 = w1 * w0 + e2, w1 * w1 - ww, w1 * w2 - e0
    k20, k21, k22 = w2 * w0 - e1, w2 * w1 + e0, w2 * w2 - ww
    h00, h01, h02 = wr - w0 * r0, w0 * r1 - 2.0 * r0 * w1, w0 * r2 - 2.0 * r0 * w2  # d p / d omega
    h10, h11, h12 = w1 * r0 - 2.0 * r1 * w0, wr - w1 * r1, w1 * r2 - 2.0 * r1 * w2
    h20, h21, h22 = w2 * r0 - 2.0 * r2 * w0, w2 * r1 - 2.0 * r2 * w1, wr - w2 * r2
    y0 = p[0] - x[12] - x[15] - k00 * r0 - k01 * r1 - k02 * r2
    y1 = p[1] - x[13] - x[16] - k10 * r0 - k11 * r1 - k12 * r2
    y2 = p[2] - x[14] - x[17] - k20 * r0 - k21 * r1 - k22 * r2
    if s.feedback:
        y0, h00, h01, h02 = _by_squares(s.SQ[3], w0, w1, w2, y0, h00, h01, h02)
        y1, h10, h11, h12 = _by_squares(s.SQ[4], w0, w1, w2, y1, h10, h11, h12)
        y2, h20, h21, h22 = _by_squares(s.SQ[5], w0, w1, w2, y2, h20, h21, h22)
    n, G = STRIDE, work
    a, b, c = PIVOT, PIVOT + 22, PIVOT + 44
    combine(G, 0, P, (U, B_F, 0, 22, 44, a, b, c), (1.0, 1.0, h00, h01, h02, k00, k01, k02))
    combine(
        G, n, P, (U + 22, B_F + 22, 0, 22, 44, a, b, c), (1.0, 1.0, h10, h11, h12, k10, k11, k12)
    )
    combine(
        G,
        2 * n,
        P,
        (U + 44, B_F + 44, 0, 22, 44, a, b, c),
        (1.0, 1.0, h20, h21, h22, k20, k21, k22),
    )
    h0, h1, h2 = (
        (h00, h01, h02, k00, k01, k02),
        (h10, h11, h12, k10, k11, k12),
        (h20, h21, h22, k20, k21, k22),
    )
    C, R = work[COV : COV + 36], s.R_p
    C[0], C[6] = _seen(G, 0, 0, h0) + share * R[0, 0], _seen(G, n, 0, h0) + share * R[1, 0]
    C[7], C[12] = _seen(G, n, 1, h1) + share * R[1, 1], _seen(G, 2 * n, 0, h0) + share * R[2, 0]
    C[13], C[14] = (
        _seen(G, 2 * n, 1, h1) + share * R[2, 1],
        _seen(G, 2 * n, 2, h2) + share * R[2, 2],
    )
    work[RESIDUAL], work[RESIDUAL + 1], work[RESIDUAL + 2] = y0, y1, y2


@fused
def _by_squares(
    q: Array, w0: float, w1: float, w2: float, y: float, h0: float, h1: float, h2: float
) -> tuple[float, float, float, float]:
    """y_k and its row of d p / d omega with what the products q . z add to p_k."""
    y -= (
        q[0] * w0 * w0
        + q[1] * w0 * w1
        + q[2] * w0 * w2
        + q[3] * w1 * w1
        + q[4] * w1 * w2
        + q[5] * w2 * w2
    )
    h0 += 2.0 * q[0] * w0 + q[1] * w1 + q[2] * w2
    h1 += q[1] * w0 + 2.0 * q[3] * w1 + q[4] * w2
    return y, h0, h1, h2 + q[2] * w0 + q[4] * w1 + 2.0 * q[5] * w2


@fused
def _seen(G: Array, row: int, l: int, h: tuple[float, float, float, float, float, float]) -> float:
    """Element of H P H^T: row of H P times row l of H, whose parts for omega and the pivot are
    h.
    """
    value = (
        G[row + 12 + l] + G[row + 15 + l] + h[0] * G[row] + h[1] * G[row + 1] + h[2] * G[row + 2]
    )
    return value + h[3] * G[row + 18] + h[4] * G[row + 19] + h[5] * G[row + 20]


@fused
def by_standstill(
    x: Array, P: Array, work: Array, alpha_m: Three, earth_b: Three, s: Sensor, t: Tuning
) -> None:
    """omega is the Earth's and omega' is bias (E-38)."""
    standstill_rows(P, work, s, t.still_rate, 1.0)
    for i in range(3):
        work[RESIDUAL + i], work[RESIDUAL + 3 + i] = earth_b[i] - x[i], alpha_m[i] - x[3 + i]
    absorb_six(x, P, work, np.inf)


@fused
def standstill_rows(P: Array, work: Array, s: Sensor, rate: float, share: float) -> None:
    """H P and the lower triangle of H P H^T + R of a standstill, R of `rate` and of share
    R_alpha.
    """
    C = work[COV : COV + 36]
    for i in range(6):
        combine(work, ROWS + STRIDE * i, P, (STATES * i,), (1.0,))
        for j in range(i + 1):
            C[6 * i + j] = P[22 * i + j]
    for i in range(3):
        C[7 * i] += rate
        for j in range(i + 1):
            C[6 * (3 + i) + 3 + j] += share * s.R_alpha[i, j]
