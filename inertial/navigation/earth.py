"""The Earth under a local navigation frame: WGS-84 radii, gravity, rates.

Latitude L in rad, ellipsoidal height h in m up, frame n = north-east-down at the vehicle. Equations
E-20 to E-22 of docs/equations-ins.md. Compiled functions: scalars in, tuples of scalars out.
"""

import math

from numba import njit

A = 6378137.0  # m, semi-major axis, WGS-84
E2 = 6.69437999014e-3  # first eccentricity squared, WGS-84
FLATTENING = 1.0 / 298.257223563  # WGS-84
OMEGA = 7.292115e-5  # rad/s, rate of the Earth, WGS-84
GRAVITY_EQUATOR = 9.7803253359  # m/s^2, WGS-84 normal gravity
SOMIGLIANA = 0.00193185265241  # WGS-84, Somigliana's constant k
GRAVITY_M = 0.00344978650684  # omega^2 a^2 b / GM, WGS-84


@njit(cache=True)
def radii(L: float) -> tuple[float, float]:
    """Meridian and prime-vertical radius of curvature R_N, R_E, m (E-20)."""
    s = math.sin(L)
    root = math.sqrt(1.0 - E2 * s * s)
    return A * (1.0 - E2) / (root * root * root), A / root


@njit(cache=True)
def gravity(L: float, h: float) -> float:
    """Magnitude of normal gravity at height h, m/s^2, along +D (E-21)."""
    s2 = math.sin(L) ** 2
    surface = GRAVITY_EQUATOR * (1.0 + SOMIGLIANA * s2) / math.sqrt(1.0 - E2 * s2)
    height = (
        1.0
        - 2.0 * h / A * (1.0 + FLATTENING + GRAVITY_M - 2.0 * FLATTENING * s2)
        + 3.0 * (h / A) ** 2
    )
    return surface * height


@njit(cache=True)
def earth_rate(L: float) -> tuple[float, float, float]:
    """w_ie^n, rad/s (E-22)."""
    return OMEGA * math.cos(L), 0.0, -OMEGA * math.sin(L)


@njit(cache=True)
def transport_rate(L: float, h: float, vN: float, vE: float) -> tuple[float, float, float]:
    """w_en^n, rad/s: n turns against the Earth because the vehicle moves over it (E-22)."""
    R_N, R_E = radii(L)
    return vE / (R_E + h), -vN / (R_N + h), -vE * math.tan(L) / (R_E + h)


@njit(cache=True)
def ned_between(
    L0: float, l0: float, h0: float, L: float, l: float, h: float
) -> tuple[float, float, float]:
    """Metres north, east and down from point 0, along the arcs of the ellipsoid at its height; for
    local distances.
    """
    R_N, R_E = radii(L0)
    east = (l - l0 + math.pi) % (2.0 * math.pi) - math.pi  # over the antimeridian too
    return (L - L0) * (R_N + h0), east * (R_E + h0) * math.cos(L0), h0 - h
