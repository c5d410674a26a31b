"""Rotations of the alignment: matrices, vectors, Euler angles."""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]


@njit(cache=True)
def rotation(a: float, b: float, c: float, R: Array) -> None:
    """R (3, 3) := Exp([a b c]), the rotation matrix of a rotation vector in rad (Rodrigues)."""
    angle2 = a * a + b * b + c * c
    if angle2 < 1e-8:  # the next terms are below 1e-18
        s = 1.0 - angle2 / 6.0
        k = 0.5 - angle2 / 24.0
    else:
        angle = math.sqrt(angle2)
        s = math.sin(angle) / angle
        k = (1.0 - math.cos(angle)) / angle2
    R[0, 0] = 1.0 - k * (b * b + c * c)
    R[1, 1] = 1.0 - k * (a * a + c * c)
    R[2, 2] = 1.0 - k * (a * a + b * b)
    R[0, 1] = k * a * b - s * c
    R[1, 0] = k * a * b + s * c
    R[0, 2] = k * a * c + s * b
    R[2, 0] = k * a * c - s * b
    R[1, 2] = k * b * c - s * a
    R[2, 1] = k * b * c + s * a


def rotation_vector(R: Array) -> Array:
    """Log of a rotation matrix (3, 3) -> (3,) rad, for angles below pi."""
    v = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    sine = 0.5 * float(np.linalg.norm(v))
    angle = math.atan2(sine, 0.5 * (float(np.trace(R)) - 1.0))
    return 0.5 * v if sine < 1e-12 else v * (0.5 * angle / sine)


def exp(phi: Array) -> Array:
    """Rotation matrix (3, 3) of a rotation vector (3,) in rad."""
    R = np.empty((3, 3))
    rotation(phi[0], phi[1], phi[2], R)
    return R


def euler_to_dcm(roll: float, pitch: float, yaw: float) -> Array:
    """C_nb (3, 3) = Rz(yaw) Ry(pitch) Rx(roll), rad (E-23)."""
    cr, sr, cp, sp, cy, sy = (f(a) for a in (roll, pitch, yaw) for f in (math.cos, math.sin))
    return np.array(
        [
            [cp * cy, -cr * sy + sr * sp * cy, sr * sy + cr * sp * cy],
            [cp * sy, cr * cy + sr * sp * sy, -sr * cy + cr * sp * sy],
            [-sp, sr * cp, cr * cp],
        ]
    )


def dcm_to_euler(C_nb: Array) -> tuple[float, float, float]:
    """Roll, pitch and yaw in rad of C_nb (3, 3); at pitch +-90 degrees roll and yaw are not
    separate.
    """
    return (
        math.atan2(C_nb[2, 1], C_nb[2, 2]),
        math.asin(max(-1.0, min(1.0, -C_nb[2, 0]))),
        math.atan2(C_nb[1, 0], C_nb[0, 0]),
    )


def dcm_to_quaternion(C_nb: Array) -> Array:
    """q_nb (4,), w x y z, w >= 0 (Shepperd's choice of the largest term, no loss near half
    turns).
    """
    R = C_nb
    t = np.trace(R)
    k = int(np.argmax([t, R[0, 0], R[1, 1], R[2, 2]]))
    if k == 0:
        q = np.array([1.0 + t, R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    else:
        i, j, m = k - 1, k % 3, (k + 1) % 3
        q = np.empty(4)
        q[0] = R[m, j] - R[j, m]
        q[1 + i] = 1.0 + 2.0 * R[i, i] - t
        q[1 + j] = R[j, i] + R[i, j]
        q[1 + m] = R[m, i] + R[i, m]
    q /= np.linalg.norm(q)
    return -q if q[0] < 0.0 else q
