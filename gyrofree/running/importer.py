"""A user's CSV becomes a session: its samples as a gateway publishes them, with the estimates on
them beside.
"""

import heapq
from collections.abc import Iterator
from pathlib import Path

from gateway.samples.convert import ADXL345_SCALE
from gateway.virtual import player
from gateway.virtual.player import LOG_EPOCH_S, PlayLog
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import ACCEL, GNSS, IMU, Topic
from messages.contract.topics import TACHO as TACHO_TOPIC

AXES = 12
QUALITY = {
    1: "RTK_FIXED",
    2: "RTK_FLOAT",
    3: "DIFFERENTIAL",
    4: "DIFFERENTIAL",
    5: "AUTONOMOUS",
}  # RTKLIB's numbers
TACHO_SIGMA = 0.01  # rad/s; a log does not say how well its tachometer measured

Item = tuple[float, Topic, pb.AccelBatch | pb.ImuBatch | pb.GnssFix | pb.TachoRate]


def rows_of(
    log: Path, gnss: Path | None, prefix: str, device: str
) -> Iterator[tuple[int, str, bytes]]:
    """(receive time ns, bus key, payload) of a log in the documented CSV form, in time order.

    Time counts from the log's own t_s = 0, which stands for 2024-01-01 UTC: a log has no date.
    Raises player.PlayError, with file, row and column, for a log that cannot be read.
    """
    source = player.load(log, gnss)
    counts: dict[str, int] = {}
    for t_s, topic, message in heapq.merge(
        _samples(source), _tacho(source), _fixes(source), key=lambda item: item[0]
    ):
        key = topic.key(prefix, device)
        counts[key] = counts.get(key, 0) + 1
        utc_ns = LOG_EPOCH_S * 1_000_000_000 + round(t_s * 1e9)
        header = pb.Header(
            device=device,
            sequence=counts[key],
            epoch=1,
            device_us=round(t_s * 1e6),
            utc_ns=utc_ns,
            source=pb.SOURCE_PLAYED,
            run=1,
        )
        message.header.CopyFrom(header)
        yield utc_ns, key, message.SerializeToString()


def _samples(source: PlayLog) -> Iterator[Item]:
    for index, row in enumerate(source.rows):
        if source.kind == "imu":
            imu = pb.ImuBatch(first_index=index, period_s=source.period_s)
            imu.f_b_mps2.extend(row[1:4])
            imu.omega_ib_b_radps.extend(row[4:7])
            yield row[0], IMU, imu
            continue
        accel = pb.AccelBatch(first_index=index, period_s=source.period_s, axes=AXES)
        accel.counts.extend(int(count) for count in row[1 : AXES + 1])
        accel.f_mps2.extend(count * ADXL345_SCALE for count in row[1 : AXES + 1])
        yield row[0], ACCEL, accel


def _tacho(source: PlayLog) -> Iterator[Item]:
    """The tachometer's column as rates; while it reads zero there are no pulses, so nothing is
    published.
    """
    if source.kind == "imu" or len(source.rows[0]) <= AXES + 1:
        return
    for row in source.rows:
        if row[AXES + 1] != 0.0:
            yield (
                row[0],
                TACHO_TOPIC,
                pb.TachoRate(omega_radps=row[-1], sigma_radps=TACHO_SIGMA, direction_known=True),
            )


def _fixes(source: PlayLog) -> Iterator[Item]:
    for t_s, lat, lon, height, quality, sd_n, sd_e, sd_u, vn, ve, vd in source.gnss:
        fix = pb.GnssFix(
            latitude_deg=lat,
            longitude_deg=lon,
            height_m=height,
            device_time_s=t_s,
            quality=getattr(pb.GnssFix, "QUALITY_" + QUALITY.get(int(quality), "NONE")),
            fix_utc_ns=LOG_EPOCH_S * 1_000_000_000 + round(t_s * 1e9),
        )
        fix.position_sigma_ned_m.extend((sd_n, sd_e, sd_u))
        fix.v_n_mps.extend((vn, ve, vd))
        yield t_s, GNSS, fix
