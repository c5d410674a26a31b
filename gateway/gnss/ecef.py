"""Places and vectors of the Earth's own frame, x to Greenwich and z to the north pole, as old
receivers give them.
"""

import math

from inertial.constants import ECCENTRICITY2, FLATTENING, SEMI_MAJOR_AXIS

SEMI_MINOR_AXIS = SEMI_MAJOR_AXIS * (1.0 - FLATTENING)  # m
SECOND_ECCENTRICITY2 = ECCENTRICITY2 / (1.0 - ECCENTRICITY2)

Three = tuple[float, float, float]


def geodetic(x: float, y: float, z: float) -> Three:
    """Latitude, longitude (rad) and height (m) of a place of the Earth's frame near the ground, by
    Bowring's formula on WGS-84: exact to a micrometre there.
    """
    across = math.hypot(x, y)
    slant = math.atan2(z * SEMI_MAJOR_AXIS, across * SEMI_MINOR_AXIS)
    sin3, cos3 = math.sin(slant) ** 3, math.cos(slant) ** 3
    up = z + SECOND_ECCENTRICITY2 * SEMI_MINOR_AXIS * sin3
    latitude = math.atan2(up, across - ECCENTRICITY2 * SEMI_MAJOR_AXIS * cos3)
    normal = SEMI_MAJOR_AXIS / math.sqrt(1.0 - ECCENTRICITY2 * math.sin(latitude) ** 2)
    sin_l, cos_l = math.sin(latitude), math.cos(latitude)
    height = across * cos_l + z * sin_l - SEMI_MAJOR_AXIS**2 / normal
    return latitude, math.atan2(y, x), height


def turned_to_ned(latitude: float, longitude: float, x: float, y: float, z: float) -> Three:
    """A vector of the Earth's frame in north, east and down of a place (rad)."""
    sin_l, cos_l = math.sin(latitude), math.cos(latitude)
    sin_o, cos_o = math.sin(longitude), math.cos(longitude)
    level = cos_o * x + sin_o * y
    return cos_l * z - sin_l * level, cos_o * y - sin_o * x, -cos_l * level - sin_l * z
