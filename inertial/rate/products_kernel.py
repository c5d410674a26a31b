"""State of one products filter as one flat array; its prediction and its correction, compiled,
without a new array.

Model and equations: products_model.py (E-30 to E-39). The functions here are the same with their
zeros left out; a test compares them. Corrections: products_correct.py. One flat array can be put
aside and taken back:

    x (22) | P (22 x 22) | q_nb (4) v_n (3) p_n (3) alpha_m (3) force_n (3) sign_variance
    | biases at rest (12), their variances, those now by scale errors | readings at rest (N) | alpha_m of late (3)

P is handed on flat, (484,), row by row, and stays symmetric to the bit. Loops run along its rows,
which the compiler turns into vector instructions; small matrices are tuples, which it keeps in
registers.
"""

import numpy as np
from numpy.typing import NDArray

from inertial.rate.compiling import fused
from inertial.rate.observed import MOST_AXES, Sensor
from inertial.rate.products_model import STATES
from inertial.rate.turns import turn_matrix
from inertial.rate.vectors import add, combine, take_out

Array = NDArray[np.float64]
Three = tuple[float, float, float]
Six = tuple[float, float, float, float, float, float]
Nine = tuple[float, float, float, float, float, float, float, float, float]

GRAVITY = 9.80665  # m/s^2, standard
PP = STATES + STATES * STATES  # where navigation begins
Q_NB, V_N, P_N, ALPHA, FORCE, SIGN = PP, PP + 4, PP + 7, PP + 10, PP + 13, PP + 16
REST_BIAS, REST_VARIANCE, LEVEL, REST = PP + 17, PP + 29, PP + 41, PP + 53
LATE = REST + MOST_AXES
SIZE = LATE + 3
# of the output of a step
INNOVATION, SIGMA, NIS, USED, FORCE_NIS, FORCE_USED, MISFIT, DENSITY, OUT = (
    0,
    6,
    12,
    13,
    14,
    15,
    16,
    17,
    18,
)
EKF, UKF, FORGET, HORIZON = range(4)
# rows of P in (484,): of omega, b_alpha, b_c, u, b_f, the pivot, the angle
OMEGA, B_ALPHA, B_C, U, B_F, PIVOT, TURNED = 0, 66, 132, 264, 330, 396, 462
# of the workspace of one filter: seven rows, as of H P, one every 24 numbers (a distance of whole
# vectors: rows can be worked on side by side); C (6 x 6), H (6 x 3), spread (6 x 6), y (6), x and P
# of before
STRIDE = 24
ROWS, COV, JACOBIAN, SPREAD, RESIDUAL, BEFORE = 0, 168, 204, 222, 258, 264
WORK = BEFORE + PP
THREE, SIX = (0, 24, 48), (0, 24, 48, 72, 96, 120)  # rows of the workspace
MOVING = (0, 22, 44, 66, 88, 110)  # rows of P of omega and b_alpha


# Numbers of products_ekf.Config for compiled functions; variances.
TUNING = np.dtype(
    (
        np.record,
        [
            ("method", "i8"),  # EKF, UKF, FORGET or HORIZON
            ("scale", "f8"),
            ("drift", "f8"),  # (m/s^2)^2 per s
            ("centre", "f8"),
            ("pivot_drift", "f8"),  # m^2 per s
            ("still_rate", "f8"),
            ("products_gate", "f8"),
            ("force_gate", "f8"),
            ("unseen_alpha", "f8"),
            ("forget", "f8"),  # 1/s; of FORGET only
            ("bias", "f8"),  # of one axis before the first standstill
            ("tilt", "f8"),
            ("gravity", "f8"),
            ("pivot", "f8"),
            ("centre_sees", "i8"),  # gravity corrects
            ("start_turning", "f8"),  # of the largest product over its variance
            (
                "axis",
                "f8",
            ),  # (rad/s)^2 per s, what omega across a fixed axis may wander; 0: no axis is fixed
            ("axis_from", "f8"),  # (rad/s)^2, of |omega|^2: above it a body may be on a fixed axis
            ("axis_limit", "f8"),  # chi-square
            ("axis_lost", "f8"),  # (rad/s)^2
            ("earth_north", "f8"),  # rad/s
            ("earth_down", "f8"),
        ],
    )
)
Tuning = np.record


@fused
def factor(c00: float, c10: float, c11: float, c20: float, c21: float, c22: float) -> Six:
    """Cholesky factor of a symmetric matrix: 1 / l00, l10, 1 / l11, l20, l21, 1 / l22; not a number
    without one.
    """
    i0 = 1.0 / np.sqrt(c00)
    l10, l20 = c10 * i0, c20 * i0
    i1 = 1.0 / np.sqrt(c11 - l10 * l10)
    l21 = (c21 - l20 * l10) * i1
    return i0, l10, i1, l20, l21, 1.0 / np.sqrt(c22 - l20 * l20 - l21 * l21)


@fused
def solve(f: Six, y0: float, y1: float, y2: float) -> Three:
    """L^-1 y."""
    i0, l10, i1, l20, l21, i2 = f
    w0 = y0 * i0
    w1 = (y1 - l10 * w0) * i1
    return w0, w1, (y2 - l20 * w0 - l21 * w1) * i2


@fused
def _substitute(G: Array, at: int, f: Six) -> None:
    """L^-1 of the three rows of G that begin at `at`."""
    i0, l10, i1, l20, l21, i2 = f
    one, two = at + STRIDE, at + 2 * STRIDE
    combine(G, at, G, (at,), (i0,))
    combine(G, one, G, (one, at), (i1, -i1 * l10))
    combine(G, two, G, (two, at, one), (i2, -i2 * l20, -i2 * l21))


@fused
def absorb_three(x: Array, P: Array, work: Array, gate: float) -> tuple[float, float]:
    """Kalman correction in place by three innovations: NIS and 1 / sqrt(det C) (E-39).

    work holds H P, C and y. An innovation beyond the gate changes nothing else.
    """
    c, y = COV, RESIDUAL
    f = factor(work[c], work[c + 6], work[c + 7], work[c + 12], work[c + 13], work[c + 14])
    y0, y1, y2 = solve(f, work[y], work[y + 1], work[y + 2])
    nis, density = y0 * y0 + y1 * y1 + y2 * y2, f[0] * f[2] * f[5]
    if not nis <= gate:
        return nis, density
    _substitute(work, 0, f)
    add(x, 0, work, THREE, (y0, y1, y2))
    take_out(P, work, THREE)
    return nis, density


@fused
def absorb_six(x: Array, P: Array, work: Array, gate: float) -> tuple[float, float]:
    """The same by six innovations, in two blocks of three. A row of zeros with C = 1 and y = 0 says
    nothing.
    """
    c, y = COV, RESIDUAL
    f = factor(work[c], work[c + 6], work[c + 7], work[c + 12], work[c + 13], work[c + 14])
    y0, y1, y2 = solve(f, work[y], work[y + 1], work[y + 2])
    b00, b01, b02 = solve(f, work[c + 18], work[c + 19], work[c + 20])
    b10, b11, b12 = solve(f, work[c + 24], work[c + 25], work[c + 26])
    b20, b21, b22 = solve(f, work[c + 30], work[c + 31], work[c + 32])
    h = factor(
        work[c + 21] - b00 * b00 - b01 * b01 - b02 * b02,
        work[c + 27] - b10 * b00 - b11 * b01 - b12 * b02,
        work[c + 28] - b10 * b10 - b11 * b11 - b12 * b12,
        work[c + 33] - b20 * b00 - b21 * b01 - b22 * b02,
        work[c + 34] - b20 * b10 - b21 * b11 - b22 * b12,
        work[c + 35] - b20 * b20 - b21 * b21 - b22 * b22,
    )
    y3, y4, y5 = solve(
        h,
        work[y + 3] - b00 * y0 - b01 * y1 - b02 * y2,
        work[y + 4] - b10 * y0 - b11 * y1 - b12 * y2,
        work[y + 5] - b20 * y0 - b21 * y1 - b22 * y2,
    )
    nis = y0 * y0 + y1 * y1 + y2 * y2 + y3 * y3 + y4 * y4 + y5 * y5
    density = f[0] * f[2] * f[5] * h[0] * h[2] * h[5]
    if not nis <= gate:
        return nis, density
    G, n = work, STRIDE
    _substitute(G, 0, f)
    add(G, 3 * n, G, THREE, (-b00, -b01, -b02))
    add(G, 4 * n, G, THREE, (-b10, -b11, -b12))
    add(G, 5 * n, G, THREE, (-b20, -b21, -b22))
    _substitute(G, 3 * n, h)
    add(x, 0, G, SIX, (y0, y1, y2, y3, y4, y5))
    take_out(P, G, SIX)
    return nis, density


@fused
def along_axis(w0: float, w1: float, w2: float, fixed: bool, turning: bool) -> Six:
    """Projection N (symmetric: 00 01 02 11 12 22) of omega' that is integrated (E-45).

    All of it, none at rest, only that along omega (rad/s) on a fixed axis.
    """
    if not turning:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    if not fixed:
        return 1.0, 0.0, 0.0, 1.0, 0.0, 1.0
    f = 1.0 / (w0 * w0 + w1 * w1 + w2 * w2)
    return f * w0 * w0, f * w0 * w1, f * w0 * w2, f * w1 * w1, f * w1 * w2, f * w2 * w2


@fused
def predict(
    x: Array,
    P: Array,
    work: Array,
    alpha_m: Three,
    N: Six,
    dt: float,
    turning: bool,
    s: Sensor,
    earth_b: Three,
) -> None:
    """E-31 and E-32 in place, without process noise; N of omega' is integrated."""
    n00, n01, n02, n11, n12, n22 = N
    a00, a01, a02, a10, a11, a12, a20, a21, a22 = 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0
    d00, d01, d02, d11, d12, d22 = dt * n00, dt * n01, dt * n02, dt * n11, dt * n12, dt * n22
    w0, w1, w2 = x[0], x[1], x[2]
    if turning:
        e0, e1, e2 = alpha_m[0] - x[3], alpha_m[1] - x[4], alpha_m[2] - x[5]
        if s.feedback:
            e0, a00, a01, a02 = _feedback(s, 0, w0, w1, w2, dt, e0, a00, a01, a02)
            e1, a10, a11, a12 = _feedback(s, 1, w0, w1, w2, dt, e1, a10, a11, a12)
            e2, a20, a21, a22 = _feedback(s, 2, w0, w1, w2, dt, e2, a20, a21, a22)
        if n00 + n11 + n22 < 2.0:  # on a fixed axis a wrong direction grows with omega
            growth = dt * (e0 * w0 + e1 * w1 + e2 * w2) / (w0 * w0 + w1 * w1 + w2 * w2)
            a00, a01, a02 = a00 + growth * (1.0 - n00), a01 - growth * n01, a02 - growth * n02
            a10, a11, a12 = a10 - growth * n01, a11 + growth * (1.0 - n11), a12 - growth * n12
            a20, a21, a22 = a20 - growth * n02, a21 - growth * n12, a22 + growth * (1.0 - n22)
        x[0] += d00 * e0 + d01 * e1 + d02 * e2
        x[1] += d01 * e0 + d11 * e1 + d12 * e2
        x[2] += d02 * e0 + d12 * e1 + d22 * e2
    x[21] += 0.5 * dt * (w2 + x[2])
    C = turn_matrix(
        -dt * (0.5 * (w0 + x[0]) - earth_b[0]),
        -dt * (0.5 * (w1 + x[1]) - earth_b[1]),
        -dt * (0.5 * (w2 + x[2]) - earth_b[2]),
    )
    u0, u1, u2 = x[12], x[13], x[14]
    x[12] = C[0] * u0 + C[1] * u1 + C[2] * u2
    x[13] = C[3] * u0 + C[4] * u1 + C[5] * u2
    x[14] = C[6] * u0 + C[7] * u1 + C[8] * u2
    # dt [u x] with u between the samples: right to second order in the turn of one sample
    t = (0.5 * dt * (u0 + x[12]), 0.5 * dt * (u1 + x[13]), 0.5 * dt * (u2 + x[14]))
    A, D = (a00, a01, a02, a10, a11, a12, a20, a21, a22), (d00, d01, d02, d11, d12, d22)
    _turn_covariance(P, work, A, D, C, t, dt, 0.5 * dt if turning else 0.0)


@fused
def _feedback(
    s: Sensor,
    i: int,
    w0: float,
    w1: float,
    w2: float,
    dt: float,
    e: float,
    a0: float,
    a1: float,
    a2: float,
) -> tuple[float, float, float, float]:
    """omega'_i and its row of A less what the products add to it."""
    q = s.SQ[i]
    e -= (
        q[0] * w0 * w0
        + q[1] * w0 * w1
        + q[2] * w0 * w2
        + q[3] * w1 * w1
        + q[4] * w1 * w2
        + q[5] * w2 * w2
    )
    a0 -= dt * (2.0 * q[0] * w0 + q[1] * w1 + q[2] * w2)
    a1 -= dt * (q[1] * w0 + 2.0 * q[3] * w1 + q[4] * w2)
    return e, a0, a1, a2 - dt * (q[2] * w0 + q[4] * w1 + 2.0 * q[5] * w2)


@fused
def _turn_covariance(
    P: Array, G: Array, A: Nine, D: Six, C: Nine, t: Three, dt: float, back: float
) -> None:
    """P = F P F^T in place. F differs from the identity in seven rows: of omega, u and the angle.

    G (rows every 24) becomes those rows of F P, then of F P F^T; they go into P as rows and as
    columns.
    """
    t0, t1, t2 = t
    b0, b1, b2 = back * t0, back * t1, back * t2
    combine(G, 0, P, MOVING, (A[0], A[1], A[2], -D[0], -D[1], -D[2]))
    combine(G, 24, P, MOVING, (A[3], A[4], A[5], -D[1], -D[3], -D[4]))
    combine(G, 48, P, MOVING, (A[6], A[7], A[8], -D[2], -D[4], -D[5]))
    combine(G, 72, P, (U, U + 22, U + 44, 22, 44, 88, 110), (C[0], C[1], C[2], -t2, t1, b2, -b1))
    combine(G, 96, P, (U, U + 22, U + 44, 0, 44, 66, 110), (C[3], C[4], C[5], t2, -t0, -b2, b0))
    combine(G, 120, P, (U, U + 22, U + 44, 0, 22, 66, 88), (C[6], C[7], C[8], -t1, t0, b1, -b0))
    combine(G, 144, P, (TURNED, 44, 110), (1.0, dt, -dt * back))
    for r in range(0, 168, 24):
        p0, p1, p2, p3, p4, p5 = G[r], G[r + 1], G[r + 2], G[r + 3], G[r + 4], G[r + 5]
        q0, q1, q2, u0, u1, u2 = (
            p0 - back * p3,
            p1 - back * p4,
            p2 - back * p5,
            G[r + 12],
            G[r + 13],
            G[r + 14],
        )
        G[r] = A[0] * p0 + A[1] * p1 + A[2] * p2 - D[0] * p3 - D[1] * p4 - D[2] * p5
        G[r + 1] = A[3] * p0 + A[4] * p1 + A[5] * p2 - D[1] * p3 - D[3] * p4 - D[4] * p5
        G[r + 2] = A[6] * p0 + A[7] * p1 + A[8] * p2 - D[2] * p3 - D[4] * p4 - D[5] * p5
        G[r + 12] = C[0] * u0 + C[1] * u1 + C[2] * u2 - t2 * q1 + t1 * q2
        G[r + 13] = C[3] * u0 + C[4] * u1 + C[5] * u2 + t2 * q0 - t0 * q2
        G[r + 14] = C[6] * u0 + C[7] * u1 + C[8] * u2 - t1 * q0 + t0 * q1
        G[r + 21] += dt * q2
    for i in range(
        7
    ):  # the lower triangle of those seven rows last: it is the transpose of the upper one
        k = 6 - i
        row = k if k < 3 else 9 + k if k < 6 else 21
        combine(P, 22 * row, G, (24 * k,), (1.0,))
        for j in range(STATES):
            P[22 * j + row] = G[24 * k + j]


@fused
def add_noise(P: Array, N: Six, dt: float, turning: bool, s: Sensor, t: Tuning) -> None:
    """What one step adds to P but for the biases: omega' noise along N, omega's wander across it,
    the pivot's walk.
    """
    for i in range(18, 21):
        P[23 * i] += t.pivot_drift * dt
    if not turning:
        return
    R, f = s.R_alpha, dt * dt
    if N[0] + N[3] + N[5] < 2.0:  # N is of rank one: N R N = tr(N R) N
        q = N[0] * R[0, 0] + N[3] * R[1, 1] + N[5] * R[2, 2]
        q += 2.0 * (N[1] * R[0, 1] + N[2] * R[0, 2] + N[4] * R[1, 2])
        g, w = f * q - t.axis * dt, t.axis * dt
        r00, r01, r02, r11, r12, r22 = (
            g * N[0] + w,
            g * N[1],
            g * N[2],
            g * N[3] + w,
            g * N[4],
            g * N[5] + w,
        )
    else:
        r00, r01, r02 = f * R[0, 0], f * R[0, 1], f * R[0, 2]
        r11, r12, r22 = f * R[1, 1], f * R[1, 2], f * R[2, 2]
    P[0] += r00
    P[1] += r01
    P[2] += r02
    P[22] += r01
    P[23] += r11
    P[24] += r12
    P[44] += r02
    P[45] += r12
    P[46] += r22
