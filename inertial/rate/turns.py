"""Small turns as plain numbers, for the inner loops: what rotation.py does with arrays, without one
(E-10 to E-12).

Quaternions w x y z and matrices row by row are tuples, which a compiler keeps in registers.
"""

import numpy as np
from numba import njit

Quaternion = tuple[float, float, float, float]
Matrix = tuple[float, float, float, float, float, float, float, float, float]

FAST = {"contract"}  # a product and a sum in one instruction


@njit(cache=True, error_model="numpy", fastmath=FAST)
def quaternion(v0: float, v1: float, v2: float) -> Quaternion:
    """Quaternion of the turn by |v| rad about v; below half a radian by series (E-10)."""
    s = 0.25 * (v0 * v0 + v1 * v1 + v2 * v2)  # square of half the angle
    if s < 0.0625:
        w = 1.0 - s * (
            1.0 / 2.0 - s * (1.0 / 24.0 - s * (1.0 / 720.0 - s * (1.0 / 40320.0 - s / 3628800.0)))
        )
        k = 0.5 - s * (
            1.0 / 12.0
            - s * (1.0 / 240.0 - s * (1.0 / 10080.0 - s * (1.0 / 725760.0 - s / 79833600.0)))
        )
    else:
        half = np.sqrt(s)
        w, k = np.cos(half), 0.5 * np.sin(half) / half
    return w, k * v0, k * v1, k * v2


@njit(cache=True, error_model="numpy", fastmath=FAST)
def matrix(q: Quaternion) -> Matrix:
    """Direction cosine matrix of a quaternion of unit length."""
    w, x, y, z = q
    xx, yy, zz, xy, xz, yz = x * x, y * y, z * z, x * y, x * z, y * z
    wx, wy, wz = w * x, w * y, w * z
    return (
        1.0 - 2.0 * (yy + zz),
        2.0 * (xy - wz),
        2.0 * (xz + wy),
        2.0 * (xy + wz),
        1.0 - 2.0 * (xx + zz),
        2.0 * (yz - wx),
        2.0 * (xz - wy),
        2.0 * (yz + wx),
        1.0 - 2.0 * (xx + yy),
    )


@njit(cache=True, error_model="numpy", fastmath=FAST)
def turn_matrix(v0: float, v1: float, v2: float) -> Matrix:
    """Direction cosine matrix of the turn by |v| rad about v."""
    return matrix(quaternion(v0, v1, v2))


@njit(cache=True, error_model="numpy", fastmath=FAST)
def product(p: Quaternion, q: Quaternion) -> Quaternion:
    """Hamilton product."""
    return (
        p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
        p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
        p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1],
        p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0],
    )


@njit(cache=True, error_model="numpy", fastmath=FAST)
def upright(q: Quaternion, u0: float, u1: float, u2: float) -> Quaternion:
    """q_nb turned so that up_b = u points up in n, of unit length; heading is kept (E-12)."""
    size = u0 * u0 + u1 * u1 + u2 * u2
    if size == 0.0:
        return q
    f, C = 1.0 / np.sqrt(size), matrix(q)
    north, east = f * (C[0] * u0 + C[1] * u1 + C[2] * u2), f * (C[3] * u0 + C[4] * u1 + C[5] * u2)
    a, b, c, d = product(quaternion(-east, north, 0.0), q)
    f = 1.0 / np.sqrt(a * a + b * b + c * c + d * d)
    return f * a, f * b, f * c, f * d
