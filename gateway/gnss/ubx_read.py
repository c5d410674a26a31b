"""UBX navigation messages with a right checksum become records (u-blox interface descriptions of
generations 6 to 9). What an accuracy says to be nothing is None.

NAV-PVT   all in one                     NAV-HPPOSLLH  position to a tenth of a millimetre
NAV-POSLLH, NAV-VELNED, NAV-SOL, NAV-STATUS, NAV-TIMEUTC   the same piece by piece, protocol 6 to 15
NAV-COV   covariances
"""

import math
import struct
from collections.abc import Callable
from dataclasses import dataclass
from datetime import date

from gateway.gnss.ecef import geodetic, turned_to_ned
from gateway.gnss.fields import (
    DAY_S,
    MOST_SATELLITES,
    MOST_SPEED_MPS,
    Refused,
    day_of,
    height_or_none,
    said_sigma,
    utc_ns_of,
    within,
)
from gateway.gnss.nmea import AUTONOMOUS, DEAD_RECKONING, DIFFERENTIAL, NONE, RTK_FIXED, RTK_FLOAT

WEEK_MS = 7 * DAY_S * 1000
MOST_ACCURACY_M = 10e3  # a position or height that is no better is none
MOST_SPEED_ACCURACY_MPS = 50.0
FIX_2D = 2
DATED, TIMED, RESOLVED = (
    1,
    2,
    4,
)  # bits of NAV-PVT's valid; before the last, leap seconds are guessed
UTC_KNOWN = 4  # bit of NAV-TIMEUTC's valid
GEOCENTRE_M = (6.2e6, 6.6e6)  # distance of an antenna from it

PVT = struct.Struct("<IHBBBBBBIiBBBBiiiiIIiiiiiIIHH")
HPPOSLLH = struct.Struct("<xxxBIiiiibbbbII")
POSLLH = struct.Struct("<IiiiiII")
VELNED = struct.Struct("<IiiiIIiII")
SOL = struct.Struct("<IihBBiiiIiiiIH")
STATUS = struct.Struct("<IBB")
TIMEUTC = struct.Struct("<IIiHBBBBBB")
COV = struct.Struct("<IBBB9x12f")

Three = tuple[float, float, float]


@dataclass(frozen=True)
class Nav:
    """What one message says; None: it does not."""

    name: str
    tow_ms: int  # of the GPS week
    utc_ns: int = 0
    quality: int | None = None
    place: tuple[float, float] | None = None  # deg
    height_m: float | None = None  # above the ellipsoid
    altitude_m: float | None = None  # above mean sea level, by the receiver's own geoid
    sigma_m: Three | None = None  # north, east, down
    v_n: Three | None = None  # m/s
    v_sigma: Three | None = None
    flat: bool = False  # a fix in two dimensions: its height is held, not measured
    satellites: int = 0
    ground: tuple[float, float] | None = None  # speed m/s, course deg, where it says them itself


def nav_of(data: bytes) -> Nav | None:
    """A message from its sync bytes to its checksum; None when it is none of those that are read.
    Raises Refused.
    """
    reader = READERS.get(data[2:4])
    if reader is None:
        return None
    name, form, read = reader
    payload = data[6:-2]
    if len(payload) < form.size:
        raise Refused(name, "length")
    nav = read(name, form.unpack_from(payload))
    within(name, "time of week", nav.tow_ms, 0, WEEK_MS)
    return nav


def _place(name: str, lat: float, lon: float, accuracy_m: float) -> tuple[float, float] | None:
    within(name, "latitude", lat, -90.0, 90.0)
    within(name, "longitude", lon, -180.0, 180.0)
    return (lat, lon) if accuracy_m < MOST_ACCURACY_M else None


def _sigma(horizontal_m: float, vertical_m: float) -> Three | None:
    one_axis = horizontal_m / math.sqrt(2.0)  # hAcc is the root of both variances' sum
    return said_sigma((one_axis, one_axis, vertical_m))


def _utc(name: str, date_: tuple[int, ...], time_: tuple[int, ...], nano: int) -> int:
    """ns since 1970; nano may be negative, a second may be 60."""
    hour, minute, second = time_
    within(name, "hour", hour, 0, 23)
    within(name, "minute", minute, 0, 59)
    within(name, "second", second, 0, 60)
    within(name, "nanoseconds", nano, -(10**9), 10**9)
    day: date | None = day_of(name, *date_)
    return utc_ns_of(day, ((hour * 60 + minute) * 60 + second) * 10**9 + nano)


def _velocity(
    name: str, v_mps: tuple[float, ...], accuracy_mps: float
) -> tuple[Three, Three | None] | tuple[None, None]:
    n, e, d = (within(name, "velocity", v, -MOST_SPEED_MPS, MOST_SPEED_MPS) for v in v_mps)
    if accuracy_mps >= MOST_SPEED_ACCURACY_MPS:
        return None, None
    return (n, e, d), said_sigma((accuracy_mps / math.sqrt(3.0),) * 3)


def _pvt(name: str, p: tuple) -> Nav:
    tow, year, month, day, hour, minute, second, valid, _, nano, fix_type, flags, _, sats = p[:14]
    lon, lat, height, altitude, h_acc, v_acc, v_north, v_east, v_down = p[14:23]
    ground_speed, course, speed_acc, flags3 = p[23], p[24], p[25], p[28]
    timed = valid & DATED and valid & TIMED and valid & RESOLVED
    within(name, "satellites", sats, 0.0, MOST_SATELLITES)
    place = _place(name, lat / 1e7, lon / 1e7, h_acc / 1e3)
    v_n, v_sigma = _velocity(name, (v_north / 1e3, v_east / 1e3, v_down / 1e3), speed_acc / 1e3)
    known = height_or_none(height / 1e3) if v_acc / 1e3 < MOST_ACCURACY_M else None
    return Nav(
        name,
        tow,
        _utc(name, (year, month, day), (hour, minute, second), nano) if timed else 0,
        _pvt_quality(fix_type, flags),
        None if flags3 & 1 else place,
        known,
        height_or_none(altitude / 1e3) if known is not None else None,
        _sigma(h_acc / 1e3, v_acc / 1e3),
        v_n,
        v_sigma,
        fix_type == FIX_2D,
        sats,
        (ground_speed / 1e3, course / 1e5),
    )


def _pvt_quality(fix_type: int, flags: int) -> int:
    if not flags & 1 or fix_type not in (1, 2, 3, 4):
        return NONE  # 5 is a time alone
    if fix_type == 1:
        return DEAD_RECKONING
    carrier = flags >> 6
    if carrier:
        return RTK_FIXED if carrier == 2 else RTK_FLOAT
    return DIFFERENTIAL if flags & 2 else AUTONOMOUS


def _hpposllh(name: str, p: tuple) -> Nav:
    flags, tow, lon7, lat7, height, altitude, lon9, lat9, height4, altitude4, h_acc, v_acc = p
    # integers: the sum of two floats would not be the receiver's figure
    lat, lon = (lat7 * 100 + lat9) / 1e9, (lon7 * 100 + lon9) / 1e9
    place = _place(name, lat, lon, h_acc / 1e4)
    known = height_or_none((height * 10 + height4) / 1e4)
    known = known if v_acc / 1e4 < MOST_ACCURACY_M else None
    sea = height_or_none((altitude * 10 + altitude4) / 1e4) if known is not None else None
    if flags & 1:
        return Nav(name, tow)
    return Nav(
        name,
        tow,
        place=place,
        height_m=known,
        altitude_m=sea,
        sigma_m=_sigma(h_acc / 1e4, v_acc / 1e4),
    )


def _posllh(name: str, p: tuple) -> Nav:
    tow, lon, lat, height, altitude, h_acc, v_acc = p
    known = height_or_none(height / 1e3) if v_acc / 1e3 < MOST_ACCURACY_M else None
    return Nav(
        name,
        tow,
        place=_place(name, lat / 1e7, lon / 1e7, h_acc / 1e3),
        height_m=known,
        altitude_m=height_or_none(altitude / 1e3) if known is not None else None,
        sigma_m=_sigma(h_acc / 1e3, v_acc / 1e3),
    )


def _velned(name: str, p: tuple) -> Nav:
    tow, north, east, down, _, _, _, speed_acc, _ = p
    v_n, v_sigma = _velocity(name, (north / 1e2, east / 1e2, down / 1e2), speed_acc / 1e2)
    return Nav(name, tow, v_n=v_n, v_sigma=v_sigma)


def _old_quality(fix_type: int, flags: int) -> int:
    """Of NAV-SOL and NAV-STATUS."""
    if not flags & 1 or fix_type not in (1, 2, 3, 4):
        return NONE
    if fix_type == 1:
        return DEAD_RECKONING
    return DIFFERENTIAL if flags & 2 else AUTONOMOUS


def _sol(name: str, p: tuple) -> Nav:
    tow, _, _, fix_type, flags = p[:5]
    ecef, accuracy, speed = [v / 1e2 for v in p[5:8]], p[8] / 1e2, [v / 1e2 for v in p[9:12]]
    quality = _old_quality(fix_type, flags)
    if not GEOCENTRE_M[0] < math.hypot(*ecef) < GEOCENTRE_M[1] or accuracy >= MOST_ACCURACY_M:
        return Nav(name, tow, quality=quality)
    latitude, longitude, height = geodetic(*ecef)
    one_axis = accuracy / math.sqrt(3.0)
    v_n = turned_to_ned(latitude, longitude, *speed)
    v_n, v_sigma = _velocity(name, v_n, p[12] / 1e2)
    return Nav(
        name,
        tow,
        0,
        quality,
        (math.degrees(latitude), math.degrees(longitude)),
        height_or_none(height),
        None,
        said_sigma((one_axis,) * 3),
        v_n,
        v_sigma,
        fix_type == FIX_2D,
    )


def _status(name: str, p: tuple) -> Nav:
    tow, fix_type, flags = p
    return Nav(name, tow, quality=_old_quality(fix_type, flags), flat=fix_type == FIX_2D)


def _timeutc(name: str, p: tuple) -> Nav:
    tow, _, nano, *clock, valid = p
    if not valid & UTC_KNOWN:
        return Nav(name, tow)
    return Nav(name, tow, _utc(name, tuple(clock[:3]), tuple(clock[3:]), nano))


def _cov(name: str, p: tuple) -> Nav:
    tow, _, position_valid, velocity_valid, *c = p
    position, velocity = (c[0], c[3], c[5]), (c[6], c[9], c[11])
    return Nav(
        name,
        tow,
        sigma_m=_roots(name, position) if position_valid else None,
        v_sigma=_roots(name, velocity) if velocity_valid else None,
    )


def _roots(name: str, variances: Three) -> Three | None:
    return said_sigma([math.sqrt(within(name, "variance", v, 0.0, 1e10)) for v in variances])


READERS: dict[bytes, tuple[str, struct.Struct, Callable[[str, tuple], Nav]]] = {
    b"\x01\x07": ("NAV-PVT", PVT, _pvt),
    b"\x01\x14": ("NAV-HPPOSLLH", HPPOSLLH, _hpposllh),
    b"\x01\x02": ("NAV-POSLLH", POSLLH, _posllh),
    b"\x01\x12": ("NAV-VELNED", VELNED, _velned),
    b"\x01\x06": ("NAV-SOL", SOL, _sol),
    b"\x01\x03": ("NAV-STATUS", STATUS, _status),
    b"\x01\x21": ("NAV-TIMEUTC", TIMEUTC, _timeutc),
    b"\x01\x36": ("NAV-COV", COV, _cov),
}
