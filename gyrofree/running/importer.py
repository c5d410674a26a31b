"""A user's CSV becomes a session: its samples as a gateway publishes them, with the estimates on
them beside.
"""

import heapq
import math
from collections.abc import Iterator
from datetime import UTC, datetime

from gateway.samples.convert import ADXL345_SCALE
from gyrofree.running.log_items import LOG_EPOCH_S
from inertial.navigation.fix import AUTONOMOUS, DIFFERENTIAL, RTK_FIXED, RTK_FLOAT
from logs.board_log import BoardLog
from logs.quantities import LATEST_S
from logs.sheet import LogError
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import ACCEL, GNSS, IMU, Topic
from messages.contract.topics import TACHO as TACHO_TOPIC

AXES = 12
UNIX_S = 1e9  # a log's time beyond that is Unix time: since 2001
QUALITY = {
    RTK_FIXED: pb.GnssFix.QUALITY_RTK_FIXED,
    RTK_FLOAT: pb.GnssFix.QUALITY_RTK_FLOAT,
    DIFFERENTIAL: pb.GnssFix.QUALITY_DIFFERENTIAL,
    AUTONOMOUS: pb.GnssFix.QUALITY_AUTONOMOUS,
}
TACHO_SIGMA = 0.01  # rad/s; a log does not say how well its tachometer measured

Item = tuple[float, Topic, pb.AccelBatch | pb.ImuBatch | pb.GnssFix | pb.TachoRate]


def rows_of(
    source: BoardLog, prefix: str, device: str, start_s: float | None = None
) -> Iterator[tuple[int, str, bytes]]:
    """(receive time ns, bus key, payload) of a log that was read, in time order.

    Time counts from the log's own t_s = 0, which stands for 2024-01-01 UTC, or for start_s (s since
    1970): a log has no date. A log whose t_s is far from 0 (a trigger in its middle) counts from
    its first sample; Unix time is a date and stays, unless start_s is given.
    """
    counts: dict[str, int] = {}
    zero_s, zero_ns = origin_of(source), zero_ns_of(source, start_s)
    for t_s, topic, message in heapq.merge(
        _samples(source), _tacho(source), _fixes(source, zero_ns), key=lambda item: item[0]
    ):
        key = topic.key(prefix, device)
        counts[key] = counts.get(key, 0) + 1
        utc_ns = zero_ns + round((t_s - zero_s) * 1e9)
        header = pb.Header(
            device=device,
            sequence=counts[key],
            epoch=1,
            device_us=round((t_s - zero_s) * 1e6),
            utc_ns=utc_ns,
            source=pb.SOURCE_PLAYED,
            run=1,
        )
        message.header.CopyFrom(header)
        yield utc_ns, key, message.SerializeToString()


def start_of(text: str) -> float | None:
    """A date and time that a person gave, UTC unless it says otherwise, s since 1970. Raises
    LogError.
    """
    if not text:
        return None
    try:
        found = datetime.fromisoformat(text.strip())
        found = found if found.tzinfo else found.replace(tzinfo=UTC)
        seconds = found.timestamp()
    except (ValueError, OverflowError):
        seconds = -1.0
    if not 0.0 < seconds < LATEST_S:
        raise LogError(f"date {text[:40]!r}: want one since 1970, like 2026-11-29T10:00:00")
    return seconds


def stamp(source: BoardLog, start_s: float | None = None) -> str:
    """The beginning of a session's id: the date of the log's origin, so that a log without one is
    called the same whenever its first sample was.
    """
    return datetime.fromtimestamp(zero_ns_of(source, start_s) / 1e9, UTC).strftime("%Y%m%d-%H%M%S")


def origin_of(source: BoardLog) -> float:
    """The log's time that stands for the beginning of 2024-01-01, s: 0 where its t_s counts from
    there within a day, else its first sample.
    """
    first = min([float(source.t_s[0]), *(fix.t for fix in source.fixes[:1])])
    return 0.0 if 0.0 <= first < 86_400.0 else first


def zero_ns_of(source: BoardLog, start_s: float | None = None) -> int:
    """UTC of the log's origin, ns since 1970: as given, as the log's own Unix time says, or the
    date that stands for none.
    """
    zero_s = origin_of(source)
    if start_s is None:
        start_s = zero_s if zero_s >= UNIX_S else float(LOG_EPOCH_S)
    return round(start_s * 1e6) * 1000


def _samples(source: BoardLog) -> Iterator[Item]:
    period_s = source.timing.period_s
    for row, (t_s, index) in enumerate(zip(source.t_s, source.index, strict=True)):
        t_s, index = float(t_s), int(index)
        if source.kind == "imu":
            imu = pb.ImuBatch(first_index=index, period_s=period_s)
            imu.f_b_mps2.extend(source.f_b[row].tolist())
            imu.omega_ib_b_radps.extend(source.omega_b[row].tolist())
            yield t_s, IMU, imu
            continue
        counts = source.counts[row].tolist()
        accel = pb.AccelBatch(first_index=index, period_s=period_s, axes=AXES)
        accel.counts.extend(counts)
        accel.f_mps2.extend(count * ADXL345_SCALE for count in counts)
        yield t_s, ACCEL, accel


def _tacho(source: BoardLog) -> Iterator[Item]:
    """The tachometer's column as rates; while it reads zero there are no pulses, so nothing is
    published.
    """
    if source.tacho is None:
        return
    for t_s, rate in zip(source.t_s, source.tacho, strict=True):
        if rate != 0.0:
            yield (
                float(t_s),
                TACHO_TOPIC,
                pb.TachoRate(
                    omega_radps=float(rate), sigma_radps=TACHO_SIGMA, direction_known=True
                ),
            )


def _fixes(source: BoardLog, zero_ns: int) -> Iterator[Item]:
    zero_s = origin_of(source)
    for fix in source.fixes:
        message = pb.GnssFix(
            latitude_deg=math.degrees(fix.latitude),
            longitude_deg=math.degrees(fix.longitude),
            height_m=fix.height,
            height_msl_m=math.nan,  # a log does not say
            hdop=math.nan,
            height_reference=pb.HEIGHT_REFERENCE_ELLIPSOID
            if fix.has_height
            else pb.HEIGHT_REFERENCE_UNKNOWN,
            device_time_s=fix.t,
            quality=QUALITY.get(fix.quality, pb.GnssFix.QUALITY_NONE),
            fix_utc_ns=zero_ns + round((fix.t - zero_s) * 1e9),
        )
        sigma_p = fix.sigma_p.tolist() if fix.has_height else [*fix.sigma_p[:2].tolist(), math.nan]
        message.position_sigma_ned_m.extend(sigma_p)
        if fix.v_n is not None:
            message.v_n_mps.extend(fix.v_n.tolist())
        yield fix.t, GNSS, message
