"""The Earth under a local navigation frame: WGS-84 radii, gravity, rates, places near by.

Latitude L and longitude l in rad, ellipsoidal height h in m up, frame n = north-east-down at the
vehicle. Numbers or arrays of one shape. Equations E-100 to E-102 of docs/equations-ins.md. The C++
twin, with the same bits, is core/common/earth.hpp.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from inertial.constants import (
    EARTH_RATE,
    ECCENTRICITY2,
    FLATTENING,
    GRAVITY_EQUATOR,
    GRAVITY_FORMULA,
    GRAVITY_RATIO,
    SEMI_MAJOR_AXIS,
)
from inertial.elementary import cos, sin, tan

Array = NDArray[np.float64]
Place = tuple[float, float, float]  # latitude, longitude, rad; ellipsoidal height, m


def radii(L: ArrayLike) -> tuple[Array, Array]:
    """Meridian and prime-vertical radius of curvature R_N, R_E, m (E-100)."""
    s = sin(L)
    root = np.sqrt(1.0 - ECCENTRICITY2 * s * s)
    return SEMI_MAJOR_AXIS * (1.0 - ECCENTRICITY2) / (root * root * root), SEMI_MAJOR_AXIS / root


def gravity(L: ArrayLike, h: ArrayLike) -> Array:
    """Magnitude of normal gravity at height h, m/s^2, along +D (E-101)."""
    s = sin(L)
    s2 = s * s
    surface = GRAVITY_EQUATOR * (1.0 + GRAVITY_FORMULA * s2) / np.sqrt(1.0 - ECCENTRICITY2 * s2)
    part = np.asarray(h) / SEMI_MAJOR_AXIS
    slope = 1.0 + FLATTENING + GRAVITY_RATIO - 2.0 * FLATTENING * s2
    return surface * (1.0 - 2.0 * part * slope + 3.0 * part * part)


def earth_rate(L: ArrayLike) -> tuple[Array, Array, Array]:
    """omega_ie_n, rad/s (E-102)."""
    return EARTH_RATE * cos(L), np.zeros(np.shape(L))[()], -EARTH_RATE * sin(L)


def transport_rate(
    L: ArrayLike, h: ArrayLike, v_north: ArrayLike, v_east: ArrayLike
) -> tuple[Array, Array, Array]:
    """omega_en_n, rad/s: n turns against the Earth because the vehicle moves over it (E-102)."""
    R_N, R_E = radii(L)
    return v_east / (R_E + h), -v_north / (R_N + h), -v_east * tan(L) / (R_E + h)


def ned_between(origin: Place, place: Place) -> tuple[Array, Array, Array]:
    """Metres north, east and down of a place from an origin, by the radii of curvature there.

    Along the arcs of the ellipsoid at the origin's height, over the antimeridian too; good to
    centimetres within 10 km. A place is latitude and longitude in rad and height in m.
    """
    (L0, l0, h0), (L, l, h) = origin, place
    R_N, R_E = radii(L0)
    east = (l - l0 + np.pi) % (2.0 * np.pi) - np.pi
    return (L - L0) * (R_N + h0), east * (R_E + h0) * cos(L0), h0 - h


def place_from_ned(
    origin: Place, north: ArrayLike, east: ArrayLike, down: ArrayLike
) -> tuple[Array, Array, Array]:
    """The place so many metres north, east and down of an origin: the inverse of `ned_between`, its
    longitude not brought back over the antimeridian.
    """
    L0, l0, h0 = origin
    R_N, R_E = radii(L0)
    north, east, down = (np.asarray(value, dtype=float) for value in (north, east, down))
    return L0 + north / (R_N + h0), l0 + east / ((R_E + h0) * cos(L0)), h0 - down
