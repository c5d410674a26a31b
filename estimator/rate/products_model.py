"""Model of the products filter: its state, how it moves, what it predicts; every Jacobian beside its function.

    x = [ omega (3) rad/s | b_alpha (3) rad/s^2 | b_w (6) (rad/s)^2 | u (3) m/s^2 | b_f (3) m/s^2 ]     (E-30)

    omega' = alpha_m - b_alpha               alpha_m, w_m, p_m: the field's omega', products and p (E-4)
    u'     = -omega x u                      u: specific force of a body at rest, gravity's reaction in b
    w_m    = w_i w_j + b_w
    p_m    = u + b_f                         where the centre does not accelerate

b_alpha, b_w, b_f: what axis biases add to the field. Compiled; no time of day, no files.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from estimator.attitude.rotation import from_rotation_vector, skew, to_dcm

Array = NDArray[np.float64]

STATES = 18
OMEGA, B_ALPHA, B_W, U, B_F = slice(0, 3), slice(3, 6), slice(6, 12), slice(12, 15), slice(15, 18)
FIRST = np.array([0, 0, 0, 1, 1, 2])  # i and j of w_i w_j, in the order of layout.PRODUCTS
SECOND = np.array([0, 1, 2, 1, 2, 2])


@njit(cache=True)
def transition(x: Array, alpha_m: Array, dt: float, turning: bool) -> Array:
    """State after dt (s) with mean measured omega' alpha_m (3,) (E-31); a body known to be still keeps its rate."""
    y = x.copy()
    if turning:
        y[0:3] += dt * (alpha_m - x[3:6])
    middle = 0.5 * (x[0:3] + y[0:3])
    y[12:15] = to_dcm(from_rotation_vector(-dt * middle)) @ x[12:15]
    return y


@njit(cache=True)
def transition_jacobian(x: Array, y: Array, dt: float, turning: bool) -> Array:
    """d transition / dx, (18, 18), at x with result y; to first order in the turn of one sample (E-32)."""
    F = np.eye(STATES)
    middle = 0.5 * (x[0:3] + y[0:3])
    # u between the samples: the turn's effect is then right to second order
    turned = dt * skew(0.5 * (x[12:15] + y[12:15]))
    F[12:15, 12:15] = to_dcm(from_rotation_vector(-dt * middle))
    F[12:15, 0:3] = turned
    if turning:
        for i in range(3):
            F[i, 3 + i] = -dt
        F[12:15, 3:6] = -0.5 * dt * turned
    return F


@njit(cache=True)
def measured_products(x: Array) -> Array:
    """w_m predicted by x, (6,), (rad/s)^2, without the spread of omega (E-33)."""
    z = np.empty(6)
    for k in range(6):
        z[k] = x[FIRST[k]] * x[SECOND[k]] + x[6 + k]
    return z


@njit(cache=True)
def products_jacobian(x: Array) -> Array:
    """d measured_products / dx, (6, 18)."""
    H = np.zeros((6, STATES))
    for k in range(6):
        H[k, FIRST[k]] += x[SECOND[k]]
        H[k, SECOND[k]] += x[FIRST[k]]
        H[k, 6 + k] = 1.0
    return H


@njit(cache=True)
def products_spread(P: Array) -> tuple[Array, Array]:
    """Mean (6,) and covariance (6, 6) that the spread of omega adds to its products (E-34).

    For Gaussian errors e of covariance P: E e_i e_j = P_ij; cov(e_i e_j, e_k e_l) = P_ik P_jl + P_il P_jk.
    """
    mean, covariance = np.empty(6), np.empty((6, 6))
    for a in range(6):
        i, j = FIRST[a], SECOND[a]
        mean[a] = P[i, j]
        for b in range(6):
            k, l = FIRST[b], SECOND[b]
            covariance[a, b] = P[i, k] * P[j, l] + P[i, l] * P[j, k]
    return mean, covariance


@njit(cache=True)
def measured_force(x: Array) -> Array:
    """p_m predicted by x, (3,), m/s^2 (E-35)."""
    return x[12:15] + x[15:18]


@njit(cache=True)
def force_jacobian() -> Array:
    """d measured_force / dx, (3, 18)."""
    H = np.zeros((3, STATES))
    for i in range(3):
        H[i, 12 + i] = 1.0
        H[i, 15 + i] = 1.0
    return H


@njit(cache=True)
def correct(
    x: Array, P: Array, innovation: Array, H: Array, R: Array, gate: float
) -> tuple[Array, Array, Array, float]:
    """Kalman correction in Joseph form: new x, P, the innovation's covariance and its NIS.

    An innovation whose NIS exceeds gate changes nothing; NIS tells.
    """
    C = H @ P @ H.T + R
    nis = float(innovation @ np.linalg.solve(C, innovation))
    if not nis <= gate:
        return x, P, C, nis
    K = np.ascontiguousarray(np.linalg.solve(C, H @ P).T)
    U = np.eye(STATES) - K @ H
    P = U @ P @ U.T + K @ R @ K.T
    return x + K @ innovation, 0.5 * (P + P.T), C, nis
