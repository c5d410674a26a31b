"""Raw to physical, and physical to the bus: small pure functions without state."""

import math

from foxglove_schemas_protobuf.LocationFix_pb2 import LocationFix

from firmware_protocol.codec import FLAG_SIMULATED
from firmware_protocol.frames import Hello, Imu6, Status, field_names
from gateway.gnss.fix import Fix, usual_sigma
from gateway.gnss.sky import Sky
from inertial.constants import GEOID_SIGMA, from_mg
from messages.contract import gyrofree_pb2 as pb

ADXL345_SCALE = from_mg(3.9)  # m/s^2 per count, full resolution, data sheet rev. G; before HELLO
READS_IN_TURN = {0, 3}  # board ids of the LPC1768 cube, real and emulated
READ_S = 17e-6  # one sensor: five SPI frames of 16 bits at 4.8 MHz, and the chip select
LETTERS = "XGSECJRI"  # of pb.Sky.Constellation, as in RINEX
NO_HEIGHT_SIGMA = 1e4  # m, of a height that is not known

SOURCES = {
    0: pb.SOURCE_HARDWARE,
    1: pb.SOURCE_SIMULATED,
    2: pb.SOURCE_PLAYED,
    3: pb.SOURCE_EMULATED,
}


def source(hello: Hello | None, flags: int) -> int:
    """Where a frame comes from. The simulated flag outweighs a board that calls itself hardware."""
    if hello is None:
        return pb.SOURCE_SIMULATED if flags & FLAG_SIMULATED else pb.SOURCE_UNKNOWN
    found = SOURCES.get(hello.board_id, pb.SOURCE_UNKNOWN)
    if flags & FLAG_SIMULATED and found in (pb.SOURCE_HARDWARE, pb.SOURCE_UNKNOWN):
        return pb.SOURCE_SIMULATED
    return found


def axis_scales(hello: Hello | None, sensors: int = 4) -> list[float]:
    """m/s^2 per count of each axis, three per sensor, from HELLO; the ADXL345's nominal one where
    HELLO has none.
    """
    if hello is None:
        return [ADXL345_SCALE] * (3 * sensors)
    scales = [from_mg(s.scale_ng / 1e6) or ADXL345_SCALE for s in hello.sensors]
    return [scale for scale in scales[:sensors] for _ in range(3)]


def specific_force(counts: list[int], scales: list[float]) -> list[float]:
    """(n x axes) counts, flat, to m/s^2 along each sensor axis."""
    axes = len(scales)
    return [count * scales[i % axes] for i, count in enumerate(counts)]


def read_offsets(hello: Hello | None, sensors: int = 4) -> list[float]:
    """s after the sample's instant that each axis is read; empty where all are read at once.

    The LPC1768 board reads the sensors of one SPI bus one after the other, both buses at the same
    time.
    """
    if hello is None or hello.board_id not in READS_IN_TURN:
        return []
    buses = [sensor.bus for sensor in hello.sensors[:sensors]]
    return [buses[:k].count(bus) * READ_S for k, bus in enumerate(buses) for _ in range(3)]


def at_the_instant(
    rows: list[float], before: list[float] | None, offsets: list[float], period_s: float
) -> list[float]:
    """Rows (n x axes, flat) that were read offsets after their instants, interpolated back towards
    the row before.

    before: the last row before these, as read; None: the first row stays as it was read.
    """
    axes, back = len(offsets), [offset / period_s for offset in offsets]
    earlier = (before if before is not None else rows[:axes]) + rows[:-axes]
    return [
        now - back[i % axes] * (now - then)
        for i, (now, then) in enumerate(zip(rows, earlier, strict=True))
    ]


def stale_axes(stale_mask: int, sensor_mask: int, sensors: int = 4) -> int:
    """Wire masks, one bit per sensor, as one bit per axis: not fresh, or of a sensor that does not
    answer.
    """
    bad = stale_mask | ~sensor_mask
    return sum(0b111 << 3 * k for k in range(sensors) if bad >> k & 1)


def imu_si(frame: Imu6) -> tuple[list[float], list[float]]:
    """Specific force in m/s^2 and rate in rad/s, each n x 3, flat."""
    accel, gyro = frame.accel_scale_ug * 1e-6, frame.gyro_scale_nrad * 1e-9
    f_b = [c * accel for row in frame.counts for c in row[:3]]
    omega_b = [c * gyro for row in frame.counts for c in row[3:]]
    return f_b, omega_b


def status_counters(status: Status | None) -> dict[str, int]:
    """STATUS as name -> value; arrays as name_0, name_1, ..."""
    counters: dict[str, int] = {}
    for name in field_names(Status) if status else ():
        value = getattr(status, name)
        if isinstance(value, tuple):
            counters |= {f"{name}_{i}": v for i, v in enumerate(value)}
        else:
            counters[name] = value
    return counters


def board_info(hello: Hello | None, status: Status | None) -> pb.BoardInfo:
    """HELLO and STATUS as one message, without its header."""
    info = pb.BoardInfo(status=status_counters(status))
    if hello is not None:
        info.board_id = hello.board_id
        info.uid = hello.uid.hex()
        info.firmware = f"{'.'.join(map(str, hello.version))} {hello.firmware_text}".strip()
        info.axes = hello.n_axes
        info.sample_period_s = hello.sample_period_ns * 1e-9
    return info


def gnss_fix(fix: Fix) -> pb.GnssFix:
    """A fix as a bus message, without header and device time. What the receiver does not say is NaN
    or empty; without a position the quality is NONE.
    """
    message = pb.GnssFix(
        fix_utc_ns=fix.fix_utc_ns,
        quality=fix.quality,
        satellites=fix.satellites,
        hdop=fix.hdop or math.nan,
        talker=fix.talker,
        latitude_deg=math.nan,
        longitude_deg=math.nan,
        height_m=math.nan,
        height_msl_m=math.nan,
        height_reference=pb.HEIGHT_REFERENCE_UNKNOWN,
    )
    if fix.latitude_deg is None or fix.longitude_deg is None:
        message.quality = pb.GnssFix.QUALITY_NONE
        return message
    message.latitude_deg, message.longitude_deg = fix.latitude_deg, fix.longitude_deg
    sigma = fix.sigma_ned_m
    if fix.height_msl_m is not None:
        message.height_msl_m = fix.height_msl_m
    if fix.height_m is not None:
        message.height_m = fix.height_m
        message.height_reference = pb.HEIGHT_REFERENCE_ELLIPSOID
    elif fix.height_msl_m is not None:  # nobody says how far the sea is from the ellipsoid there
        message.height_m = fix.height_msl_m
        message.height_reference = pb.HEIGHT_REFERENCE_SEA_LEVEL
        level, up = usual_sigma(fix.quality)
        north, east, own = sigma or (level, level, up)
        sigma = (north, east, math.hypot(own if math.isfinite(own) else up, GEOID_SIGMA))
    elif sigma is not None:
        sigma = (*sigma[:2], math.nan)
    message.position_sigma_ned_m.extend(sigma or ())
    message.v_n_mps.extend(fix.v_n or ())
    message.velocity_sigma_ned_mps.extend(fix.v_sigma_ned or ())
    return message


def location_fix(message: pb.GnssFix, device: str) -> LocationFix:
    """The same position as Foxglove's LocationFix; covariance is east, north, up. Its altitude is
    above the ellipsoid, so it is NaN where that is not known.
    """
    ellipsoid = message.height_reference == pb.HEIGHT_REFERENCE_ELLIPSOID
    location = LocationFix(
        frame_id=f"{device}/antenna",
        latitude=message.latitude_deg,
        longitude=message.longitude_deg,
        altitude=message.height_m if ellipsoid else math.nan,
    )
    location.timestamp.FromNanoseconds(message.header.utc_ns)
    if message.position_sigma_ned_m:
        n, e, d = (s * s for s in message.position_sigma_ned_m)
        if not (ellipsoid and math.isfinite(d)):
            d = NO_HEIGHT_SIGMA**2
        location.position_covariance.extend([e, 0, 0, 0, n, 0, 0, 0, d])
        location.position_covariance_type = LocationFix.DIAGONAL_KNOWN
    return location


def sky(seen: Sky) -> pb.Sky:
    """Satellites in view as a bus message, without its header."""
    used = {None: pb.Sky.USE_UNKNOWN, False: pb.Sky.USE_NO, True: pb.Sky.USE_YES}
    message = pb.Sky(talker=seen.talker)
    for one in seen.satellites:
        message.satellites.add(
            name=f"{LETTERS[one.system]}{one.number:02d}",
            constellation=one.system,
            number=one.number,
            elevation_deg=_known(one.elevation_deg),
            azimuth_deg=_known(one.azimuth_deg),
            cn0_dbhz=_known(one.cn0_dbhz),
            use=used[one.used],
            signals=one.signals,
        )
    return message


def _known(value: float | None) -> float:
    return math.nan if value is None else value
