"""Strapdown mechanisation in the local level frame, one IMU sample at a time.

The nominal state is a flat vector x (21,), slices below: latitude, longitude (rad), height (m), v_n
(m/s, 3), C_nb row-major (9), accelerometer bias (m/s^2, 3), gyroscope bias (rad/s, 3). Equations
E-23 to E-25 of docs/equations-ins.md (inmotion-alignment, section 2, discrete form).
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from inertial.navigation.earth import earth_rate, gravity, radii, transport_rate

Array = NDArray[np.float64]

SIZE = 21
LAT, LON, H = 0, 1, 2
V = slice(3, 6)
C = slice(6, 15)
BA = slice(15, 18)
BG = slice(18, 21)


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


@njit(cache=True)
def turn(x: Array, left: Array, right: Array) -> None:
    """C := left C right, in place; left and right (3, 3)."""
    for i in range(3):
        a = left[i, 0] * x[6] + left[i, 1] * x[9] + left[i, 2] * x[12]
        b = left[i, 0] * x[7] + left[i, 1] * x[10] + left[i, 2] * x[13]
        c = left[i, 0] * x[8] + left[i, 1] * x[11] + left[i, 2] * x[14]
        # one row at a time would overwrite what the next row needs: keep it in right's caller-owned
        # scratch row
        for j in range(3):
            right[3 + i, j] = a * right[0, j] + b * right[1, j] + c * right[2, j]
    for i in range(3):
        for j in range(3):
            x[6 + 3 * i + j] = right[3 + i, j]


@njit(cache=True)
def step(x: Array, f: Array, w: Array, dt: float, work: Array) -> None:
    """Advance x (21,) in place by dt s with specific force f (3,) and rate w (3,) of the body
    (E-25).

    work is scratch (13, 3), so that no memory is taken per sample; its last row returns the
    specific force f^n that acted, which the error model needs (E-26).
    """
    L, h, vN, vE, vD = x[0], x[2], x[3], x[4], x[5]
    ie0, ie1, ie2 = earth_rate(L)
    en0, en1, en2 = transport_rate(L, h, vN, vE)
    before = work[9:12]
    for i in range(3):
        for j in range(3):
            before[i, j] = x[6 + 3 * i + j]
    rotation(-(ie0 + en0) * dt, -(ie1 + en1) * dt, -(ie2 + en2) * dt, work[0:3])
    rotation((w[0] - x[18]) * dt, (w[1] - x[19]) * dt, (w[2] - x[20]) * dt, work[3:6])
    turn(x, work[0:3], work[3:9])

    f0, f1, f2 = f[0] - x[15], f[1] - x[16], f[2] - x[17]
    for i in range(3):
        j = 6 + 3 * i
        work[12, i] = 0.5 * (
            (before[i, 0] + x[j]) * f0
            + (before[i, 1] + x[j + 1]) * f1
            + (before[i, 2] + x[j + 2]) * f2
        )
    c0, c1, c2 = 2.0 * ie0 + en0, 2.0 * ie1 + en1, 2.0 * ie2 + en2
    x[3] = vN + dt * (work[12, 0] - (c1 * vD - c2 * vE))
    x[4] = vE + dt * (work[12, 1] - (c2 * vN - c0 * vD))
    x[5] = vD + dt * (work[12, 2] - (c0 * vE - c1 * vN) + gravity(L, h))

    R_N, R_E = radii(L)
    x[2] = h - 0.5 * (vD + x[5]) * dt
    x[0] = L + 0.5 * (vN + x[3]) * dt / (R_N + h)
    x[1] += 0.5 * (vE + x[4]) * dt / ((R_E + h) * math.cos(0.5 * (L + x[0])))


@njit(cache=True)
def orthonormalise(x: Array) -> None:
    """C := (3 C - C C^T C) / 2, which takes out the rounding gathered in many products."""
    M = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            M[i, j] = (
                x[6 + 3 * i] * x[6 + 3 * j]
                + x[7 + 3 * i] * x[7 + 3 * j]
                + x[8 + 3 * i] * x[8 + 3 * j]
            )
    new = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            s = M[i, 0] * x[6 + j] + M[i, 1] * x[9 + j] + M[i, 2] * x[12 + j]
            new[i, j] = 0.5 * (3.0 * x[6 + 3 * i + j] - s)
    for i in range(3):
        for j in range(3):
            x[6 + 3 * i + j] = new[i, j]


def workspace() -> Array:
    """Scratch memory of step."""
    return np.zeros((13, 3))


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


def inverse_step(x: Array, v_next: Array, C_next: Array, dt: float) -> tuple[Array, Array]:
    """Specific force and rate, (3,) each, with which step takes x to v_next (3,) and C_next (3, 3)
    exactly (E-25).
    """
    C_now = x[C].reshape(3, 3)
    ie = np.array(earth_rate(x[LAT]))
    en = np.array(transport_rate(x[LAT], x[H], x[3], x[4]))
    w = rotation_vector(C_now.T @ exp((ie + en) * dt) @ C_next) / dt + x[BG]
    f_n = (
        (v_next - x[V]) / dt
        + np.cross(2.0 * ie + en, x[V])
        - np.array([0.0, 0.0, gravity(x[LAT], x[H])])
    )
    return np.linalg.solve(0.5 * (C_now + C_next), f_n) + x[BA], w


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
