"""NMEA 0183 sentences with a right checksum become records: GGA, GNS, RMC, GLL, VTG, GST, GSA and
ZDA of any talker.
"""

from collections.abc import Callable
from dataclasses import dataclass
from datetime import date
from typing import Any

from gateway.gnss.fields import (
    HEIGHTS_M,
    MOST_SATELLITES,
    MOST_SPEED_MPS,
    Fields,
    Refused,
    said_sigma,
)

KNOT = 1852.0 / 3600.0  # m/s
NONE, AUTONOMOUS, DIFFERENTIAL, RTK_FLOAT, RTK_FIXED, DEAD_RECKONING = range(
    6
)  # as GnssFix.Quality
GGA_QUALITY = {
    1: AUTONOMOUS,
    2: DIFFERENTIAL,
    3: AUTONOMOUS,
    4: RTK_FIXED,
    5: RTK_FLOAT,
    6: DEAD_RECKONING,
}
# letters of the mode field, the best first; S simulator, M manual and N none are no fix
MODES = {
    "R": RTK_FIXED,
    "F": RTK_FLOAT,
    "D": DIFFERENTIAL,
    "P": AUTONOMOUS,
    "A": AUTONOMOUS,
    "E": DEAD_RECKONING,
}
LETTERS = "ADEFMNPRSUV"
UNDULATIONS_M = (-120.0, 120.0)  # of the geoid: -106 to 85
MOST_SIGMA_M = 1e5


@dataclass(frozen=True)
class Sentence:
    """What one sentence says; None: it does not."""

    name: str
    talker: str
    tod_ns: int | None = None
    day: date | None = None
    quality: int | None = None
    place: tuple[float, float] | None = None  # deg
    altitude_m: float | None = None  # above mean sea level
    separation_m: float | None = None  # geoid above the ellipsoid
    speed_mps: float | None = None
    course_deg: float | None = None
    sigma_m: tuple[float, float, float] | None = None  # north, east, up
    dimensions: int | None = None  # of the fix: 0, 2 or 3
    vdop: float = 0.0
    satellites: int = 0
    hdop: float = 0.0


def sentence_of(line: bytes) -> Sentence | None:
    """A sentence from $ to its checksum; None when it is none of those that are read. Raises
    Refused.
    """
    fields = line[1:].partition(b"*")[0].decode("latin-1").split(",")
    talker, name = fields[0][:-3], fields[0][-3:]
    reader = READERS.get(name)
    if reader is None or talker[:1] == "P":
        return None
    return Sentence(name, talker, **reader(Fields(name, fields)))


def _position_of(f: Fields, height_at: int) -> dict[str, Any]:
    """Satellites, HDOP and the heights that stand two places on, as in GGA and GNS."""
    satellites = f.number(height_at - 2, "satellites", 0.0, MOST_SATELLITES)
    return {
        "satellites": int(satellites or 0),
        "hdop": f.number(height_at - 1, "HDOP", 0.0, 1e4) or 0.0,
        "altitude_m": f.number(height_at, "altitude", *HEIGHTS_M),
    }


def _gga(f: Fields) -> dict[str, Any]:
    f.letter(10, "altitude's unit", "M")
    f.letter(12, "separation's unit", "M")
    return {
        "tod_ns": f.time_of_day(1),
        "place": f.place(2),
        "quality": GGA_QUALITY.get(int(f.number(6, "quality", 0.0, 9.0) or 0), NONE),
        "separation_m": f.number(11, "separation", *UNDULATIONS_M),
        **_position_of(f, 9),
    }


def _gns(f: Fields) -> dict[str, Any]:
    modes = f.text(6)
    if len(modes) > 10 or any(letter not in LETTERS for letter in modes):
        raise Refused("GNS", "mode")
    return {
        "tod_ns": f.time_of_day(1),
        "place": f.place(2),
        "quality": next((MODES[m] for m in MODES if m in modes), NONE),
        "separation_m": f.number(10, "separation", *UNDULATIONS_M),
        **_position_of(f, 9),
    }


def _mode_of(f: Fields, status_at: int, mode_at: int) -> int:
    """Quality of status A or V and the mode letter that newer receivers give."""
    status, mode = f.letter(status_at, "status", "AV"), f.letter(mode_at, "mode", LETTERS)
    if status != "A":
        return NONE
    return MODES.get(mode, NONE) if mode else AUTONOMOUS


def _rmc(f: Fields) -> dict[str, Any]:
    day = f.text(9)
    if day and len(day) != 6:
        raise Refused("RMC", "date")
    quality = _mode_of(f, 2, 12)
    speed = f.number(7, "speed", 0.0, MOST_SPEED_MPS / KNOT)
    return {
        "tod_ns": f.time_of_day(1),
        "place": f.place(3),
        "quality": quality,
        "day": f.day(day[4:6], day[2:4], day[:2]),
        "speed_mps": speed * KNOT if speed is not None and quality != NONE else None,
        "course_deg": f.number(8, "course", 0.0, 360.0),
    }


def _gll(f: Fields) -> dict[str, Any]:
    return {"place": f.place(1), "tod_ns": f.time_of_day(5), "quality": _mode_of(f, 6, 7)}


def _vtg(f: Fields) -> dict[str, Any]:
    with_letters = f.text(2) in ("T", "") and f.text(6) in ("N", "")  # before version 2: without
    speed = f.number(5 if with_letters else 3, "speed", 0.0, MOST_SPEED_MPS / KNOT)
    course = f.number(1, "course", 0.0, 360.0)
    if f.letter(9, "mode", LETTERS) == "N":
        speed = None
    return {"speed_mps": None if speed is None else speed * KNOT, "course_deg": course}


def _gst(f: Fields) -> dict[str, Any]:
    sigma = said_sigma([f.number(k, "sigma", 0.0, MOST_SIGMA_M) for k in (6, 7, 8)])
    return {"tod_ns": f.time_of_day(1), "sigma_m": sigma}


def _gsa(f: Fields) -> dict[str, Any]:
    mode = f.number(2, "mode", 1.0, 3.0)
    return {
        "dimensions": None if mode is None else (0, 2, 3)[int(mode) - 1],
        "hdop": f.number(16, "HDOP", 0.0, 1e4) or 0.0,
        "vdop": f.number(17, "VDOP", 0.0, 1e4) or 0.0,
    }


def _zda(f: Fields) -> dict[str, Any]:
    return {"tod_ns": f.time_of_day(1), "day": f.day(f.text(4), f.text(3), f.text(2))}


READERS: dict[str, Callable[[Fields], dict[str, Any]]] = {
    "GGA": _gga,
    "GNS": _gns,
    "RMC": _rmc,
    "GLL": _gll,
    "VTG": _vtg,
    "GST": _gst,
    "GSA": _gsa,
    "ZDA": _zda,
}
