"""Shapes of the scene and the step from navigation frame to screen.

n is north-east-down everywhere outside. The node '/world' alone turns n into viser's z-up display
frame (east, north, up), so every node below it carries its quaternion and position as they stand in
the messages.
"""

import math
from collections.abc import Sequence

import numpy as np

from dashboard.data.pose import yaw_of
from inertial.layouts.catalogue import CUBE
from inertial.rotation import from_matrix, multiply
from messages.contract import gyrofree_pb2 as pb

# Rotation n (north, east, down) -> display (east, north, up): half a turn about (1, 1, 0), w x y z.
Q_DISPLAY_N = (0.0, 0.5**0.5, 0.5**0.5, 0.0)

_CUBE = CUBE(half_side=1.0)
SENSORS_B, DIRECTIONS_B = _CUBE.r_b, _CUBE.theta_b  # (12, 3): a11 a12 ... a43, in half sides


def quaternion(values) -> tuple[float, float, float, float] | None:
    """Four numbers of a message as a unit quaternion; None when they are not one."""
    if len(values) != 4:
        return None
    q = np.asarray(values, dtype=float)
    norm = float(np.linalg.norm(q))
    if not np.isfinite(norm) or norm < 0.5:
        return None
    return tuple(float(v) for v in q / norm)


def ellipsoid(
    covariance, sigmas: float = 3.0
) -> tuple[tuple[float, ...], tuple[float, ...]] | None:
    """Half axes (3) and orientation (w, x, y, z) of the surface `sigmas` standard deviations out;
    None without one.
    """
    if len(covariance) != 9:
        return None
    c = np.asarray(covariance, dtype=float).reshape(3, 3)
    if not np.all(np.isfinite(c)):
        return None
    values, vectors = np.linalg.eigh((c + c.T) / 2)
    if np.linalg.det(vectors) < 0:
        vectors[:, 0] = -vectors[:, 0]
    axes = tuple(float(v) for v in sigmas * np.sqrt(np.maximum(values, 1e-8)))
    return axes, tuple(from_matrix(vectors).tolist())


def drawn_place(p_ned: Sequence[float]) -> tuple[float, float, float] | None:
    """Where a body is drawn, m; without a height at the origin's. None without a place."""
    if len(p_ned) != 3:
        return None
    north, east, down = p_ned
    return north, east, down if math.isfinite(down) else 0.0


def flattened(covariance: Sequence[float], flat: bool) -> Sequence[float]:
    """(9,) NED m^2; where the height is unknown, without its part: only the plane can be drawn."""
    if not flat or len(covariance) != 9:
        return covariance
    return [v if k in (0, 1, 3, 4) else 0.0 for k, v in enumerate(covariance)]


def box_edges(half: tuple[float, float, float], centre=(0.0, 0.0, 0.0)) -> np.ndarray:
    """The 12 edges of a box as line segments (12, 2, 3)."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
    pairs = [
        (i, j) for i in range(8) for j in range(i + 1, 8) if np.sum(corners[i] != corners[j]) == 1
    ]
    return (corners[np.array(pairs)] * np.asarray(half) + np.asarray(centre)).astype(np.float32)


def vehicle_edges() -> np.ndarray:
    """Outline of a passenger car in forward-right-down axes, m: segments (n, 2, 3); origin at the
    floor's middle.
    """
    side = np.array(
        [
            [2.2, -0.3],
            [2.2, -0.75],
            [1.1, -0.9],
            [0.4, -1.45],
            [-1.3, -1.45],
            [-2.0, -0.95],
            [-2.2, -0.9],
            [-2.2, -0.3],
        ]
    )
    loops = [np.column_stack([side[:, 0], np.full(len(side), y), side[:, 1]]) for y in (-0.9, 0.9)]
    around = [np.stack([loop, np.roll(loop, -1, axis=0)], axis=1) for loop in loops]
    return np.concatenate([*around, np.stack(loops, axis=1)]).astype(np.float32)


def disc(radius: float, thickness: float, sides: int = 64) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n, 3) and triangles (m, 3) of a disc whose top is the plane z = 0."""
    angle = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    ring = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.zeros(sides)])
    vertices = np.vstack([ring, ring - [0, 0, thickness], [[0, 0, 0]], [[0, 0, -thickness]]])
    i = np.arange(sides)
    j = (i + 1) % sides
    top = np.column_stack([np.full(sides, 2 * sides), i, j])
    bottom = np.column_stack([np.full(sides, 2 * sides + 1), j + sides, i + sides])
    wall = np.vstack(
        [np.column_stack([i, i + sides, j]), np.column_stack([j, i + sides, j + sides])]
    )
    return vertices.astype(np.float32), np.vstack([top, bottom, wall]).astype(np.uint32)


MODES = {
    pb.NavSolution.MODE_WAITING: "waiting for data",
    pb.NavSolution.MODE_LEVELLING: "levelling",
    pb.NavSolution.MODE_COURSE: "waiting for speed",
    pb.NavSolution.MODE_NAVIGATING: "navigating",
}


def facing(q_nb: Sequence[float], other: Sequence[float]) -> tuple[float, ...] | None:
    """q_nb (4,) turned about the vertical to the heading of another; None where it is no
    rotation.
    """
    q = quaternion(q_nb)
    if q is None or quaternion(other) is None:
        return q
    half = 0.5 * (yaw_of(other) - yaw_of(q_nb))
    return tuple(multiply([np.cos(half), 0.0, 0.0, np.sin(half)], q).tolist())
