"""Rotations: quaternions, direction cosine matrices, rotation vectors, Euler angles; one of each.

    rotation vector -> from_rotation_vector -> quaternion     q_nb (..., 4), w x y z, unit length
    quaternion      -> to_matrix, from_matrix <- matrix       C_nb (..., 3, 3), f_n = C_nb f_b
    rotation vector -> turn_matrix, rotation_vector <- matrix (..., 3), rad
    roll pitch yaw  -> euler_matrix, euler_angles <- matrix   rad, the z-y-x sequence

q_nb and C_nb turn a vector of b into n; n is north-east-down. All take stacks over the leading
axes. Equations E-10 to E-12 of docs/equations.md, E-103 and E-115 of docs/equations-ins.md. The C++
twin, with the same bits, is core/common/rotation.hpp.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from inertial.core import native
from inertial.elementary import asin, atan2, cos, dot, norm, sin

Array = NDArray[np.float64]


def skew(v: ArrayLike) -> Array:
    """Matrix S (..., 3, 3) with S u = v x u."""
    x, y, z = _parts(v)
    o = np.zeros_like(x)
    return _matrix([[o, -z, y], [z, o, -x], [-y, x, o]])


def multiply(p: ArrayLike, q: ArrayLike) -> Array:
    """Hamilton product: q_ac = multiply(q_ab, q_bc)."""
    pw, px, py, pz = _parts(p)
    qw, qx, qy, qz = _parts(q)
    return np.stack(
        [
            pw * qw - px * qx - py * qy - pz * qz,
            pw * qx + px * qw + py * qz - pz * qy,
            pw * qy - px * qz + py * qw + pz * qx,
            pw * qz + px * qy - py * qx + pz * qw,
        ],
        axis=-1,
    )


def conjugate(q_ab: ArrayLike) -> Array:
    """q_ba, the turn back."""
    return np.asarray(q_ab, np.float64) * np.array([1.0, -1.0, -1.0, -1.0])


def normalised(q: ArrayLike) -> Array:
    """q with unit length."""
    return (1.0 / norm(q))[..., None] * np.asarray(q, np.float64)


def rotate(q_nb: ArrayLike, v_b: ArrayLike) -> Array:
    """v_n (..., 3) of v_b (..., 3)."""
    return dot(to_matrix(q_nb), np.asarray(v_b, np.float64)[..., None, :])


def from_rotation_vector(v: ArrayLike) -> Array:
    """Quaternion of the turn by |v| rad about v (..., 3); below half a radian by series (E-10)."""
    v = np.asarray(v, np.float64)
    s = 0.25 * dot(v, v)  # square of half the angle
    near = s < 0.0625
    half = np.sqrt(np.where(near, 1.0, s))
    w = 1.0 - s * (
        1.0 / 2.0 - s * (1.0 / 24.0 - s * (1.0 / 720.0 - s * (1.0 / 40320.0 - s / 3628800.0)))
    )
    k = 0.5 - s * (
        1.0 / 12.0 - s * (1.0 / 240.0 - s * (1.0 / 10080.0 - s * (1.0 / 725760.0 - s / 79833600.0)))
    )
    w, k = np.where(near, w, cos(half)), np.where(near, k, 0.5 * sin(half) / half)
    return np.concatenate([w[..., None], k[..., None] * v], axis=-1)


def to_matrix(q_nb: ArrayLike) -> Array:
    """C_nb (..., 3, 3) of q_nb (..., 4) of unit length."""
    w, x, y, z = _parts(q_nb)
    xx, yy, zz, xy, xz, yz = x * x, y * y, z * z, x * y, x * z, y * z
    wx, wy, wz = w * x, w * y, w * z
    return _matrix(
        [
            [1.0 - 2.0 * (yy + zz), 2.0 * (xy - wz), 2.0 * (xz + wy)],
            [2.0 * (xy + wz), 1.0 - 2.0 * (xx + zz), 2.0 * (yz - wx)],
            [2.0 * (xz - wy), 2.0 * (yz + wx), 1.0 - 2.0 * (xx + yy)],
        ]
    )


def from_matrix(C_nb: ArrayLike) -> Array:
    """q_nb (..., 4), w >= 0, of C_nb (..., 3, 3): by its largest component, which loses nothing
    near half turns (Shepperd).
    """
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = _rows(C_nb)
    trace = xx + yy + zz
    w4x, w4y, w4z = zy - yz, xz - zx, yx - xy
    x4y, x4z, y4z = xy + yx, xz + zx, yz + zy
    squares = [1.0 + trace] + [1.0 - trace + 2.0 * d for d in (xx, yy, zz)]  # 4 w^2, 4 x^2 ...
    candidates = _matrix(  # 4 q, times w, x, y, z in turn
        [
            [squares[0], w4x, w4y, w4z],
            [w4x, squares[1], x4y, x4z],
            [w4y, x4y, squares[2], y4z],
            [w4z, x4z, y4z, squares[3]],
        ]
    )
    largest = np.argmax(np.stack(squares, axis=-1), axis=-1)[..., None, None]
    q = normalised(np.take_along_axis(candidates, largest, axis=-2)[..., 0, :])
    return np.where(q[..., :1] < 0.0, -q, q)


def turn_matrix(v: ArrayLike) -> Array:
    """Exp: the matrix (..., 3, 3) of the turn by |v| rad about v (..., 3)."""
    return to_matrix(from_rotation_vector(v))


def rotation_vector(C: ArrayLike) -> Array:
    """Log: the rotation vector (..., 3) of a matrix (..., 3, 3), for angles below pi."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = _rows(C)
    v = np.stack([zy - yz, xz - zx, yx - xy], axis=-1)
    sine = 0.5 * norm(v)
    angle = atan2(sine, 0.5 * (xx + yy + zz - 1.0))
    near = sine < 1e-12
    factor = np.where(near, 0.5, 0.5 * angle / np.where(near, 1.0, sine))
    return factor[..., None] * v


def euler_matrix(roll: ArrayLike, pitch: ArrayLike, yaw: ArrayLike) -> Array:
    """C_nb (..., 3, 3) = Rz(yaw) Ry(pitch) Rx(roll), rad (E-103)."""
    cr, sr, cp, sp, cy, sy = (f(a) for a in (roll, pitch, yaw) for f in (cos, sin))
    return _matrix(
        [
            [cp * cy, sr * sp * cy - cr * sy, sr * sy + cr * sp * cy],
            [cp * sy, cr * cy + sr * sp * sy, cr * sp * sy - sr * cy],
            [-sp, sr * cp, cr * cp],
        ]
    )


def euler_angles(C_nb: ArrayLike) -> tuple[Array, Array, Array]:
    """Roll, pitch and yaw in rad of C_nb (..., 3, 3); at pitch +-90 degrees roll and yaw are not
    separate.
    """
    (xx, _, _), (yx, _, _), (zx, zy, zz) = _rows(C_nb)
    return atan2(zy, zz), asin(-zx), atan2(yx, xx)


def level(f_b: ArrayLike) -> Array:
    """q_nb of a body at rest that feels f_b (3,), m/s^2; heading such that x_b points north (E-11).

    Raises ValueError when f_b is zero, not finite, or along x_b, where x_b has no heading.
    """
    size = norm(f_b)
    if not np.isfinite(size) or size == 0.0:
        raise ValueError(
            f"tilt from gravity: specific force {f_b} has no direction, want about 9.8 m/s^2"
        )
    down_b = np.asarray(f_b, np.float64) / -size
    x, y, z = down_b
    north_b = np.array([1.0 - x * x, -x * y, -x * z])
    length = norm(north_b)
    if length < 1e-6:
        raise ValueError(
            "tilt from gravity: x_b is vertical and has no heading: turn the board by a quarter"
        )
    north_b = north_b / length
    return from_matrix(np.array([north_b, np.cross(down_b, north_b), down_b]))


def roll_pitch(f_b: ArrayLike) -> tuple[Array, Array]:
    """Roll and pitch, rad, of a body at rest that feels f_b (..., 3) (E-115)."""
    x, y, z = _parts(f_b)
    return atan2(-y, -z), atan2(x, np.sqrt(y * y + z * z))


def upright(q_nb: ArrayLike, up_b: ArrayLike, gain: float = 1.0) -> Array:
    """q_nb (..., 4) turned by the fraction gain of the way that brings up_b (..., 3) onto n's up;
    heading is kept; not turned where up_b is zero (E-12).
    """
    size = norm(up_b)
    known = size > 0.0
    up_n = rotate(q_nb, np.asarray(up_b, np.float64) / np.where(known, size, 1.0)[..., None])
    north, east, _ = _parts(up_n)
    # up_n x (0, 0, -1): horizontal, as long as the sine of the tilt error
    turn = np.stack([-gain * east, gain * north, np.zeros_like(north)], axis=-1)
    return np.where(known[..., None], normalised(multiply(from_rotation_vector(turn), q_nb)), q_nb)


def followed(q_nb: ArrayLike, turns_b: ArrayLike) -> Array:
    """q_nb (n + 1, 4) at first and after each of the turns (n, 3), rotation vectors in b, rad."""
    q = np.ascontiguousarray(q_nb, dtype=np.float64)
    return native.rotation.followed(q, np.ascontiguousarray(turns_b, dtype=np.float64))


def _parts(v: ArrayLike) -> list[Array]:
    v = np.asarray(v, np.float64)
    return list(v if v.ndim == 1 else np.moveaxis(v, -1, 0))


def _rows(C: ArrayLike) -> list[list[Array]]:
    C = np.asarray(C, np.float64)
    return [_parts(row) for row in (C if C.ndim == 2 else np.moveaxis(C, -2, 0))]


def _matrix(rows: list[list[Array]]) -> Array:
    whole = np.array(rows)
    return whole if whole.ndim == 2 else np.moveaxis(whole, (0, 1), (-2, -1))
