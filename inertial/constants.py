"""Constants of physics and of the Earth: each once, with its unit and its source.

SI. Angles are in radians, so a rate is in rad/s.
"""

GRAVITY = 9.80665
"""m/s^2, standard acceleration of free fall (CGPM 1901). Sensors' data sheets mean it by g."""

MILLI_G = 9.80665e-3
"""m/s^2, of one mg."""

EARTH_RATE = 7.292115e-5
"""rad/s, rate of the Earth against the stars (WGS-84)."""

SEMI_MAJOR_AXIS = 6378137.0
"""m, of the ellipsoid (WGS-84)."""

FLATTENING = 1.0 / 298.257223563
"""of the ellipsoid (WGS-84)."""

ECCENTRICITY2 = 6.69437999014e-3
"""First eccentricity squared of the ellipsoid (WGS-84)."""

GEOID_SIGMA = 110.0
"""m, how far the sea is from the ellipsoid at most (EGM96: -107 to 86): what a height above sea
level is worth as one above the ellipsoid where nobody gives the geoid's."""

GRAVITY_EQUATOR = 9.7803253359
"""m/s^2, normal gravity at the equator (WGS-84)."""

GRAVITY_FORMULA = 0.00193185265241
"""Constant k of Somigliana's formula of normal gravity (WGS-84)."""

GRAVITY_RATIO = 0.00344978650684
"""Constant m of normal gravity above the ellipsoid, omega^2 a^2 b / GM (WGS-84)."""


def from_mg(mg: float) -> float:
    """m/s^2 of so many mg. Everybody who scales counts asks here: another order of the factors
    gives other last bits, and one log has to be one log by whichever way it comes.
    """
    return mg * 1e-3 * GRAVITY
