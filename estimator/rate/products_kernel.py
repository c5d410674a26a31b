"""One step of the products filter, compiled, without a copy: prediction, products, gravity, standstill, navigation.

Model and equations: products_model.py (E-30 to E-39). The functions here are the same with their zeros left out; a test
compares them. All state of one filter is one flat array, so that it can be put aside and taken back:

    x (22) | P (22 x 22) | q_nb (4) v_n (3) p_n (3) alpha_m (3) force_n (3) sign_variance
    | biases at rest (12), their variances, those now by scale errors | readings at rest (N)
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from estimator.attitude.rotation import from_rotation_vector, to_dcm
from estimator.rate.observed import MOST_AXES, Sensor
from estimator.rate.products_model import FIRST, SECOND, STATES

Array = NDArray[np.float64]

GRAVITY = 9.80665  # m/s^2, standard
PP = STATES + STATES * STATES  # where navigation begins
Q_NB, V_N, P_N, ALPHA, FORCE, SIGN = PP, PP + 4, PP + 7, PP + 10, PP + 13, PP + 16
REST_BIAS, REST_VARIANCE, LEVEL, REST = PP + 17, PP + 29, PP + 41, PP + 53
SIZE = REST + MOST_AXES
# of the output of a step
INNOVATION, SIGMA, NIS, USED, FORCE_NIS, FORCE_USED, LIKELIHOOD, OUT = 0, 6, 12, 13, 14, 15, 16, 17
EKF, UKF, FORGET, HORIZON = range(4)


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
            ("axis", "f8"),  # (rad/s)^2 per s, what omega across a fixed axis may wander; 0: no axis is fixed
            ("axis_from", "f8"),  # (rad/s)^2, of |omega|^2: above it a body may be on a fixed axis
            ("axis_limit", "f8"),  # chi-square
            ("axis_lost", "f8"),  # (rad/s)^2
            ("earth_north", "f8"),  # rad/s
            ("earth_down", "f8"),
        ],
    )
)
Tuning = np.record


@njit(cache=True, error_model="numpy")
def absorb(x: Array, P: Array, HP: Array, C: Array, y: Array, k: int, gate: float) -> tuple[float, float]:
    """Kalman correction in place by k innovations y of covariance C, HP = H P (k, 22): NIS and log det C (E-39).

    HP has a multiple of three rows, those above k zero. C is replaced by its Cholesky factor, HP by L^-1 H P. An
    innovation beyond the gate changes nothing else.
    """
    logdet, nis, n = 0.0, 0.0, len(x)
    for i in range(k):
        for j in range(i + 1):
            value = C[i, j]
            for l in range(j):
                value -= C[i, l] * C[j, l]
            C[i, j] = np.sqrt(value) if i == j else value / C[j, j]
        logdet += 2.0 * np.log(C[i, i])
    for i in range(k):
        for l in range(i):
            y[i] -= C[i, l] * y[l]
        y[i] /= C[i, i]
        nis += y[i] * y[i]
    if not nis <= gate:
        return nis, logdet
    for i in range(k):
        for l in range(i):
            f = C[i, l]
            for j in range(n):
                HP[i, j] -= f * HP[l, j]
        f = 1.0 / C[i, i]
        for j in range(n):
            HP[i, j] *= f
            x[j] += HP[i, j] * y[i]
    for i in range(0, k, 3):  # three at a time: one pass over P for each three
        for r in range(n):
            f, g, h = HP[i, r], HP[i + 1, r], HP[i + 2, r]
            for j in range(n):
                P[r, j] -= f * HP[i, j] + g * HP[i + 1, j] + h * HP[i + 2, j]
    return nis, logdet


@njit(cache=True, error_model="numpy")
def along_axis(x: Array, fixed: bool, turning: bool) -> Array:
    """Projection (3, 3) of omega' that is integrated: all of it, none at rest, along omega on a fixed axis (E-45)."""
    N = np.zeros((3, 3))
    square = x[0] * x[0] + x[1] * x[1] + x[2] * x[2]
    for i in range(3):
        if turning and fixed:
            for j in range(3):
                N[i, j] = x[i] * x[j] / square
        elif turning:
            N[i, i] = 1.0
    return N


@njit(cache=True, error_model="numpy")
def predict(x: Array, P: Array, alpha_m: Array, N: Array, dt: float, turning: bool, s: Sensor, earth_b: Array) -> None:
    """E-31 and E-32 in place, without process noise; N (3, 3) of omega' is integrated."""
    n = len(x)
    A, D = np.eye(3), dt * N
    w0, w1, w2 = x[0], x[1], x[2]
    if turning:
        alpha = alpha_m - x[3:6]
        if s.feedback:
            for i in range(3):
                for k in range(6):
                    wi, wj = (w0, w1, w2)[FIRST[k]], (w0, w1, w2)[SECOND[k]]
                    alpha[i] -= s.SQ[i, k] * wi * wj
                    A[i, FIRST[k]] -= dt * s.SQ[i, k] * wj
                    A[i, SECOND[k]] -= dt * s.SQ[i, k] * wi
        if N[0, 0] + N[1, 1] + N[2, 2] < 2.0:  # on a fixed axis a wrong direction grows with omega
            growth = dt * (alpha[0] * w0 + alpha[1] * w1 + alpha[2] * w2) / (w0 * w0 + w1 * w1 + w2 * w2)
            for i in range(3):
                for j in range(3):
                    A[i, j] += growth * ((1.0 if i == j else 0.0) - N[i, j])
        for i in range(3):
            x[i] += D[i, 0] * alpha[0] + D[i, 1] * alpha[1] + D[i, 2] * alpha[2]
    turn = np.empty(3)
    turn[0] = -dt * (0.5 * (w0 + x[0]) - earth_b[0])
    turn[1] = -dt * (0.5 * (w1 + x[1]) - earth_b[1])
    turn[2] = -dt * (0.5 * (w2 + x[2]) - earth_b[2])
    x[21] += 0.5 * dt * (w2 + x[2])
    C = to_dcm(from_rotation_vector(turn))
    u0, u1, u2 = x[12], x[13], x[14]
    for i in range(3):
        x[12 + i] = C[i, 0] * u0 + C[i, 1] * u1 + C[i, 2] * u2
    # dt [u x] with u between the samples: right to second order in the turn of one sample
    t0, t1, t2 = 0.5 * dt * (u0 + x[12]), 0.5 * dt * (u1 + x[13]), 0.5 * dt * (u2 + x[14])
    for j in range(n):  # F P, then (F P) F^T
        _line(P[:, j], C, A, D, t0, t1, t2, dt, turning)
    for j in range(n):
        _line(P[j], C, A, D, t0, t1, t2, dt, turning)


@njit(cache=True, error_model="numpy")
def _line(v: Array, C: Array, A: Array, D: Array, t0: float, t1: float, t2: float, dt: float, turning: bool) -> None:
    """F v in place, (22,)."""
    back = 0.5 * dt if turning else 0.0
    a0, a1, a2 = v[0] - back * v[3], v[1] - back * v[4], v[2] - back * v[5]
    v0, v1, v2 = v[12], v[13], v[14]
    v[21] += dt * a2
    v[12] = C[0, 0] * v0 + C[0, 1] * v1 + C[0, 2] * v2 - t2 * a1 + t1 * a2
    v[13] = C[1, 0] * v0 + C[1, 1] * v1 + C[1, 2] * v2 + t2 * a0 - t0 * a2
    v[14] = C[2, 0] * v0 + C[2, 1] * v1 + C[2, 2] * v2 - t1 * a0 + t0 * a1
    if turning:
        b0, b1, b2 = v[0], v[1], v[2]
        v[0] = A[0, 0] * b0 + A[0, 1] * b1 + A[0, 2] * b2 - D[0, 0] * v[3] - D[0, 1] * v[4] - D[0, 2] * v[5]
        v[1] = A[1, 0] * b0 + A[1, 1] * b1 + A[1, 2] * b2 - D[1, 0] * v[3] - D[1, 1] * v[4] - D[1, 2] * v[5]
        v[2] = A[2, 0] * b0 + A[2, 1] * b1 + A[2, 2] * b2 - D[2, 0] * v[3] - D[2, 1] * v[4] - D[2, 2] * v[5]


@njit(cache=True, error_model="numpy")
def add_noise(P: Array, N: Array, dt: float, turning: bool, s: Sensor, t: Tuning) -> None:
    """What one step adds to P but for the biases: omega' noise and the pivot's walk."""
    for i in range(3):
        P[18 + i, 18 + i] += t.pivot_drift * dt
        if not turning:
            continue
        for j in range(3):
            P[i, j] -= t.axis * dt * N[i, j]
            for k in range(3):
                for l in range(3):
                    P[i, j] += dt * dt * N[i, k] * s.R_alpha[k, l] * N[j, l]
        P[i, i] += t.axis * dt


@njit(cache=True, error_model="numpy")
def products_jacobian(omega: Array, s: Sensor, H: Array) -> None:
    """H (6, 3) = M dz/domega (E-33)."""
    H[:, :] = 0.0
    for k in range(6):
        i, j = FIRST[k], SECOND[k]
        if s.plain:
            H[k, i] += omega[j]
            H[k, j] += omega[i]
        else:
            for r in range(s.m):
                H[r, i] += s.M[r, k] * omega[j]
                H[r, j] += s.M[r, k] * omega[i]


@njit(cache=True, error_model="numpy")
def products_covariance(P: Array, H: Array, HP: Array, C: Array, s: Sensor) -> None:
    """HP = H P (6, 22) and C = H P H^T + R_c + second-order spread (6, 6) (E-34)."""
    n = P.shape[0]
    for k in range(s.m):
        h0, h1, h2 = H[k, 0], H[k, 1], H[k, 2]
        for j in range(n):
            HP[k, j] = h0 * P[0, j] + h1 * P[1, j] + h2 * P[2, j] + P[6 + k, j]
    spread = np.empty((6, 6))
    for a in range(6):
        for b in range(a + 1):
            i, j, k, l = FIRST[a], SECOND[a], FIRST[b], SECOND[b]
            spread[a, b] = spread[b, a] = P[i, k] * P[j, l] + P[i, l] * P[j, k]
    for k in range(s.m):
        for l in range(k + 1):
            value = HP[k, 0] * H[l, 0] + HP[k, 1] * H[l, 1] + HP[k, 2] * H[l, 2] + HP[k, 6 + l] + s.R_c[k, l]
            if s.plain:
                value += spread[k, l]
            else:
                for a in range(6):
                    for b in range(6):
                        value += s.M[k, a] * spread[a, b] * s.M[l, b]
            C[k, l] = C[l, k] = value


@njit(cache=True, error_model="numpy")
def by_products(x: Array, P: Array, c_m: Array, at: Array, s: Sensor, t: Tuning, out: Array) -> tuple[float, float]:
    """Correct by the observed combinations of the products, linear about omega = at (3,) (E-33, E-34); NIS, log det."""
    if s.m == 0:
        return 0.0, 0.0
    H, HP, C, y = np.empty((6, 3)), np.zeros((6, len(x))), np.empty((6, 6)), np.zeros(6)
    products_jacobian(at, s, H)
    products_covariance(P, H, HP, C, s)
    for r in range(s.m):
        y[r] = c_m[r] - x[6 + r]
        for k in range(6):
            if s.M[r, k] != 0.0:
                i, j = FIRST[k], SECOND[k]
                z = at[i] * x[j] + at[j] * x[i] - at[i] * at[j]
                y[r] -= s.M[r, k] * (z + P[i, j])
        out[INNOVATION + r], out[SIGMA + r] = y[r], np.sqrt(C[r, r])
    return absorb(x, P, HP, C, y, s.m, t.products_gate)


@njit(cache=True, error_model="numpy")
def force_jacobian(x: Array, alpha: Array, s: Sensor, H_omega: Array, H_pivot: Array) -> None:
    """d p_m / d omega and d pivot, both (3, 3) (E-35)."""
    w, r = x[0:3], x[18:21]
    wr, ww = w[0] * r[0] + w[1] * r[1] + w[2] * r[2], w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
    for i in range(3):
        for j in range(3):
            H_omega[i, j] = w[i] * r[j] - 2.0 * r[i] * w[j]
            H_pivot[i, j] = w[i] * w[j]
        H_omega[i, i] += wr
        H_pivot[i, i] -= ww
    H_pivot[0, 1] -= alpha[2]
    H_pivot[0, 2] += alpha[1]
    H_pivot[1, 0] += alpha[2]
    H_pivot[1, 2] -= alpha[0]
    H_pivot[2, 0] -= alpha[1]
    H_pivot[2, 1] += alpha[0]
    if s.feedback:
        for k in range(6):
            for i in range(3):
                H_omega[i, FIRST[k]] += s.SQ[3 + i, k] * w[SECOND[k]]
                H_omega[i, SECOND[k]] += s.SQ[3 + i, k] * w[FIRST[k]]


@njit(cache=True, error_model="numpy")
def by_force(x: Array, P: Array, p_m: Array, alpha: Array, turning: bool, s: Sensor, t: Tuning) -> tuple[float, float]:
    """Correct by gravity and the motion of the centre about its pivot (E-35); NIS and log det."""
    n = len(x)
    Ho, Hr, HP, C, y = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, n)), np.empty((3, 3)), np.empty(3)
    # at rest omega' is noise: it must not seem to measure the pivot
    force_jacobian(x, alpha if turning else np.zeros(3), s, Ho, Hr)
    arm = x[18] * x[18] + x[19] * x[19] + x[20] * x[20] + P[18, 18] + P[19, 19] + P[20, 20]
    more = t.centre + arm * s.R_alpha[0, 0] if turning else 0.0
    for k in range(3):
        for j in range(n):
            HP[k, j] = P[12 + k, j] + P[15 + k, j]
            for i in range(3):
                HP[k, j] += Ho[k, i] * P[i, j] + Hr[k, i] * P[18 + i, j]
        y[k] = p_m[k] - x[12 + k] - x[15 + k] - Hr[k, 0] * x[18] - Hr[k, 1] * x[19] - Hr[k, 2] * x[20]
        if s.feedback:
            for l in range(6):
                y[k] -= s.SQ[3 + k, l] * x[FIRST[l]] * x[SECOND[l]]
    for k in range(3):
        for l in range(k + 1):
            value = HP[k, 12 + l] + HP[k, 15 + l] + s.R_p[k, l] + (more if k == l else 0.0)
            for i in range(3):
                value += HP[k, i] * Ho[l, i] + HP[k, 18 + i] * Hr[l, i]
            C[k, l] = C[l, k] = value
    return absorb(x, P, HP, C, y, 3, t.force_gate)


@njit(cache=True, error_model="numpy")
def by_standstill(x: Array, P: Array, alpha_m: Array, earth_b: Array, s: Sensor, t: Tuning) -> None:
    """omega is the Earth's and omega' is bias (E-38)."""
    HP, C, y = np.empty((6, len(x))), np.zeros((6, 6)), np.empty(6)
    HP[:, :] = P[0:6, :]
    for i in range(3):
        y[i], y[3 + i] = earth_b[i] - x[i], alpha_m[i] - x[3 + i]
        for j in range(3):
            C[3 + i, 3 + j] = s.R_alpha[i, j]
        C[i, i] = t.still_rate
    C += P[0:6, 0:6]
    absorb(x, P, HP, C, y, 6, np.inf)
