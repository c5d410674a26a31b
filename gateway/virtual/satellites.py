"""What the simulated receiver says of the satellites that it sees: GSA and GSV of GPS and
Galileo.
"""

import datetime
import math

from gateway.gnss.stream import nmea_checksum
from inertial.simulation.satellites import GALILEO, GPS, Orbits, directions

SYSTEMS = (
    ("GP", 1, "1", GPS),
    ("GA", 3, "7", GALILEO),
)  # talker, system id, signal L1 C/A or E1 BC
MASK_DEG = 10.0  # lower ones are seen, and not used
MOST_USED = 12  # of a system: what a GSA has room for
ZENITH_DBHZ, HORIZON_DBHZ, FADING_DBHZ = 48.0, 31.0, 1.5

Seen = tuple[int, int, int, int]  # number, elevation deg, azimuth deg, C/N0 dB-Hz


def of_sky(utc: datetime.datetime, place: tuple[float, float, float]) -> bytes:
    """The sentences of one epoch; place: latitude and longitude in deg, height."""
    gsa, gsv = b"", b""
    for talker, system, signal, orbits in SYSTEMS:
        seen = _seen(orbits, utc.timestamp(), place)
        gsa += _gsa(system, [one[0] for one in seen if one[1] >= MASK_DEG][:MOST_USED])
        parts = [seen[k : k + 4] for k in range(0, len(seen), 4)] or [[]]
        for number, part in enumerate(parts, 1):
            cells = [
                f"{v:0{width}d}" for s in part for v, width in zip(s, (2, 2, 3, 2), strict=True)
            ]
            head = [str(len(parts)), str(number), f"{len(seen):02d}"]
            gsv += _sentence(f"{talker}GSV", *head, *cells, signal)
    return gsa + gsv


def _seen(orbits: Orbits, t_s: float, place: tuple[float, float, float]) -> list[Seen]:
    elevations, azimuths = directions(orbits, t_s, math.radians(place[0]), math.radians(place[1]))
    found = []
    for number, (elevation, azimuth) in enumerate(zip(elevations, azimuths, strict=True), 1):
        if elevation > 0.0:
            rise = (ZENITH_DBHZ - HORIZON_DBHZ) * math.sin(elevation)
            fading = FADING_DBHZ * math.sin(t_s / 17.0 + 2.4 * number)
            power = HORIZON_DBHZ + rise + fading
            degrees = round(math.degrees(elevation)), round(math.degrees(azimuth)) % 360
            found.append((number, *degrees, round(power)))
    return found


def _gsa(system: int, used: list[int]) -> bytes:
    slots = [f"{number:02d}" for number in used] + [""] * (12 - len(used))
    return _sentence("GNGSA", "A", "3", *slots, "1.6", "0.9", "1.3", str(system))


def _sentence(*fields: str) -> bytes:
    body = ",".join(fields).encode()
    return b"$%s*%02X\r\n" % (body, nmea_checksum(body))
