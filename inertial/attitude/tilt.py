"""The fixed-weight tilt filter for an accelerometer and two or three gyros: as published, and in
vector form.

Equations E-70 to E-76 of docs/equations-attitude.md (tilt-filter, sections 2 and 4; Starlino's
guide to accelerometer and gyroscope devices). The published form works in its article's frame a,
which reads +1 g on z when the board lies
level: x_a = x_b, y_a = -y_b, z_a = -z_b for a forward-right-down body. R is the direction of the
specific force, so for a body at rest it points up.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

W_GYRO = 10.0  # the article's range is 5 to 20, found by experiment
TIME_CONSTANT = 3.5  # s, of the vector form: its weight is this over the sample period
ILL_CONDITIONED = 0.1  # |Rz| below which the projection angles are not used (E-74)
TO_ARTICLE = np.array([1.0, -1.0, -1.0])  # of a vector's components, b to a; a half turn about x


def direction_cosines(R_a: Array) -> Array:
    """cos of the angles between R (..., 3) and the axes; their squares sum to 1 (E-70)."""
    return R_a / np.linalg.norm(R_a, axis=-1, keepdims=True)


def projection_angles(R_a: Array) -> tuple[Array, Array]:
    """Axz and Ayz, rad: angles between z and R's projection on the xz and the yz plane (E-71)."""
    return np.arctan2(R_a[..., 0], R_a[..., 2]), np.arctan2(R_a[..., 1], R_a[..., 2])


@njit(cache=True)
def from_projection_angles(xz: float, yz: float, sign_z: float) -> tuple[float, float, float]:
    """R of the two projection angles, rad; its z has the sign given, for the angles' own is lost
    (E-73).
    """
    x = math.sin(xz) / math.sqrt(1.0 + (math.cos(xz) * math.tan(yz)) ** 2)
    y = math.sin(yz) / math.sqrt(1.0 + (math.cos(yz) * math.tan(xz)) ** 2)
    return x, y, sign_z * math.sqrt(max(0.0, 1.0 - x * x - y * y))


@njit(cache=True)
def published(
    state: Array, f_a: Array, rates: Array, period: float, w_gyro: float, out: Array
) -> None:
    """Filter samples in place: state (6,) is R (3), the last RateAxz and RateAyz, and 1 once
    started (E-72 to E-75).

    f_a (n, 3) in any unit, rates (n, 2) RateAxz and RateAyz in rad/s, out (n, 3) := R after each
    sample. A sample without any specific force has no direction: the gyros alone carry R over it.
    """
    for k in range(len(f_a)):
        fx, fy, fz = f_a[k, 0], f_a[k, 1], f_a[k, 2]
        size = math.sqrt(fx * fx + fy * fy + fz * fz)
        if state[5] == 0.0:
            if size > 0.0:
                state[0], state[1], state[2], state[5] = fx / size, fy / size, fz / size, 1.0
        else:
            gx, gy, gz = state[0], state[1], state[2]
            if abs(gz) >= ILL_CONDITIONED:
                xz = math.atan2(gx, gz) + period * 0.5 * (rates[k, 0] + state[3])
                yz = math.atan2(gy, gz) + period * 0.5 * (rates[k, 1] + state[4])
                gx, gy, gz = from_projection_angles(xz, yz, 1.0 if gz > 0.0 else -1.0)
            if size > 0.0:
                gx, gy, gz = (
                    fx / size + w_gyro * gx,
                    fy / size + w_gyro * gy,
                    fz / size + w_gyro * gz,
                )
            length = math.sqrt(gx * gx + gy * gy + gz * gz)
            if length > 1e-9:  # the accelerometer may say the exact opposite
                state[0], state[1], state[2] = gx / length, gy / length, gz / length
        state[3], state[4] = rates[k, 0], rates[k, 1]
        out[k, 0], out[k, 1], out[k, 2] = state[0], state[1], state[2]


def published_rates(omega_b: Array) -> Array:
    """RateAxz and RateAyz (n, 2) of a level board's rates (n, 3) in b, rad/s: the article ignores
    the rest (E-72).

    Tipping so that x's reading rises is a turn about -y of a; y_a is -y_b.
    """
    return np.column_stack([omega_b[:, 1], omega_b[:, 0]])


@njit(cache=True)
def upright(q: Array, fx: float, fy: float, fz: float, part: float) -> None:
    """Turn q_nb (4,) in place by a part of the way that brings f_b's direction onto n's up; heading
    stays (E-76).

    The part is that of the blend (Racc + w Rgyro) / (1 + w) with part = 1 / (1 + w): a chord, not
    an arc.
    """
    size = math.sqrt(fx * fx + fy * fy + fz * fz)
    if size == 0.0:
        return
    w, x, y, z = q[0], q[1], q[2], q[3]
    n0 = (
        ((1 - 2 * (y * y + z * z)) * fx + 2 * (x * y - w * z) * fy + 2 * (x * z + w * y) * fz)
        / size
        * part
    )
    n1 = (
        (2 * (x * y + w * z) * fx + (1 - 2 * (x * x + z * z)) * fy + 2 * (y * z - w * x) * fz)
        / size
        * part
    )
    n2 = (
        (2 * (x * z - w * y) * fx + 2 * (y * z + w * x) * fy + (1 - 2 * (x * x + y * y)) * fz)
        / size
        * part
    )
    n2 -= 1.0 - part  # the blend of what is felt with up
    length = math.sqrt(n0 * n0 + n1 * n1 + n2 * n2)
    if length < 1e-9:
        return
    # shortest turn from the blend b to up u = (0, 0, -1): quaternion (1 + b.u, b x u), normalised
    b0, b1, c = n0 / length, n1 / length, 1.0 - n2 / length
    if c < 1e-12:  # exactly upside down: any horizontal axis will do
        b0, b1, c = 0.0, 1.0, 0.0
    k = 1.0 / math.sqrt(c * c + b0 * b0 + b1 * b1)
    rw, rx, ry = c * k, -b1 * k, b0 * k
    q[0], q[1] = rw * w - rx * x - ry * y, rw * x + rx * w + ry * z
    q[2], q[3] = rw * y + ry * w - rx * z, rw * z + rx * y - ry * x


@njit(cache=True)
def vector_form(
    state: Array, f_b: Array, omega_b: Array, period: float, w_gyro: float, out: Array
) -> None:
    """The same weighting on whole rotations: state (8,) is q_nb (4), the last rate (3), and 1 once
    started (E-76).

    f_b, omega_b (n, 3); out (n, 4) := q_nb after each sample, heading by the gyro alone.
    """
    for k in range(len(f_b)):
        fx, fy, fz = f_b[k, 0], f_b[k, 1], f_b[k, 2]
        if state[7] == 0.0:
            if fx != 0.0 or fy != 0.0 or fz != 0.0:
                state[0], state[1], state[2], state[3], state[7] = 1.0, 0.0, 0.0, 0.0, 1.0
                upright(state, fx, fy, fz, 1.0)
        else:
            a = 0.5 * period * (omega_b[k, 0] + state[4])
            b = 0.5 * period * (omega_b[k, 1] + state[5])
            c = 0.5 * period * (omega_b[k, 2] + state[6])
            angle = math.sqrt(a * a + b * b + c * c)
            s = 0.5 - angle * angle / 48.0 if angle < 1e-4 else math.sin(0.5 * angle) / angle
            tw, tx, ty, tz = math.cos(0.5 * angle), a * s, b * s, c * s
            w, x, y, z = state[0], state[1], state[2], state[3]
            state[0] = w * tw - x * tx - y * ty - z * tz
            state[1] = w * tx + x * tw + y * tz - z * ty
            state[2] = w * ty - x * tz + y * tw + z * tx
            state[3] = w * tz + x * ty - y * tx + z * tw
            upright(state, fx, fy, fz, 1.0 / (1.0 + w_gyro))
            length = math.sqrt(state[0] ** 2 + state[1] ** 2 + state[2] ** 2 + state[3] ** 2)
            for i in range(4):
                state[i] /= length
        state[4], state[5], state[6] = omega_b[k, 0], omega_b[k, 1], omega_b[k, 2]
        for i in range(4):
            out[k, i] = state[i]


@njit(cache=True)
def upright_from(up_b: Array) -> Array:
    """q_nb (n, 4) of up's directions in b (n, 3), without any heading of its own: the shortest
    turn.
    """
    q = np.zeros((len(up_b), 4))
    for k in range(len(q)):
        q[k, 0] = 1.0
        upright(q[k], up_b[k, 0], up_b[k, 1], up_b[k, 2], 1.0)
    return q
