"""Places near by on the ellipsoid, without the compiler of earth.py, which takes longer to load
than this to run.
"""

import numpy as np

A, E2 = 6378137.0, 6.69437999014e-3  # WGS-84: semi-major axis, m; first eccentricity squared

Place = tuple[float, float, float]  # latitude, longitude, rad; ellipsoidal height, m


def ned_between(origin: Place, place: Place) -> tuple[float, float, float]:
    """Metres north, east and down of a place from an origin, by the radii of curvature there
    (E-20).

    Along the arcs of the ellipsoid, over the antimeridian too; good to centimetres within 10 km.
    """
    root = np.sqrt(1.0 - E2 * np.sin(origin[0]) ** 2)
    meridian, normal = A * (1.0 - E2) / root**3, A / root
    north = (place[0] - origin[0]) * (meridian + origin[2])
    east = (place[1] - origin[1] + np.pi) % (2.0 * np.pi) - np.pi
    return (
        float(north),
        float(east * (normal + origin[2]) * np.cos(origin[0])),
        float(origin[2] - place[2]),
    )
