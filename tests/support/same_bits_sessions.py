"""One session of each kind, short: table, arm with a receiver, drive, tilted board."""

from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
from google.protobuf.message import Message

from estimator.choice import rate_estimators
from gyrofree.running.importer import rows_of
from gyrofree.running.simulate_csv import write
from inertial.attitude.filters import ATTITUDES
from inertial.navigation.navigation import NAVIGATORS
from inertial.simulation.drive import simulate
from inertial.simulation.hand import AnalogueWiring, guided
from logs.board_log import read_board_log
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import ADC, GNSS, IMU, Topic, parse
from support import gyro_free_rig
from support.same_bits import ORDER, Session

BATCH = 10  # samples
PERIOD_S = 0.01

Item = tuple[Topic, Message]


def table(folder: Path) -> Session:
    """The published test on a turning table, with its tachometer, through every rate estimator."""
    write(folder / "table.csv", "published", 3)
    rows = rows_of(read_board_log(folder / "table.csv"), "gyrofree", "cube")
    items = [(parse(key).topic.name, payload) for _, key, payload in rows]
    return Session({"rate": list(rate_estimators()), "tacho_aid": True}, items)


def arm() -> Session:
    """A cube on an arm, navigated without gyroscopes."""
    _, said = gyro_free_rig.messages(20.0)
    return Session(dict(gyro_free_rig.SETTINGS), packed(said))


def drive() -> Session:
    """A car with standstill, turns and an outage through every navigation filter."""
    return Session(
        {"navigators": list(NAVIGATORS), "nav_limit_hz": 2.0}, packed(drive_messages(100.0))
    )


def tilt(folder: Path) -> Session:
    """An analogue board of unknown wiring: guided detection, then every tilt filter on its map."""
    wiring = AnalogueWiring((4, 2, 0, 5, 1, 3), (1, -1, 1, 1, -1, -1), 6)
    batches = packed(adc_batches(wiring))
    begin = command(pb.EstimatorCommand.ACTION_WIRING_START)
    save = command(pb.EstimatorCommand.ACTION_WIRING_SAVE)
    settings = {"navigators": [], "attitudes": list(ATTITUDES), "axes": folder}
    return Session(settings, [batches[0], begin, *batches[1:], save, *batches[1:]])


def sessions(folder: Path) -> dict[str, Session]:
    """All of them by name; `folder` takes their files."""
    return {"table": table(folder), "arm": arm(), "drive": drive(), "tilt": tilt(folder / "axes")}


def packed(said: Iterable[Item]) -> list[tuple[str, bytes]]:
    return [(topic.name, message.SerializeToString()) for topic, message in said]


def command(action: int) -> tuple[str, bytes]:
    return ORDER, pb.EstimatorCommand(action=action, device="board").SerializeToString()


def header(k: int, name: str = "board") -> pb.Header:
    """Header of the batch that begins at sample k."""
    utc_ns = 1_767_323_045_000_000_000 + k * 10_000_000
    return pb.Header(
        device=name, sequence=k // BATCH + 1, epoch=1, device_us=k * 10_000, utc_ns=utc_ns
    )


def drive_messages(seconds: float) -> Iterator[Item]:
    """A simulated drive as batches of its IMU and a fix a second."""
    road = simulate(4, seconds=seconds)
    fixes = list(road.fixes)
    for k in range(0, len(road.imu) - BATCH + 1, BATCH):
        rows = road.imu[k : k + BATCH]
        batch = pb.ImuBatch(header=header(k), first_index=k, period_s=PERIOD_S)
        batch.f_b_mps2.extend(rows[:, 1:4].ravel())
        batch.omega_ib_b_radps.extend(rows[:, 4:7].ravel())
        yield IMU, batch
        while fixes and fixes[0].arrival <= rows[-1, 0]:
            fix = fixes.pop(0)
            said = pb.GnssFix(
                header=header(round(fix.arrival / PERIOD_S)),
                latitude_deg=np.degrees(fix.latitude),
                longitude_deg=np.degrees(fix.longitude),
                height_m=fix.height,
                quality=pb.GnssFix.QUALITY_AUTONOMOUS,
                device_time_s=fix.t,
                position_sigma_ned_m=fix.sigma_p,
            )
            if fix.v_n is not None:
                said.v_n_mps.extend(fix.v_n)
                said.velocity_sigma_ned_mps.extend(fix.sigma_v)
            yield GNSS, said


def adc_batches(wiring: AnalogueWiring) -> Iterator[Item]:
    """A guided detection as counts of the converter."""
    force, rate, _ = guided(6)
    counts = wiring.counts(force, rate)
    for k in range(0, len(counts) - BATCH + 1, BATCH):
        yield (
            ADC,
            pb.AdcBatch(
                header=header(k),
                first_index=k,
                period_s=PERIOD_S,
                channels=wiring.channels,
                counts=counts[k : k + BATCH].ravel().tolist(),
                volt_per_count=wiring.vref / (2**wiring.bits - 1),
                channel_mask=2**wiring.channels - 1,
                zero_g_v=wiring.zero_g,
                zero_rate_v=wiring.zero_rate,
                accel_v_per_mps2=wiring.per_g / 9.80665,
                gyro_v_per_radps=np.degrees(wiring.per_dps),
            ),
        )
