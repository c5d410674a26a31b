"""What one epoch of a receiver says, from its UBX messages or NMEA sentences: pure functions of
parsed messages.
"""

import calendar
import math
import struct
from dataclasses import dataclass, replace

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
KNOT = 1852.0 / 3600.0  # m/s
NMEA_SPEED_SIGMA = 0.5  # m/s; NMEA has no word for it: a cautious figure for a code receiver
NO_SIGMA = 100.0  # m or m/s; what NMEA does not say: vertical speed, sigma of the height
WEEK_ROLLOVER_NS = 1024 * 7 * 86400 * 10**9  # GPS week counter of 10 bits
DAY_NS = 86400 * 10**9


@dataclass(frozen=True)
class Fix:
    """One epoch. None: the receiver does not say. Angles in degrees as the receivers give them."""

    talker: str
    fix_utc_ns: int = 0  # 0: date or time unknown
    quality: int = NONE
    latitude_deg: float | None = None
    longitude_deg: float | None = None
    height_m: float | None = None  # above the ellipsoid
    height_msl_m: float | None = None
    sigma_ned_m: tuple[float, float, float] | None = None
    v_n: tuple[float, float, float] | None = (
        None  # m/s; NMEA has no vertical speed: 0 with sigma NO_SIGMA
    )
    v_sigma_ned: tuple[float, float, float] | None = None
    speed_mps: float | None = None  # over ground
    track_deg: float | None = None  # course over ground; None when too slow to have one
    satellites: int = 0
    hdop: float = 0.0


def tod_of(text: str) -> int:
    """hhmmss.sss to ns since midnight; a leap second (60) counts on. Raises ValueError for anything
    else.
    """
    whole, _, part = text.partition(".")
    if len(whole) != 6:
        raise ValueError(f"time of day {text!r}: want hhmmss.sss")
    seconds = int(whole[:2]) * 3600 + int(whole[2:4]) * 60 + int(whole[4:])
    return seconds * 10**9 + int((part + "000000000")[:9])


def nmea_fix(parts: dict) -> Fix:
    """The epoch's sentences as one fix, without its time."""
    gga, rmc, gst, vtg = (parts.get(name) for name in ("GGA", "RMC", "GST", "VTG"))
    first = gga or rmc
    quality = NONE
    if gga is not None:
        quality = GGA_QUALITY.get(int(gga.quality or 0), NONE)
    elif rmc.status == "A":
        quality = AUTONOMOUS
    place = gga if gga is not None and isinstance(gga.lat, float) else rmc
    has_place = place is not None and isinstance(place.lat, float) and quality != NONE
    fix = Fix(first.talker, quality=quality)
    if has_place:
        fix = replace(fix, latitude_deg=place.lat, longitude_deg=place.lon)
    if gga is not None and has_place and isinstance(gga.alt, float):
        separation = gga.sep if isinstance(gga.sep, float) else None
        height = gga.alt + separation if separation is not None else None
        fix = replace(fix, height_msl_m=gga.alt, height_m=height)
    if gga is not None:
        fix = replace(fix, satellites=int(gga.numSV or 0), hdop=float(gga.HDOP or 0.0))
    if gst is not None and isinstance(gst.stdLat, float) and isinstance(gst.stdLong, float):
        fix = replace(fix, sigma_ned_m=(gst.stdLat, gst.stdLong, float(gst.stdAlt or NO_SIGMA)))
    return _with_course(fix, rmc, vtg) if has_place else fix


def _with_course(fix: Fix, rmc, vtg) -> Fix:
    speed = track = None
    if rmc is not None and rmc.status == "A" and isinstance(rmc.spd, float):
        speed, track = rmc.spd * KNOT, rmc.cog if isinstance(rmc.cog, float) else None
    elif vtg is not None and isinstance(vtg.sogn, float):
        speed, track = vtg.sogn * KNOT, vtg.cogt if isinstance(vtg.cogt, float) else None
    if speed is None:
        return fix
    course = math.radians(track or 0.0)
    # Without a course the speed has no direction: then it is part of the uncertainty
    v_n = (
        (speed * math.cos(course), speed * math.sin(course), 0.0)
        if track is not None
        else (0.0, 0.0, 0.0)
    )
    sigma = NMEA_SPEED_SIGMA if track is not None else max(speed, NMEA_SPEED_SIGMA)
    return replace(
        fix, speed_mps=speed, track_deg=track, v_n=v_n, v_sigma_ned=(sigma, sigma, NO_SIGMA)
    )


def ubx_fix(pvt, hppos=None, cov=None) -> Fix:
    """NAV-PVT, refined by NAV-HPPOSLLH and NAV-COV of the same epoch (u-blox F9 interface
    description).
    """
    fix = Fix("UBX", fix_utc_ns=_ubx_time(pvt), quality=_ubx_quality(pvt), satellites=pvt.numSV)
    if fix.quality == NONE:
        return fix
    lat, lon, height, msl = pvt.lat, pvt.lon, pvt.height / 1e3, pvt.hMSL / 1e3
    horizontal, vertical = pvt.hAcc / 1e3, pvt.vAcc / 1e3
    if hppos is not None and not getattr(hppos, "invalidLlh", 0):
        _, lon7, lat7, height_mm, msl_mm, lon9, lat9, height4, msl4, acc_h, acc_v = (
            struct.unpack_from("<Iiiiibbbbii", hppos.payload, 4)
        )  # integers: the sum of two floats would not be the receiver's figure
        lat, lon = (lat7 * 100 + lat9) / 1e9, (lon7 * 100 + lon9) / 1e9
        height, msl = (height_mm * 10 + height4) / 1e4, (msl_mm * 10 + msl4) / 1e4
        horizontal, vertical = acc_h / 1e4, acc_v / 1e4
    one_axis = horizontal / math.sqrt(2.0)  # hAcc is the root of both variances' sum
    sigma = (one_axis, one_axis, vertical)
    v_sigma = (pvt.sAcc / 1e3 / math.sqrt(3.0),) * 3
    if cov is not None and cov.posCovValid:
        sigma = _roots(cov.posCovNN, cov.posCovEE, cov.posCovDD)
    if cov is not None and cov.velCovValid:
        v_sigma = _roots(cov.velCovNN, cov.velCovEE, cov.velCovDD)
    return replace(
        fix,
        latitude_deg=lat,
        longitude_deg=lon,
        height_m=height,
        height_msl_m=msl,
        sigma_ned_m=sigma,
        v_n=(pvt.velN / 1e3, pvt.velE / 1e3, pvt.velD / 1e3),
        v_sigma_ned=v_sigma,
        speed_mps=pvt.gSpeed / 1e3,
        track_deg=pvt.headMot,
    )


def _roots(*variances: float) -> tuple[float, float, float]:
    n, e, d = (math.sqrt(max(v, 0.0)) for v in variances)
    return n, e, d


def _ubx_quality(pvt) -> int:
    if not pvt.gnssFixOk or pvt.fixType not in (1, 2, 3, 4):
        return NONE
    if pvt.fixType == 1:
        return DEAD_RECKONING
    if pvt.carrSoln:
        return RTK_FIXED if pvt.carrSoln == 2 else RTK_FLOAT
    return DIFFERENTIAL if pvt.diffSoln else AUTONOMOUS


def _ubx_time(pvt) -> int:
    """UTC of the fix in ns; nano may be negative, second may be 60. 0 when date or time are not
    valid.
    """
    if not (pvt.validDate and pvt.validTime):
        return 0
    seconds = (
        calendar.timegm((pvt.year, pvt.month, pvt.day, pvt.hour, pvt.min, 0, 0, 0, 0)) + pvt.second
    )
    return seconds * 10**9 + pvt.nano


def unroll_weeks(fix_utc_ns: int, host_utc_ns: int) -> int:
    """Undo a GPS week rollover: a date off by 1024 weeks (or twice that), to the day, is the
    receiver's counter.
    """
    weeks = round((host_utc_ns - fix_utc_ns) / WEEK_ROLLOVER_NS)
    if fix_utc_ns and weeks and abs(host_utc_ns - fix_utc_ns - weeks * WEEK_ROLLOVER_NS) < DAY_NS:
        return fix_utc_ns + weeks * WEEK_ROLLOVER_NS
    return fix_utc_ns
