"""What one epoch of a receiver says, from its UBX messages or NMEA sentences: pure functions of
records that have passed the door.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from gateway.gnss.nmea import (
    AUTONOMOUS,
    DIFFERENTIAL,
    NONE,
    RTK_FIXED,
    RTK_FLOAT,
    Sentence,
)
from gateway.gnss.ubx_read import MOST_SPEED_ACCURACY_MPS, Nav, Three

NMEA_SPEED_SIGMA = 0.5  # m/s; NMEA has no word for it: a cautious figure for a code receiver
WALKING_MPS = 1.0  # faster than this without a course has no direction, and is no velocity
# m north and east at a dilution of precision of 1, by quality; twice that up
USUAL_SIGMA_M = {AUTONOMOUS: 1.6, DIFFERENTIAL: 0.8, RTK_FLOAT: 0.3, RTK_FIXED: 0.02}
TRUSTED_ACCURACY_M = 100.0  # of a position for whose fix no message answers
WEEK_ROLLOVER_NS = 1024 * 7 * 86400 * 10**9  # GPS week counter of 10 bits
DAY_NS = 86400 * 10**9
YEAR_2000_NS = 946_684_800 * 10**9
YEAR_2060_NS = 2_840_140_800 * 10**9
NAN = math.nan
Stamp = tuple[int, int | None] | None  # us of the board, monotonic ns; of a read

__all__ = ["NONE", "RTK_FIXED", "Fix", "nmea_fix", "plausible_utc", "ubx_fix", "unroll_weeks"]


@dataclass(frozen=True)
class Fix:
    """One epoch. None, and NaN in a vector: the receiver does not say. Angles in degrees as the
    receivers give them.
    """

    talker: str
    fix_utc_ns: int = 0  # 0: date or time unknown
    tow_ns: int | None = None  # of the GPS week, which knows no leap seconds; UBX alone gives it
    quality: int = NONE
    latitude_deg: float | None = None
    longitude_deg: float | None = None
    height_m: float | None = None  # above the ellipsoid
    height_msl_m: float | None = None
    sigma_ned_m: Three | None = None
    v_n: Three | None = None  # m/s; NMEA has no vertical speed: NaN
    v_sigma_ned: Three | None = None
    speed_mps: float | None = None  # over ground
    track_deg: float | None = None  # course over ground; None when too slow to have one
    satellites: int = 0
    hdop: float = 0.0
    began: Stamp = field(default=None, compare=False)  # of the epoch's first byte


# --- NMEA


def nmea_fix(parts: Mapping[str, Sentence], gsa: Sentence | None = None) -> Fix:
    """The epoch's sentences, by name, as one fix without its time; gsa: the last one that came."""
    known = [parts[name] for name in ("GGA", "GNS", "RMC", "GLL") if name in parts]
    quality = next((s.quality for s in known if s.quality is not None), NONE)
    counts = next((s for s in known if s.satellites or s.hdop), known[0])
    fix = Fix(known[0].talker, quality=quality, satellites=counts.satellites, hdop=counts.hdop)
    source = next((s for s in known if s.place is not None), None)
    if source is None or source.place is None or quality == NONE:
        return fix
    fix = replace(fix, latitude_deg=source.place[0], longitude_deg=source.place[1])
    fix = _with_height(fix, known, None if gsa is None else gsa.dimensions)
    fix = _with_sigma(fix, parts.get("GST"), gsa)
    return _with_course(fix, parts.get("RMC"), parts.get("VTG"))


def _with_height(fix: Fix, known: list[Sentence], dimensions: int | None) -> Fix:
    """A fix of two dimensions holds its height: it measures none."""
    source = next((s for s in known if s.altitude_m is not None), None)
    if source is None or source.altitude_m is None or dimensions == 2:
        return fix
    separation = source.separation_m
    height = None if separation is None else source.altitude_m + separation
    return replace(fix, height_msl_m=source.altitude_m, height_m=height)


def _with_sigma(fix: Fix, gst: Sentence | None, gsa: Sentence | None) -> Fix:
    """By GST; else by the dilution of precision, where that is known; else none."""
    if gst is not None and gst.sigma_m is not None:
        return replace(fix, sigma_ned_m=gst.sigma_m)
    hdop = fix.hdop or (gsa.hdop if gsa is not None else 0.0)
    vdop = gsa.vdop if gsa is not None else 0.0
    if not hdop or fix.quality not in USUAL_SIGMA_M:
        return fix
    level, up = usual_sigma(fix.quality)
    level, up = level * max(hdop, 1.0), up * max(vdop, hdop, 1.0)
    return replace(fix, sigma_ned_m=(level, level, up))


def usual_sigma(quality: int) -> tuple[float, float]:
    """m, north or east, and up, of a fix in good geometry."""
    level = USUAL_SIGMA_M.get(quality, USUAL_SIGMA_M[AUTONOMOUS])
    return level, 2.0 * level


def _with_course(fix: Fix, rmc: Sentence | None, vtg: Sentence | None) -> Fix:
    source = next((s for s in (rmc, vtg) if s is not None and s.speed_mps is not None), None)
    if source is None or source.speed_mps is None:
        return fix
    speed, track = source.speed_mps, source.course_deg
    fix = replace(fix, speed_mps=speed, track_deg=track)
    if track is None and speed > WALKING_MPS:
        return fix
    # Near standstill the speed has no direction: it is part of the uncertainty
    course = math.radians(track or 0.0)
    moving = 0.0 if track is None else speed
    sigma = NMEA_SPEED_SIGMA if track is not None else max(speed, NMEA_SPEED_SIGMA)
    return replace(
        fix,
        v_n=(moving * math.cos(course), moving * math.sin(course), NAN),
        v_sigma_ned=(sigma, sigma, NAN),
    )


# --- UBX


def ubx_fix(parts: Mapping[str, Nav]) -> Fix:
    """The epoch's messages, by name, as one fix."""
    pvt = parts.get("NAV-PVT")
    first = next(iter(parts.values()))
    fix = Fix(
        "UBX",
        fix_utc_ns=next((p.utc_ns for p in parts.values() if p.utc_ns), 0),
        tow_ns=first.tow_ms * 10**6,
        quality=_ubx_quality(parts),
        satellites=0 if pvt is None else pvt.satellites,
    )
    base = _position_of(parts)
    if fix.quality == NONE or base is None or base.place is None:
        return replace(fix, quality=NONE)
    flat = any(part.flat for part in parts.values())
    fix = replace(
        fix,
        latitude_deg=base.place[0],
        longitude_deg=base.place[1],
        height_m=None if flat else base.height_m,
        height_msl_m=None if flat else base.altitude_m,
        sigma_ned_m=base.sigma_m,
    )
    return _with_velocity(_with_covariance(fix, parts.get("NAV-COV")), parts)


def _position_of(parts: Mapping[str, Nav]) -> Nav | None:
    """The finest position that there is; NAV-PVT has the last word on whether there is one."""
    pvt = parts.get("NAV-PVT")
    if pvt is not None and pvt.place is None:
        return None
    names = ("NAV-HPPOSLLH", "NAV-PVT", "NAV-POSLLH", "NAV-SOL")
    return next((parts[n] for n in names if n in parts and parts[n].place is not None), None)


def _ubx_quality(parts: Mapping[str, Nav]) -> int:
    for name in ("NAV-PVT", "NAV-SOL", "NAV-STATUS"):
        if name in parts:
            return parts[name].quality or NONE
    base = _position_of(parts)
    trusted = base is not None and base.sigma_m is not None
    return AUTONOMOUS if trusted and math.hypot(*base.sigma_m[:2]) < TRUSTED_ACCURACY_M else NONE


def _with_covariance(fix: Fix, cov: Nav | None) -> Fix:
    return fix if cov is None or cov.sigma_m is None else replace(fix, sigma_ned_m=cov.sigma_m)


def _with_velocity(fix: Fix, parts: Mapping[str, Nav]) -> Fix:
    names = ("NAV-PVT", "NAV-VELNED", "NAV-SOL")
    source = next((parts[n] for n in names if n in parts and parts[n].v_n is not None), None)
    if source is None or source.v_n is None:
        return fix
    north, east, down = source.v_n
    own = math.hypot(north, east), math.degrees(math.atan2(east, north)) % 360.0
    speed, track = source.ground or own
    cov, sigma = parts.get("NAV-COV"), source.v_sigma
    if cov is not None and cov.v_sigma is not None:
        sigma = cov.v_sigma
    flat = any(part.flat for part in parts.values())  # then no climb is measured either
    if sigma is not None and (flat or sigma[2] >= MOST_SPEED_ACCURACY_MPS):
        down, sigma = NAN, (*sigma[:2], NAN)
    return replace(
        fix,
        v_n=(north, east, down),
        v_sigma_ned=sigma,
        speed_mps=speed,
        track_deg=track,
    )


# --- time


def unroll_weeks(fix_utc_ns: int, host_utc_ns: int) -> int:
    """Undo a GPS week rollover: a date off by 1024 weeks (or twice that), to the day, is the
    receiver's counter.
    """
    weeks = round((host_utc_ns - fix_utc_ns) / WEEK_ROLLOVER_NS)
    if fix_utc_ns and weeks and abs(host_utc_ns - fix_utc_ns - weeks * WEEK_ROLLOVER_NS) < DAY_NS:
        return fix_utc_ns + weeks * WEEK_ROLLOVER_NS
    return fix_utc_ns


def plausible_utc(fix_utc_ns: int) -> int:
    """0 for the dates that receivers count from before they know better: 1980, 1999, 2079."""
    return fix_utc_ns if YEAR_2000_NS <= fix_utc_ns < YEAR_2060_NS else 0
