"""A user's CSV becomes a session: its samples as a gateway publishes them, with the estimates on
them beside.
"""

import heapq
import math
from collections.abc import Iterator

from gateway.samples.convert import ADXL345_SCALE
from gyrofree.running.log_items import LOG_EPOCH_S
from inertial.navigation.fix import AUTONOMOUS, DIFFERENTIAL, RTK_FIXED, RTK_FLOAT
from logs.board_log import BoardLog
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import ACCEL, GNSS, IMU, Topic
from messages.contract.topics import TACHO as TACHO_TOPIC

AXES = 12
QUALITY = {
    RTK_FIXED: pb.GnssFix.QUALITY_RTK_FIXED,
    RTK_FLOAT: pb.GnssFix.QUALITY_RTK_FLOAT,
    DIFFERENTIAL: pb.GnssFix.QUALITY_DIFFERENTIAL,
    AUTONOMOUS: pb.GnssFix.QUALITY_AUTONOMOUS,
}
TACHO_SIGMA = 0.01  # rad/s; a log does not say how well its tachometer measured

Item = tuple[float, Topic, pb.AccelBatch | pb.ImuBatch | pb.GnssFix | pb.TachoRate]


def rows_of(source: BoardLog, prefix: str, device: str) -> Iterator[tuple[int, str, bytes]]:
    """(receive time ns, bus key, payload) of a log that was read, in time order.

    Time counts from the log's own t_s = 0, which stands for 2024-01-01 UTC: a log has no date. A
    log whose t_s is far from 0 (Unix time, a trigger in its middle) counts from its first sample.
    """
    counts: dict[str, int] = {}
    zero_s = origin_of(source)
    for t_s, topic, message in heapq.merge(
        _samples(source), _tacho(source), _fixes(source), key=lambda item: item[0]
    ):
        key = topic.key(prefix, device)
        counts[key] = counts.get(key, 0) + 1
        utc_ns = LOG_EPOCH_S * 1_000_000_000 + round((t_s - zero_s) * 1e9)
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


def origin_of(source: BoardLog) -> float:
    """The log's time that stands for the beginning of 2024-01-01, s: 0 where its t_s counts from
    there within a day, else its first sample.
    """
    first = min([float(source.t_s[0]), *(fix.t for fix in source.fixes[:1])])
    return 0.0 if 0.0 <= first < 86_400.0 else first


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


def _fixes(source: BoardLog) -> Iterator[Item]:
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
            fix_utc_ns=LOG_EPOCH_S * 1_000_000_000 + round((fix.t - zero_s) * 1e9),
        )
        sigma_p = fix.sigma_p.tolist() if fix.has_height else [*fix.sigma_p[:2].tolist(), math.nan]
        message.position_sigma_ned_m.extend(sigma_p)
        if fix.v_n is not None:
            message.v_n_mps.extend(fix.v_n.tolist())
        yield fix.t, GNSS, message
