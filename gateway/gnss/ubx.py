"""GNSS epochs as the UBX bytes a receiver would send: NAV-PVT and NAV-HPPOSLLH.

Payloads are packed here from integers (u-blox F9 interface description, UBX-18010854) and wrapped
by pyubx2: its own scaling of floats truncates, which would move a position by 0.1 mm to 1 cm.
"""

import math
import struct
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

from pyubx2 import GET, UBXMessage

GPS_EPOCH = datetime(1980, 1, 6, tzinfo=UTC)
LEAP_SECONDS = 18  # GPS - UTC since 2017
WEEK_MS = 7 * 86400 * 1000
SPEED_ACCURACY = 0.05  # m/s per axis, where the log has none
NO_ACCURACY = 0xFFFFFFFF
NO_VARIANCE = 1e8  # m^2/s^2
NO_HEIGHT_MM = -(2**31)
PVT = struct.Struct("<IHBBBBBBIiBBBBiiiiIIiiiiiIIHH4xihH")
COV = struct.Struct("<IBBB9x12f")
HPPOSLLH = struct.Struct("<B2xBIiiiibbbbII")


@dataclass(frozen=True)
class Epoch:
    """One GNSS epoch at base_s + t_s seconds since 1970 UTC; quality as RTKLIB counts."""

    base_s: int
    t_s: float
    latitude_deg: float
    longitude_deg: float
    height_m: float  # above the ellipsoid; NaN: unknown
    quality: int
    sigma_ned_m: tuple[float, float, float]
    v_n: tuple[float, float, float] | None  # m/s; None: unknown, NaN: its down alone


def ubx_bytes(epoch: Epoch) -> bytes:
    """Its messages. What a log does not know is marked as a receiver marks it, by an accuracy
    that is none: a velocity, a height (then the fix is of two dimensions), and always sea level,
    which has no accuracy of its own, by a height that cannot be.
    """
    utc = datetime.fromtimestamp(epoch.base_s, UTC) + timedelta(microseconds=round(epoch.t_s * 1e6))
    i_tow = (
        round((utc - GPS_EPOCH + timedelta(seconds=LEAP_SECONDS)) / timedelta(milliseconds=1))
        % WEEK_MS
    )
    pvt = UBXMessage("NAV", "NAV-PVT", GET, payload=_pvt(epoch, utc, i_tow))
    hppos = UBXMessage("NAV", "NAV-HPPOSLLH", GET, payload=_hpposllh(epoch, i_tow))
    data = pvt.serialize() + hppos.serialize()
    if epoch.v_n is not None and not math.isfinite(epoch.v_n[2]):
        data += UBXMessage("NAV", "NAV-COV", GET, payload=_cov(i_tow)).serialize()
    return data


def _cov(i_tow: int) -> bytes:
    """Velocities known north and east only: one variance that is none."""
    level = SPEED_ACCURACY**2
    return COV.pack(i_tow, 0, 0, 1, *[0.0] * 6, level, 0.0, 0.0, level, 0.0, NO_VARIANCE)


def _pvt(epoch: Epoch, utc: datetime, i_tow: int) -> bytes:
    flags = 0x01 if epoch.quality else 0x00
    if epoch.quality in (1, 2, 3, 4):
        flags |= 0x02  # differential corrections
    flags |= {1: 2, 2: 1}.get(epoch.quality, 0) << 6
    vn, ve, vd = (v if math.isfinite(v) else 0.0 for v in epoch.v_n or (0.0, 0.0, 0.0))
    speed_accuracy = round(SPEED_ACCURACY * math.sqrt(3.0) * 1e3) if epoch.v_n else NO_ACCURACY
    high = math.isfinite(epoch.height_m)
    s_n, s_e, s_d = epoch.sigma_ned_m
    mm = [round(v * 1e3) for v in (vn, ve, vd, math.hypot(vn, ve))]
    course = round((math.degrees(math.atan2(ve, vn)) % 360.0) * 1e5)
    return PVT.pack(
        i_tow,
        utc.year,
        utc.month,
        utc.day,
        utc.hour,
        utc.minute,
        utc.second,
        0x07,
        50,
        utc.microsecond * 1000,
        (3 if high else 2) if epoch.quality else 0,
        flags,
        0,
        0,
        round(epoch.longitude_deg * 1e7),
        round(epoch.latitude_deg * 1e7),
        round(epoch.height_m * 1e3) if high else 0,
        NO_HEIGHT_MM,
        round(math.hypot(s_n, s_e) * 1e3),
        round(s_d * 1e3) if high else NO_ACCURACY,
        *mm,
        course,
        speed_accuracy,
        500_000,
        100,
        0,
        0,
        0,
        0,
    )


def _hpposllh(epoch: Epoch, i_tow: int) -> bytes:
    lon7, lon9 = _split(epoch.longitude_deg * 1e9)
    lat7, lat9 = _split(epoch.latitude_deg * 1e9)
    high = math.isfinite(epoch.height_m)
    height_mm, height4 = divmod(round(epoch.height_m * 1e4) if high else 0, 10)
    s_n, s_e, s_d = epoch.sigma_ned_m
    return HPPOSLLH.pack(
        0,
        0,
        i_tow,
        lon7,
        lat7,
        height_mm,
        NO_HEIGHT_MM,
        lon9,
        lat9,
        height4,
        0,
        round(math.hypot(s_n, s_e) * 1e4),
        round(s_d * 1e4) if high else NO_ACCURACY,
    )


def _split(value: float) -> tuple[int, int]:
    """1e-9 degrees as 1e-7 degrees and a remainder of -50 to 50."""
    whole = round(value)
    coarse = round(whole / 100)
    return coarse, whole - coarse * 100
