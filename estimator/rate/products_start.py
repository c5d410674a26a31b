"""First state of a products filter, from a standstill (E-36); compiled."""

import numpy as np
from numpy.typing import NDArray

from estimator.rate.compiling import making
from estimator.rate.observed import Sensor
from estimator.rate.products_kernel import ALPHA, GRAVITY, LEVEL, PP, Q_NB, REST, REST_VARIANCE, SIGN, Tuning
from estimator.rate.products_model import BIASES, STATES

Array = NDArray[np.float64]


@making
def begin(core: Array, s: Sensor, t: Tuning, mean: Array, theta_b: Array) -> None:
    """First state from the mean y (12,) of a short standstill (E-36)."""
    core[:] = 0.0
    P = core[STATES:PP].reshape(STATES, STATES)
    up = mean[9:12] / np.sqrt(np.sum(mean[9:12] ** 2))
    core[12:15] = GRAVITY * up
    for i in range(12):
        for j in range(12):
            P[BIASES[i], BIASES[j]] = t.bias * s.drift[i, j]
    for i in range(3):
        P[i, i] = t.still_rate / 25.0
        P[18 + i, 18 + i] = t.pivot
        for j in range(3):
            along = up[i] * up[j]
            P[12 + i, 12 + j] = t.gravity * along + t.tilt * ((1.0 if i == j else 0.0) - along)
    core[ALPHA : ALPHA + 3] = mean[0:3]
    core[SIGN] = t.still_rate / 25.0
    core[Q_NB : Q_NB + 4] = level(up)
    for k in range(12):
        core[REST_VARIANCE + k] = core[LEVEL + k] = t.bias * s.drift[k, k]
    for i in range(s.n):
        core[REST + i] = theta_b[i, 0] * core[12] + theta_b[i, 1] * core[13] + theta_b[i, 2] * core[14]


@making
def level(up: Array) -> Array:
    """q_nb of a body at rest whose up is `up`; x_b points north, or z_b where x_b is vertical (E-11)."""
    ahead = np.array([1.0, 0.0, 0.0]) if abs(up[0]) < 0.999 else np.array([0.0, 0.0, 1.0])
    north = ahead - np.sum(ahead * up) * up
    north /= np.sqrt(np.sum(north * north))
    east = np.array([north[1] * up[2] - north[2] * up[1], north[2] * up[0] - north[0] * up[2],
                     north[0] * up[1] - north[1] * up[0]])  # fmt: skip
    C = np.empty((3, 3))
    C[0], C[1], C[2] = north, east, -up
    w = C[0, 0] + C[1, 1] + C[2, 2]
    squares = np.array([1.0 + w, 1.0 - w + 2.0 * C[0, 0], 1.0 - w + 2.0 * C[1, 1], 1.0 - w + 2.0 * C[2, 2]])
    a, b, c = C[2, 1] - C[1, 2], C[0, 2] - C[2, 0], C[1, 0] - C[0, 1]
    xy, xz, yz = C[0, 1] + C[1, 0], C[0, 2] + C[2, 0], C[1, 2] + C[2, 1]
    table = np.array([[squares[0], a, b, c], [a, squares[1], xy, xz], [b, xy, squares[2], yz], [c, xz, yz, squares[3]]])
    q = table[np.argmax(squares)]
    q = q / np.sqrt(np.sum(q * q))
    return q if q[0] >= 0.0 else -q
