"""Attitude and place of a message as the numbers that stand in tables."""

import math
from collections.abc import Sequence

import numpy as np

from inertial.navigation.geodetic import ned_between


def roll_pitch(q_nb: Sequence[float]) -> tuple[float, float]:
    """Roll and pitch in rad of q_nb (4,), w x y z."""
    w, x, y, z = q_nb
    return (
        math.atan2(2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
        math.asin(max(-1.0, min(1.0, 2.0 * (w * y - x * z)))),
    )


def yaw_of(q_nb: Sequence[float]) -> float:
    """Heading of q_nb (4,) w x y z, rad; NaN for none."""
    if len(q_nb) != 4:
        return math.nan
    w, x, y, z = q_nb
    return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


def ned_from_geodetic(
    latitude_deg: float, longitude_deg: float, height_m: float, origin: tuple[float, float, float]
) -> np.ndarray:
    """North, east, down in m from an origin (latitude deg, longitude deg, height m); for places
    near by.
    """
    there, here = np.radians((latitude_deg, longitude_deg)), np.radians(origin[:2])
    return np.array(ned_between((here[0], here[1], origin[2]), (there[0], there[1], height_m)))
