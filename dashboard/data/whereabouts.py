"""Where a device is by its receiver and by every navigation filter, as a map draws it.

A browser gets a way once and then what grew: it says which state of it, and how many of its points,
it has. What is not known is None, and why stands beside it.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from dashboard.data.device import Device
from dashboard.data.live import finite
from dashboard.data.pose import yaw_of
from dashboard.data.track import Track
from inertial.earth import place_from_ned
from logs.figures.names import estimator_colour, estimator_title
from messages.contract import gyrofree_pb2 as pb

POINTS = 4000  # of a way in one answer; the rest comes with the next
FIXES = 1500  # likewise, of those older than the newest
SIGMAS = 2.0  # of the accuracy ellipse
NO_HEADING_RAD = math.radians(30.0)  # one sigma, from which a heading is none
NO_PLACE_M = 1e4  # one sigma, from which a place is none
QUALITIES = {
    pb.GnssFix.QUALITY_NONE: "none",
    pb.GnssFix.QUALITY_AUTONOMOUS: "autonomous",
    pb.GnssFix.QUALITY_DIFFERENTIAL: "differential",
    pb.GnssFix.QUALITY_RTK_FLOAT: "RTK float",
    pb.GnssFix.QUALITY_RTK_FIXED: "RTK fixed",
    pb.GnssFix.QUALITY_DEAD_RECKONING: "dead reckoning",
}
Told = dict[str, Any]


@dataclass(frozen=True)
class Known:
    """What a browser has of a way."""

    state: str  # of the points; they are void when it differs
    points: int


def whereabouts(device: Device, have: dict[str, Known], since_s: float) -> Told:
    """Ways, fixes later than since_s, and the newest place of each. Call under the store's lock."""
    names = device.estimators("nav")
    return {
        "device": device.name,
        "run": f"{device.generation}",
        "receiver": _receiver(device),
        "fixes": _fixes(device, since_s),
        "rejected": _way(device, "rejected", have.get("rejected")),
        "ways": [
            {
                "name": name,
                "title": estimator_title(name),
                "colour": estimator_colour(name, names),
                **_way(device, f"nav/{name}", have.get(name)),
                "now": _now(device, name),
            }
            for name in names
        ],
    }


def ellipse(covariance_ne: np.ndarray) -> tuple[float, float, float] | None:
    """Half axes, m, of SIGMAS sigma, the longer first, and the bearing of the longer, rad from
    north over east, of a covariance (2, 2), m^2; None for one that is none.
    """
    return ellipses(covariance_ne[None])[0]


def ellipses(covariance_ne: np.ndarray) -> list[tuple[float, float, float] | None]:
    """Likewise of each of many covariances (n, 2, 2), m^2."""
    known = np.isfinite(covariance_ne).all(axis=(1, 2))
    whole = np.where(known[:, None, None], covariance_ne, 0.0)
    values, vectors = np.linalg.eigh(0.5 * (whole + whole.swapaxes(1, 2)))
    least, greatest = values.T
    known &= (greatest > 0.0) & (least >= -1e-9 * np.maximum(np.abs(greatest), 1e-12))
    axes = SIGMAS * np.sqrt(np.maximum(values, 0.0))
    bearing = np.arctan2(vectors[:, 1, 1], vectors[:, 0, 1]) % math.pi
    rows = np.column_stack([axes[:, 1], axes[:, 0], bearing]).tolist()
    return [tuple(row) if is_one else None for row, is_one in zip(rows, known, strict=True)]


def _now(device: Device, name: str) -> Told:
    """The newest word of one filter; its place only while it navigates."""
    latest = device.get("nav", name)
    told: Told = {"latitude_deg": None, "longitude_deg": None, "ellipse": None, "heading_rad": None}
    if latest is None:
        return told | {"why": "has said nothing yet", "stale": True}
    m = latest.message
    told["stale"] = device.stale("nav", name)
    if m.mode != pb.NavSolution.MODE_NAVIGATING:
        return told | {"why": m.alignment or "waits for data"}
    covariance = np.full((3, 3), np.nan)
    if len(m.position_covariance) == 9:
        covariance = np.reshape(np.array(m.position_covariance), (3, 3))
    found = ellipse(covariance[:2, :2])
    if found is not None and found[0] > SIGMAS * NO_PLACE_M:
        return told | {"why": f"its place is uncertain by {found[0] / 1e3:.0f} km"}
    if not (math.isfinite(m.latitude_deg) and math.isfinite(m.longitude_deg)):
        return told | {"why": "it gives no place"}
    why = [] if found is not None else ["it does not say how certain its place is"]
    heading = yaw_of(m.q_nb)
    sigma = float(m.sigma[2]) if len(m.sigma) > 2 else math.nan
    if not math.isfinite(heading) or not sigma < NO_HEADING_RAD:
        why.append("its heading is not known")
        heading = math.nan
    if m.gnss_muted:
        why.append("fixes are held back")
    return told | {
        "latitude_deg": m.latitude_deg,
        "longitude_deg": m.longitude_deg,
        "ellipse": found,
        "heading_rad": finite(heading),
        "heading_sigma_rad": finite(sigma),
        "why": "; ".join(why),
    }


def _receiver(device: Device) -> Told:
    latest = device.get("gnss")
    if latest is None:
        return {"quality": "none", "why": "no receiver speaks of this device", "stale": True}
    m = latest.message
    stale = device.stale("gnss")
    told: Told = {"quality": QUALITIES.get(m.quality, "none"), "stale": stale}
    told["satellites"] = m.satellites or None  # a position by no satellite: it does not say
    if m.quality == pb.GnssFix.QUALITY_NONE:
        return told | {"why": "the receiver has no satellite fix"}
    known = len(m.position_sigma_ned_m) == 3
    level = SIGMAS * max(m.position_sigma_ned_m[:2]) if known else None
    why = "" if known else "the receiver does not say how certain it is"
    if stale:
        why = f"silent for {latest.age():.0f} s"
    return told | {"accuracy_m": level, "why": why}


def _fixes(device: Device, since_s: float) -> Told:
    t, rows = device.window("gnss", "", since_s + 1e-6, math.inf)
    if len(t) > FIXES:
        step = -(-len(t) // FIXES)
        t, rows = t[(len(t) - 1) % step :: step], rows[(len(t) - 1) % step :: step]
    sigma = rows["sigma_p_n"][:, :2]
    return {
        "t": np.round(t, 3).tolist(),
        "latitude_deg": rows["latitude"].tolist(),
        "longitude_deg": rows["longitude"].tolist(),
        "quality": [QUALITIES.get(int(one), "none") for one in rows["quality"]],
        "accuracy_ne_m": [
            [SIGMAS * float(n), SIGMAS * float(e)] if math.isfinite(n + e) else None
            for n, e in sigma
        ],
    }


def _way(device: Device, key: str, known: Known | None) -> Told:
    """Points of a track that the browser does not have."""
    track = device.tracks.get(key)
    if track is None or device.origin is None:
        return {"state": "", "from": 0, "latitude_deg": [], "longitude_deg": []}
    state = f"{device.generation}.{track.thinned}.{hash(device.origin) & 0xFFFFFF:x}"
    begin = known.points if known is not None and known.state == state else 0
    points = np.array(_points(track, begin, POINTS)).reshape(-1, 3)
    latitude, longitude, height = device.origin
    origin = math.radians(latitude), math.radians(longitude), height
    lat, lon, _ = place_from_ned(origin, points[:, 0], points[:, 1], 0.0)
    return {
        "state": state,
        "from": begin,
        "latitude_deg": np.round(np.degrees(lat), 9).tolist(),
        "longitude_deg": np.round(np.degrees(lon), 9).tolist(),
    }


def _points(track: Track, begin: int, most: int) -> list[tuple[float, float, float]]:
    """At most so many points of a track from one on; pieces share a point, which counts twice."""
    found: list[tuple[float, float, float]] = []
    for piece in track.pieces:
        if begin < len(piece):
            found += piece[begin : begin + most - len(found)]
            if len(found) >= most:
                return found
        begin = max(0, begin - len(piece))
    return found
