"""Attitude and place of a message as the numbers that stand in tables."""

import math
from collections.abc import Sequence

import numpy as np

from inertial.earth import ned_between
from inertial.rotation import euler_angles, to_matrix


def roll_pitch(q_nb: Sequence[float]) -> tuple[float, float]:
    """Roll and pitch in rad of q_nb (4,), w x y z."""
    roll, pitch, _ = euler_angles(to_matrix(q_nb))
    return float(roll), float(pitch)


def yaw_of(q_nb: Sequence[float]) -> float:
    """Heading of q_nb (4,) w x y z, rad; NaN for none."""
    return float(euler_angles(to_matrix(q_nb))[2]) if len(q_nb) == 4 else math.nan


def yaws_of(q_nb: np.ndarray) -> np.ndarray:
    """Headings (n,) of q_nb (n, 4) w x y z, rad; NaN for NaN."""
    w, x, y, z = q_nb.T
    return np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


def ned_from_geodetic(
    latitude_deg: float, longitude_deg: float, height_m: float, origin: tuple[float, float, float]
) -> np.ndarray:
    """North, east, down in m from an origin (latitude deg, longitude deg, height m); for places
    near by.
    """
    there, here = np.radians((latitude_deg, longitude_deg)), np.radians(origin[:2])
    return np.array(ned_between((here[0], here[1], origin[2]), (there[0], there[1], height_m)))
