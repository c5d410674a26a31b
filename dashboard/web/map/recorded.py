"""Where filters and receiver were in a recording, and its sky, as a browser draws them."""

from pathlib import Path
from typing import Any

import numpy as np

from dashboard.data.whereabouts import QUALITIES, ellipses
from dashboard.scene.drawing.sky import said, sky_svg
from inertial.earth import place_from_ned
from logs.figures.names import line_colour, line_title
from sessions.library.curves import Curves
from sessions.library.sky import sky_near

POINTS = 4000  # of each way
SVG = '<svg xmlns="http://www.w3.org/2000/svg"'
Way = dict[str, Any]


def ways_of(curves: Curves) -> list[Way]:
    """Each track of a session, latitude and longitude in deg; a receiver's fixes as dots."""
    ways = []
    for key, track in curves.tracks.items():
        every = max(1, -(-len(track.points) // POINTS))
        points, told = track.points[::every], track.told[::every]
        finite = np.isfinite(points[:, 1:3]).all(axis=1)
        points, told = points[finite], told[finite]
        if not len(points):
            continue
        device, name = key.split("/", 1)
        name = name.removeprefix("nav/")
        latitude, longitude, _ = place_from_ned(track.origin, points[:, 1], points[:, 2], 0.0)
        ways.append(
            {
                "key": key,
                "device": device,
                "title": line_title(name),
                "colour": line_colour(name),
                "dots": key.endswith("/gnss"),
                "t": np.round(points[:, 0], 2).tolist(),
                "latitude_deg": np.round(np.degrees(latitude), 9).tolist(),
                "longitude_deg": np.round(np.degrees(longitude), 9).tolist(),
                # of 2 sigma: longer and shorter half axis, m, and bearing of the longer, rad
                "ellipse": [one and [float(f"{v:.4g}") for v in one] for one in _ellipses(told)],
                "quality": [QUALITIES.get(int(one), "none") for one in told[:, 3]],
            }
        )
    return ways


def _ellipses(told: np.ndarray) -> list[tuple[float, float, float] | None]:
    return ellipses(told[:, [0, 1, 1, 2]].reshape(-1, 2, 2))


def sky_at(path: Path, at_s: float, dark: bool) -> dict[str, Any] | None:
    """The sky near a moment: when, in words, and drawn; None without one. Raises OSError."""
    found = sky_near(path, at_s)
    if found is None:
        return None
    t_s, sky = found
    # on its own, not within a page, it has to say what it is
    drawn = str(sky_svg(sky.satellites, dark)).replace("<svg", SVG, 1)
    return {"t_s": round(t_s, 2), "said": said(sky.satellites), "svg": drawn}
