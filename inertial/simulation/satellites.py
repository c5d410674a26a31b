"""Where satellites stand in the sky of a place: nominal circular orbits, evenly spread, good enough
to have their number, their directions and the way these turn over an hour as they really are.
"""

import math
from dataclasses import dataclass

import numpy as np

from inertial.constants import EARTH_RATE

GM = 3.986004418e14  # m^3/s^2, of the Earth with its atmosphere, WGS-84


@dataclass(frozen=True)
class Orbits:
    """A Walker constellation: satellites evenly in planes, planes evenly about the pole."""

    radius_m: float
    inclination_rad: float
    satellites: int
    planes: int
    phasing: int  # of 360 deg / satellites, from a plane to the next
    node_rad: float = 0.0  # of the first plane


GPS = Orbits(26_559_700.0, math.radians(55.0), 24, 6, 1)
GALILEO = Orbits(29_600_300.0, math.radians(56.0), 24, 3, 1, math.radians(20.0))


def positions_e(orbits: Orbits, t_s: float) -> np.ndarray:
    """(n, 3) m in e, t_s seconds after some moment at which i and e agree."""
    each = orbits.satellites // orbits.planes
    number = np.arange(orbits.satellites)
    plane, place = number // each, number % each
    turn = 2.0 * math.pi
    motion = math.sqrt(GM / orbits.radius_m**3)
    along = turn * (place / each + orbits.phasing * plane / orbits.satellites) + motion * t_s
    node = orbits.node_rad + turn * plane / orbits.planes - EARTH_RATE * t_s
    x, y = np.cos(along), np.sin(along) * math.cos(orbits.inclination_rad)
    z = np.sin(along) * math.sin(orbits.inclination_rad)
    unit = [x * np.cos(node) - y * np.sin(node), x * np.sin(node) + y * np.cos(node), z]
    return orbits.radius_m * np.column_stack(unit)


def directions(
    orbits: Orbits, t_s: float, latitude: float, longitude: float, radius_m: float = 6_371_000.0
) -> tuple[np.ndarray, np.ndarray]:
    """Elevation and azimuth (n,), rad, of all satellites, those below the horizon too; latitude and
    longitude of the place in rad on a round Earth.
    """
    lat, lon = latitude, longitude
    up = np.array([math.cos(lat) * math.cos(lon), math.cos(lat) * math.sin(lon), math.sin(lat)])
    east = np.array([-math.sin(lon), math.cos(lon), 0.0])
    north = np.cross(up, east)
    sight = positions_e(orbits, t_s) - radius_m * up
    sight /= np.linalg.norm(sight, axis=1, keepdims=True)
    n, e, u = ((sight * axis).sum(axis=1) for axis in (north, east, up))
    return np.arcsin(np.clip(u, -1.0, 1.0)), np.arctan2(e, n) % (2.0 * math.pi)
