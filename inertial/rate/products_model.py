"""Model of the products filter: its state, how it moves, what it predicts; every Jacobian beside
its function.

    x = [ omega rad/s | b_alpha rad/s^2 | b_c (6) (rad/s)^2 | u m/s^2 | b_f m/s^2 | r m | angle rad
    ]      22 numbers



    omega' = alpha_m - b_alpha - (S Q z)_omega'     alpha_m, p_m, c_m: what the axes give
    (observed.py, E-40, E-41) angle' = omega_z
    (E-30) u'     = -omega x u                             u: specific force of a body at rest,
    gravity's reaction in b c_m    = M z(omega) + b_c                       z: the six products w_i
    w_j p_m    = u + b_f + (S Q z)_p + omega' x r + omega x (omega x r)      r: from a pivot at rest
    to the centre

b_alpha, b_c, b_f: what axis biases add. The angle is a state because gravity, turning in a tilted
body, tells how far it has turned: what that corrects in u it must correct in the angle too. Written
for the reader, with every zero; the same by blocks is inertial/core/rate, proven equal by
tests/inertial/test_products.py.
"""

import numpy as np
from numpy.typing import NDArray

from inertial.rotation import from_rotation_vector, skew, to_matrix

Array = NDArray[np.float64]

STATES = 22
OMEGA, B_ALPHA, B_C, U, B_F, PIVOT, TURNED = (
    slice(0, 3),
    slice(3, 6),
    slice(6, 12),
    slice(12, 15),
    slice(15, 18),
    slice(18, 21),
    21,
)
BIASES = np.array(
    [3, 4, 5, 6, 7, 8, 9, 10, 11, 15, 16, 17]
)  # of x, in the order of observed.Sensor.W
FIRST = np.array([0, 0, 0, 1, 1, 2])  # i and j of w_i w_j, in the order of layout.PRODUCTS
SECOND = np.array([0, 1, 2, 1, 2, 2])


def squares(omega: Array) -> Array:
    """z(omega), (6,), (rad/s)^2 (E-2)."""
    z = np.empty(6)
    for k in range(6):
        z[k] = omega[FIRST[k]] * omega[SECOND[k]]
    return z


def squares_jacobian(omega: Array) -> Array:
    """dz/domega, (6, 3)."""
    D = np.zeros((6, 3))
    for k in range(6):
        D[k, FIRST[k]] += omega[SECOND[k]]
        D[k, SECOND[k]] += omega[FIRST[k]]
    return D


def transition(x: Array, alpha_m: Array, SQ: Array, dt: float, turning: bool) -> Array:
    """State after dt (s) with mean measured omega' alpha_m (3,) (E-31); a body known to be still
    keeps its rate.
    """
    y = x.copy()
    if turning:
        y[0:3] += dt * (alpha_m - x[3:6] - SQ[0:3] @ squares(x[0:3]))
    middle = 0.5 * (x[0:3] + y[0:3])
    y[21] += dt * middle[2]
    y[12:15] = to_matrix(from_rotation_vector(-dt * middle)) @ x[12:15]
    return y


def transition_jacobian(x: Array, y: Array, SQ: Array, dt: float, turning: bool) -> Array:
    """d transition / dx, (22, 22), at x with result y; to first order in the turn of one sample
    (E-32).
    """
    F = np.eye(STATES)
    middle = 0.5 * (x[0:3] + y[0:3])
    # u between the samples: the turn's effect is then right to second order
    turned = dt * skew(0.5 * (x[12:15] + y[12:15]))
    F[12:15, 12:15] = to_matrix(from_rotation_vector(-dt * middle))
    F[12:15, 0:3] = turned
    F[21, 2] = dt
    if turning:
        F[0:3, 0:3] -= dt * SQ[0:3] @ squares_jacobian(x[0:3])
        for i in range(3):
            F[i, 3 + i] = -dt
        F[12:15, 3:6] = -0.5 * dt * turned
        F[21, 5] = -0.5 * dt * dt
    return F


def measured_products(x: Array, M: Array) -> Array:
    """c_m predicted by x, (6,), (rad/s)^2, without the spread of omega (E-33)."""
    return M @ squares(x[0:3]) + x[6:12]


def measured_products_jacobian(x: Array, M: Array) -> Array:
    """d measured_products / dx, (6, 22)."""
    H = np.zeros((6, STATES))
    H[:, 0:3] = M @ squares_jacobian(x[0:3])
    for k in range(6):
        H[k, 6 + k] = 1.0
    return H


def products_spread(P: Array) -> tuple[Array, Array]:
    """Mean (6,) and covariance (6, 6) that the spread of omega adds to its products (E-34).

    For Gaussian errors e of covariance P: E e_i e_j = P_ij; cov(e_i e_j, e_k e_l) = P_ik P_jl +
    P_il P_jk.
    """
    mean, covariance = np.empty(6), np.empty((6, 6))
    for a in range(6):
        i, j = FIRST[a], SECOND[a]
        mean[a] = P[i, j]
        for b in range(6):
            k, l = FIRST[b], SECOND[b]
            covariance[a, b] = P[i, k] * P[j, l] + P[i, l] * P[j, k]
    return mean, covariance


def measured_force(x: Array, alpha: Array, SQ: Array) -> Array:
    """p_m predicted by x and omega' alpha (3,), (3,), m/s^2 (E-35)."""
    W = skew(x[0:3])
    moved = skew(alpha) @ x[18:21] + W @ (W @ x[18:21])
    return x[12:15] + x[15:18] + moved + SQ[3:6] @ squares(x[0:3])


def measured_force_jacobian(x: Array, alpha: Array, SQ: Array) -> Array:
    """d measured_force / dx, (3, 22), omega' taken as known."""
    H = np.zeros((3, STATES))
    omega, r, W = x[0:3], x[18:21], skew(x[0:3])
    H[:, 0:3] = np.outer(omega, r) - 2.0 * np.outer(r, omega) + np.sum(omega * r) * np.eye(3)
    H[:, 0:3] += SQ[3:6] @ squares_jacobian(omega)
    H[:, 18:21] = skew(alpha) + W @ W
    for i in range(3):
        H[i, 12 + i] = 1.0
        H[i, 15 + i] = 1.0
    return H
