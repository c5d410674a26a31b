"""Satellites as receivers name them: one NMEA GSV or GSA sentence, one UBX NAV-SAT or NAV-SVINFO
message, each with a right checksum, become records.

NMEA numbers satellites by the talker, and where the talker is GN, or an old receiver puts other
systems under GP, by ranges (NMEA 0183 4.11, u-blox UBX-18010854). What a receiver leaves empty, or
marks as unknown by a number out of range, is None.
"""

import struct
from dataclasses import dataclass

from gateway.gnss.fields import Fields, Refused, within

# as pb.Sky.Constellation
UNKNOWN, GPS, SBAS, GALILEO, BEIDOU, QZSS, GLONASS, NAVIC = range(8)
TALKERS = {
    "GP": GPS,
    "GL": GLONASS,
    "GA": GALILEO,
    "GB": BEIDOU,
    "BD": BEIDOU,
    "GQ": QZSS,
    "QZ": QZSS,
    "GI": NAVIC,
}
SYSTEM_IDS = {"1": "GP", "2": "GL", "3": "GA", "4": "GB", "5": "GQ", "6": "GI"}  # GSA's last field
UBX_IDS = {0: GPS, 1: SBAS, 2: GALILEO, 3: BEIDOU, 5: QZSS, 6: GLONASS, 7: NAVIC}  # gnssId
# (first, last, system, what to take off for the number within it), NMEA's and NAV-SVINFO's
NMEA_RANGES = (
    (1, 32, GPS, 0),
    (33, 64, SBAS, -87),
    (65, 99, GLONASS, 64),
    (120, 158, SBAS, 0),
    (193, 200, QZSS, 192),
    (201, 263, BEIDOU, 200),
    (301, 336, GALILEO, 300),
    (401, 463, BEIDOU, 400),
)
SVINFO_RANGES = (
    (1, 32, GPS, 0),
    (33, 64, BEIDOU, 27),
    (65, 96, GLONASS, 64),
    (120, 158, SBAS, 0),
    (159, 163, BEIDOU, 158),
    (193, 202, QZSS, 192),
    (211, 246, GALILEO, 210),
    (255, 255, GLONASS, 0),
)
OWN_COUNTS = {GLONASS: 32, GALILEO: 36, BEIDOU: 63, QZSS: 10, NAVIC: 14}  # numbers from 1 on
MOST_PARTS = 32  # sentences of one system and signal
MOST_CN0 = 99.0  # dB-Hz
IN_SENTENCE = 4  # satellites of one GSV
GSA_SLOTS = 12  # satellites that one GSA has room for
SAT_HEAD, SAT = struct.Struct("<IBBxx"), struct.Struct("<BBBbhhI")
SVINFO_HEAD, SVINFO = struct.Struct("<IBBxx"), struct.Struct("<BBBBBbhi")
SAT_USED, SVINFO_USED = 8, 1  # bits of the flags

Identity = tuple[int, int]  # system, number within it


@dataclass(frozen=True)
class Satellite:
    """One satellite as the receiver sees it; None: it does not say."""

    system: int
    number: int
    elevation_deg: float | None
    azimuth_deg: float | None
    cn0_dbhz: float | None
    used: bool | None = None  # in the fix
    signals: int = 0  # tracked

    @property
    def identity(self) -> Identity:
        """Which it is."""
        return self.system, self.number


@dataclass(frozen=True)
class View:
    """One GSV sentence: part `part` of `parts` that the talker says of one signal."""

    talker: str
    signal: str
    part: int
    parts: int
    satellites: tuple[Satellite, ...]


@dataclass(frozen=True)
class Active:
    """One GSA sentence: satellites in use; `full`: there may be more than it has room for."""

    used: frozenset[Identity]
    full: bool


def identity(talker: str, number: int) -> Identity:
    """Which satellite a number of NMEA means."""
    system = TALKERS.get(talker, UNKNOWN)
    if system in OWN_COUNTS and 1 <= number <= OWN_COUNTS[system]:
        return system, number
    return _ranged(NMEA_RANGES, number)


def _ranged(ranges: tuple[tuple[int, int, int, int], ...], number: int) -> Identity:
    for first, last, system, off in ranges:
        if first <= number <= last:
            return system, number - off
    return UNKNOWN, number


def fields_of(line: bytes) -> tuple[str, Fields, int]:
    """Talker, fields and their count of a sentence from $ to its checksum."""
    fields = line[1:].partition(b"*")[0].decode("latin-1").split(",")
    return fields[0][:-3], Fields(fields[0][-3:], fields), len(fields)


def view_of(line: bytes) -> View:
    """A GSV sentence. Raises Refused."""
    talker, f, count = fields_of(line)
    parts, part = _whole(f, 1, "parts", 1, MOST_PARTS), _whole(f, 2, "part", 1, MOST_PARTS)
    if part > parts:
        raise Refused("GSV", "part")
    f.number(3, "satellites in view", 0.0, 999.0)
    n, rest = divmod(count - 4, 4)
    if count < 4 or rest > 1 or n > IN_SENTENCE:
        raise Refused("GSV", "length")
    signal = f.letter(count - 1, "signal", "0123456789ABCDEF") if rest else ""
    found = (_seen(f, talker, 4 + 4 * k) for k in range(n))
    return View(talker, signal, part, parts, tuple(s for s in found if s is not None))


def _whole(f: Fields, place: int, what: str, low: int, high: int) -> int:
    value = f.number(place, what, low, high)
    if value is None or value != int(value):
        raise Refused("GSV", what)
    return int(value)


def _seen(f: Fields, talker: str, at: int) -> Satellite | None:
    """The four fields of one satellite; None for an empty place."""
    number = f.number(at, "satellite", 1.0, 999.0)
    elevation = f.number(at + 1, "elevation", -90.0, 90.0)
    azimuth = f.number(at + 2, "azimuth", 0.0, 360.0)
    cn0 = f.number(at + 3, "C/N0", 0.0, MOST_CN0)
    if (number, elevation, azimuth, cn0) == (None, None, None, None):
        return None
    # heard, and not known yet which it is: receivers say so of GLONASS before they have its slot
    which = (TALKERS.get(talker, UNKNOWN), 0) if number is None else identity(talker, int(number))
    return Satellite(*which, elevation, azimuth, cn0 or None, signals=int(bool(cn0)))


def active_of(line: bytes) -> Active:
    """A GSA sentence. Raises Refused."""
    talker, f, count = fields_of(line)
    if count > 18:
        talker = SYSTEM_IDS.get(f.text(18), talker)
    numbers = [f.number(3 + k, "satellite", 0.0, 999.0) for k in range(GSA_SLOTS)]
    used = [identity(talker, int(number)) for number in numbers if number]
    return Active(frozenset(used), len(used) == GSA_SLOTS)


def satellites_of(data: bytes) -> list[Satellite] | None:
    """A UBX message from its sync bytes to its checksum; None when it says nothing of satellites.
    Raises Refused.
    """
    payload = data[6:-2]
    match data[2:4]:
        case b"\x01\x35":
            return _nav_sat(payload)
        case b"\x01\x30":
            return _svinfo(payload)
    return None


def _blocks(name: str, payload: bytes, head: struct.Struct, block: struct.Struct, count: int):
    if len(payload) != head.size + count * block.size:
        raise Refused(name, "length")
    return block.iter_unpack(payload[head.size :])


def _nav_sat(payload: bytes) -> list[Satellite]:
    if len(payload) < SAT_HEAD.size:
        raise Refused("NAV-SAT", "length")
    _, version, count = SAT_HEAD.unpack_from(payload)
    if version != 1:
        raise Refused("NAV-SAT", "version")
    found = []
    for system, number, cn0, elevation, azimuth, _, flags in _blocks(
        "NAV-SAT", payload, SAT_HEAD, SAT, count
    ):
        place = _direction("NAV-SAT", elevation, azimuth)
        power = within("NAV-SAT", "C/N0", cn0, 0.0, MOST_CN0) or None
        which = UBX_IDS.get(system, UNKNOWN), number
        found.append(Satellite(*which, *place, power, bool(flags & SAT_USED), int(bool(power))))
    return found


def _svinfo(payload: bytes) -> list[Satellite]:
    """Of protocol 6 to 15; a satellite may have several channels."""
    if len(payload) < SVINFO_HEAD.size:
        raise Refused("NAV-SVINFO", "length")
    _, count, _ = SVINFO_HEAD.unpack_from(payload)
    found = []
    for _, number, flags, _, cn0, elevation, azimuth, _ in _blocks(
        "NAV-SVINFO", payload, SVINFO_HEAD, SVINFO, count
    ):
        place = _direction("NAV-SVINFO", elevation, azimuth)
        power = within("NAV-SVINFO", "C/N0", cn0, 0.0, MOST_CN0) or None
        which = _ranged(SVINFO_RANGES, number)
        found.append(Satellite(*which, *place, power, bool(flags & SVINFO_USED), int(bool(power))))
    return found


def _direction(name: str, elevation: float, azimuth: float) -> tuple[float | None, float | None]:
    """Elevation and azimuth, deg; an elevation beyond the zenith stands for one not known."""
    if not -90 <= elevation <= 90:
        return None, None
    return float(elevation), within(name, "azimuth", float(azimuth), 0.0, 360.0)
