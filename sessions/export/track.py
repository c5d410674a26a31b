"""Tracks as KML 2.2 and GPX 1.1. Latitude and longitude in degrees of WGS-84, height in metres
above mean sea level, which is what both formats mean; where it is not known it is left out, and
said.
"""

import math
import xml.etree.ElementTree as ET
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

KML = "http://www.opengis.net/kml/2.2"
GPX = "http://www.topografix.com/GPX/1/1"
COLOURS = (
    "ff00a5ff",
    "ffb27200",
    "ff739e00",
    "ff005ed5",
    "ffa779cc",
    "ffe9b456",
)  # aabbggrr, told apart by all eyes

Tracks = dict[
    str, NDArray[np.float64]
]  # name -> (n, 4): utc s, latitude deg, longitude deg, height above mean sea level m or NaN

SEA_LEVEL = "Heights are above mean sea level, by the receiver's geoid."
NO_HEIGHT = "Heights above mean sea level are not known: the receiver gave none, or no geoid."
SOME_HEIGHTS = "Heights are above mean sea level, by the receiver's geoid; some are not known."


def _heights(track: NDArray[np.float64]) -> str:
    """In words, what the heights of a track are."""
    known = np.isfinite(track[:, 3])
    return SEA_LEVEL if known.all() else SOME_HEIGHTS if known.any() else NO_HEIGHT


def write_kml(path: Path, tracks: Tracks) -> Path:
    """One line per track."""
    root = ET.Element("kml", xmlns=KML)
    document = ET.SubElement(root, "Document")
    for k, (name, track) in enumerate(sorted(tracks.items())):
        style = ET.SubElement(ET.SubElement(document, "Style", id=f"s{k}"), "LineStyle")
        ET.SubElement(style, "color").text = COLOURS[k % len(COLOURS)]
        ET.SubElement(style, "width").text = "3"
        mark = ET.SubElement(document, "Placemark")
        ET.SubElement(mark, "name").text = name
        ET.SubElement(mark, "description").text = _heights(track)
        ET.SubElement(mark, "styleUrl").text = f"#s{k}"
        line = ET.SubElement(mark, "LineString")
        high = bool(np.isfinite(track[:, 3]).all())  # a line is drawn in one way
        ET.SubElement(line, "altitudeMode").text = "absolute" if high else "clampToGround"
        ET.SubElement(line, "coordinates").text = " ".join(
            f"{p[2]:.9f},{p[1]:.9f}" + (f",{p[3]:.4f}" if high else "") for p in track
        )
    return _write(path, root)


def write_gpx(path: Path, tracks: Tracks) -> Path:
    """One trk per track, with times."""
    root = ET.Element("gpx", version="1.1", creator="gyrofree", xmlns=GPX)
    for name, track in sorted(tracks.items()):
        part = ET.SubElement(root, "trk")
        ET.SubElement(part, "name").text = name
        ET.SubElement(part, "desc").text = _heights(track)
        segment = ET.SubElement(part, "trkseg")
        for utc, latitude, longitude, height in track:
            point = ET.SubElement(segment, "trkpt", lat=f"{latitude:.9f}", lon=f"{longitude:.9f}")
            if math.isfinite(height):
                ET.SubElement(point, "ele").text = f"{height:.4f}"
            when = datetime.fromtimestamp(utc, UTC).isoformat(timespec="milliseconds")
            ET.SubElement(point, "time").text = when.replace("+00:00", "Z")
    return _write(path, root)


def _write(path: Path, root: ET.Element) -> Path:
    ET.ElementTree(root).write(path, encoding="utf-8", xml_declaration=True)
    return path
