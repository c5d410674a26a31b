"""Attitude: quaternions w x y z, direction cosine matrices, tilt from gravity.

q_nb and C_nb turn a vector of b into n: f_n = C_nb f_b. n is north-east-down. Compiled, so that
filters can call them from compiled loops. docs/equations.md, E-10 to E-12.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]


@njit(cache=True)
def skew(v: Array) -> Array:
    """Matrix S with S @ u == cross(v, u)."""
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


@njit(cache=True)
def multiply(p: Array, q: Array) -> Array:
    """Hamilton product: q_ac = multiply(q_ab, q_bc)."""
    return np.array(
        [
            p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
            p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
            p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1],
            p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0],
        ]
    )


@njit(cache=True)
def from_rotation_vector(v: Array) -> Array:
    """Quaternion of the turn by |v| rad about v; exact series near zero (E-10)."""
    angle2 = v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
    if angle2 < 1e-8:
        w, k = 1.0 - angle2 / 8.0, 0.5 - angle2 / 48.0
    else:
        angle = np.sqrt(angle2)
        w, k = np.cos(0.5 * angle), np.sin(0.5 * angle) / angle
    return np.array([w, k * v[0], k * v[1], k * v[2]])


@njit(cache=True)
def to_dcm(q: Array) -> Array:
    """C_nb of q_nb (unit length)."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def from_dcm(C: Array) -> Array:
    """q_nb of C_nb, the branch with the largest element (Shepperd), w, x, y, z with w >= 0."""
    trace = np.trace(C)
    squares = np.array(
        [1 + trace, 1 - trace + 2 * C[0, 0], 1 - trace + 2 * C[1, 1], 1 - trace + 2 * C[2, 2]]
    )
    w4x, w4y, w4z = C[2, 1] - C[1, 2], C[0, 2] - C[2, 0], C[1, 0] - C[0, 1]
    xy, xz, yz = C[0, 1] + C[1, 0], C[0, 2] + C[2, 0], C[1, 2] + C[2, 1]
    rows = np.array(
        [
            [squares[0], w4x, w4y, w4z],
            [w4x, squares[1], xy, xz],
            [w4y, xy, squares[2], yz],
            [w4z, xz, yz, squares[3]],
        ]
    )
    q = rows[int(squares.argmax())]
    q = q / np.linalg.norm(q)
    return q if q[0] >= 0.0 else -q


def level(f_b: Array) -> Array:
    """q_nb of a body at rest that feels f_b (3,), m/s^2; heading such that x_b points north (E-11).

    Raises ValueError when f_b is zero, not finite, or along x_b, where x_b has no heading.
    """
    size = float(np.linalg.norm(f_b))
    if not np.isfinite(size) or size == 0.0:
        raise ValueError(
            f"tilt from gravity: specific force {f_b} has no direction, want about 9.8 m/s^2"
        )
    down_b = -np.asarray(f_b, dtype=np.float64) / size
    north_b = np.array([1.0, 0.0, 0.0]) - down_b[0] * down_b
    length = np.linalg.norm(north_b)
    if length < 1e-6:
        raise ValueError(
            "tilt from gravity: x_b is vertical and has no heading: turn the board by a quarter"
        )
    north_b /= length
    return from_dcm(np.array([north_b, np.cross(down_b, north_b), down_b]))


@njit(cache=True)
def tilt_correction(q_nb: Array, up_b: Array, gain: float) -> Array:
    """q_nb turned by the fraction gain of the way that brings up_b (3,) onto n's up; heading is
    kept (E-12).
    """
    C = to_dcm(q_nb)
    length = np.sqrt(up_b[0] ** 2 + up_b[1] ** 2 + up_b[2] ** 2)
    if length == 0.0:
        return q_nb
    up_n = C @ (up_b / length)
    # cross(up_n, (0, 0, -1)): horizontal, as long as the sine of the tilt error
    turn = np.array([-up_n[1] * gain, up_n[0] * gain, 0.0])
    q = multiply(from_rotation_vector(turn), q_nb)
    return q / np.sqrt(np.sum(q * q))
