"""The board's side of the wire for simulation and for played logs.

It takes items in time order and sends what a board would: HELLO at start and every 10 s, STATUS
once a second, ACC12 or IMU6, TACHO and GPS frames, in real time or `speed` times as fast. Device
time is the items' time, so at speed N the device clock runs N times as fast as the host's; the
gateway is told so by `time_scale = N`. Estimators are not
concerned: their dt is the period in the frames.
"""

import logging
import threading
import time
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Protocol

from firmware_protocol.codec import FLAG_DROPPED, FLAG_SIMULATED, Deframer, Frame, encode
from firmware_protocol.frames import (
    Acc12,
    Ack,
    Adc,
    Command,
    Gps,
    Hello,
    Imu6,
    Payload,
    SensorInfo,
    Status,
    Tacho,
)
from firmware_protocol.spec import SPEC

log = logging.getLogger(__name__)

SIMULATED, PLAYED = 1, 2  # board_id
ACCEL_SCALE_UG = 10  # 1e-5 m/s^2 per count: the last digit of the logs
GYRO_SCALE_NRAD = 1000  # 1e-6 rad/s per count
ADXL345_SCALE_NG = 3_900_000
VREF_MV = 3300  # of the converter
TACHO_FRAME_S = 0.02  # pulses wait no longer for company
MAX_PULSES = 32
GPS_BYTES = 400
HELLO_EVERY_S = 10.0
STATUS_EVERY_S = 1.0
COMMANDS = {entry["id"]: entry["name"] for entry in SPEC.raw["command"]}
UNKNOWN = next(entry["id"] for entry in SPEC.raw["result"] if entry["name"] == "unknown")


@dataclass(frozen=True, slots=True)
class BoardAccel:
    """One sample of the cube: twelve counts, a11 a12 a13 a21 ... a43."""

    t_s: float
    counts12: tuple[int, ...]
    index: int | None = None  # its number; None: by its time


@dataclass(frozen=True, slots=True)
class BoardImu:
    """One sample of a six-axis board: m/s^2 and rad/s in b."""

    t_s: float
    f_b: tuple[float, float, float]
    omega_b: tuple[float, float, float]
    index: int | None = None  # its number; None: by its time


@dataclass(frozen=True, slots=True)
class BoardAdc:
    """One sample of an analogue board: counts of its converter's first inputs."""

    t_s: float
    counts: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class BoardPulse:
    """One pulse of the tachometer; direction +1, -1, or 0 for a board without a direction
    channel.
    """

    t_s: float
    direction: int


@dataclass(frozen=True, slots=True)
class BoardBytes:
    """Bytes of the GNSS receiver, when they reach the board."""

    t_s: float
    data: bytes


_ROWS = {BoardAccel: Acc12, BoardImu: Imu6, BoardAdc: Adc}

Item = BoardAccel | BoardImu | BoardAdc | BoardPulse | BoardBytes


class Link(Protocol):
    """What a board needs of its line; board_link.py has two."""

    @property
    def connected(self) -> bool: ...
    def write(self, data: bytes) -> bool: ...
    def read(self) -> bytes: ...


class VirtualBoard:
    """One boot of a board. `run` plays items; counters are those of its STATUS."""

    def __init__(
        self,
        link: Link,
        board_id: int,
        epoch: int = 0,
        sample_period_s: float = 0.01,
        batch: int = 1,
        scale_ng: int = ADXL345_SCALE_NG,
        uid: bytes = b"virtual",
        firmware: str = "virtual board",
    ) -> None:
        self.link = link
        self.board_id = board_id
        self.epoch = epoch
        self.period_s = sample_period_s
        self.batch = batch
        self.built = self.dropped = self.samples = self.pulses = self.gps_bytes = 0
        self._scale_ng = scale_ng
        self._names = (uid, firmware)
        self._flags = FLAG_SIMULATED if board_id == SIMULATED else 0
        self._dropped_before = False
        self._start_s: float | None = None
        self._index = -1
        self._last_sample_s = 0.0
        self._rows: list[tuple[float, int, tuple[int, ...]]] = []
        self._rows_type: type = Acc12
        self._waiting_pulses: list[BoardPulse] = []
        self._hello_s = self._status_s = float("-inf")
        self._orders = Deframer()

    def run(
        self,
        items: Iterable[Item],
        stop: threading.Event,
        speed: float = 1.0,
        wait_for_reader: bool = False,
    ) -> None:
        """Play the items; returns after the last one or when `stop` is set.

        speed: times real time. wait_for_reader: begin only when somebody has opened the port, so
        that a log's start is seen.
        """
        while wait_for_reader and not self.link.connected:
            if stop.wait(0.02):
                return
        started = time.monotonic()
        first_s: float | None = None
        for item in items:
            first_s = item.t_s if first_s is None else first_s
            ahead = started + (item.t_s - first_s) / speed - time.monotonic()
            if ahead > 0.0005:
                if stop.wait(ahead):
                    break
            elif stop.is_set():
                break
            self.take(item)
            self._listen(item.t_s)
        self.finish()

    def take(self, item: Item) -> None:
        """One item, now."""
        if self._start_s is None:
            self._start_s = item.t_s
            self._rows_type = _ROWS.get(type(item), Acc12)  # HELLO goes first and must know
        self._housekeeping(item.t_s)
        match item:
            case BoardAccel():
                self._sample(Acc12, item.t_s, tuple(item.counts12), item.index)
            case BoardImu():
                row = tuple(round(f / (ACCEL_SCALE_UG * 1e-6)) for f in item.f_b)
                row += tuple(round(w / (GYRO_SCALE_NRAD * 1e-9)) for w in item.omega_b)
                self._sample(Imu6, item.t_s, row, item.index)
            case BoardAdc():
                self._sample(Adc, item.t_s, item.counts)
            case BoardPulse():
                if self._waiting_pulses and self._waiting_pulses[0].direction != item.direction:
                    self._send_pulses()
                self._waiting_pulses.append(item)
            case BoardBytes():
                self.gps_bytes += len(item.data)
                for start in range(0, len(item.data), GPS_BYTES):
                    self._send(Gps(item.data[start : start + GPS_BYTES]), item.t_s)

    def finish(self) -> None:
        """What a board does before it stops: send what it holds, STATUS last."""
        self._send_pulses()
        self._send_rows()
        if self._start_s is not None:
            self._send(self._status(), self._last_sample_s)

    def _housekeeping(self, t_s: float) -> None:
        if t_s - self._hello_s >= HELLO_EVERY_S:
            self._hello_s = t_s
            self._send(self._hello(), t_s)
        if t_s - self._status_s >= STATUS_EVERY_S:
            self._status_s = t_s
            self._send(self._status(), t_s)
        waiting = self._waiting_pulses
        if waiting and (len(waiting) >= MAX_PULSES or t_s - waiting[0].t_s >= TACHO_FRAME_S):
            self._send_pulses()

    def _listen(self, t_s: float) -> None:
        for event in self._orders.feed(self.link.read()):
            if isinstance(event, Frame) and isinstance(event.payload, Command):
                self._obey(event.payload, t_s)

    def _obey(self, order: Command, t_s: float) -> None:
        """It can say who it is and how it is; there is nothing to set on it."""
        name = COMMANDS.get(order.command)
        if name == "hello":
            self._send(self._hello(), t_s)
        elif name == "status":
            self._send(self._status(), t_s)
        self._send(
            Ack(order.command, order.token, 0 if name in ("hello", "status") else UNKNOWN), t_s
        )

    def _sample(
        self, frame_type: type, t_s: float, row: tuple[int, ...], index: int | None = None
    ) -> None:
        """A sample's index counts periods, so a gap in the items is a gap in the index."""
        step = 1
        if self._index >= 0 and index is not None:
            step = max(1, index - self._index)
        elif self._index >= 0:
            step = max(1, round((t_s - self._last_sample_s) / self.period_s))
        if step > 1 or frame_type is not self._rows_type:
            self._send_rows()
        self._index += step
        self._last_sample_s, self._rows_type = t_s, frame_type
        self.samples += 1
        self._rows.append((t_s, self._index, row))
        if len(self._rows) >= self.batch:
            self._send_rows()

    def _send_rows(self) -> None:
        if not self._rows:
            return
        (t_s, first, _), counts = self._rows[0], tuple(row for _, _, row in self._rows)
        self._rows = []
        first &= 0xFFFFFFFF
        period_ns = round(self.period_s * 1e9)
        if self._rows_type is Acc12:
            self._send(Acc12(first, period_ns, 0x0F, 0, counts), t_s)  # type: ignore[arg-type]
        elif self._rows_type is Adc:
            mask = (1 << len(counts[0])) - 1
            self._send(Adc(first, period_ns, mask, VREF_MV, counts), t_s)
        else:
            # type: ignore[arg-type]
            self._send(Imu6(first, period_ns, ACCEL_SCALE_UG, GYRO_SCALE_NRAD, counts), t_s)

    def _send_pulses(self) -> None:
        if not self._waiting_pulses:
            return
        pulses, self._waiting_pulses = self._waiting_pulses, []
        direction = pulses[0].direction
        edge = 1 | (2 if direction else 0) | (4 if direction < 0 else 0)
        base_s = self._t_us(pulses[0].t_s) / 1e6 + (
            self._start_s or 0.0
        )  # offsets count from the t_us that is sent
        offsets = tuple(max(0, round((pulse.t_s - base_s) * 1e8)) for pulse in pulses)
        self._send(Tacho(self.pulses & 0xFFFFFFFF, edge, offsets), pulses[0].t_s)
        self.pulses += len(pulses)

    def _t_us(self, t_s: float) -> int:
        return int(
            (t_s - (self._start_s or 0.0)) * 1e6 + 1e-3
        )  # floor, but not below by the rounding of floats

    def _send(self, payload: Payload, t_s: float) -> None:
        flags = self._flags | (FLAG_DROPPED if self._dropped_before else 0)
        wire = encode(payload, epoch=self.epoch, seq=self.built, t_us=self._t_us(t_s), flags=flags)
        self.built += 1
        self._dropped_before = not self.link.write(wire)
        self.dropped += self._dropped_before

    def _hello(self) -> Hello:
        uid, firmware = self._names
        six = self._rows_type is not Acc12
        sensor = SensorInfo(model=2 if six else 1, scale_ng=self._scale_ng)
        return Hello(
            minor=1,
            board_id=self.board_id,
            sensor_mask=1 if six else 0x0F,
            n_axes=6 if six else 12,
            tick_hz=1_000_000,
            sample_period_ns=round(self.period_s * 1e9),
            batch=self.batch,
            uid=uid,
            firmware=firmware,
            version=(0, 1, 0),
            config_crc=0,
            sensors=(sensor,) * 4,
        )

    def _status(self) -> Status:
        return Status(
            built=self.built,
            sent=self.built - self.dropped,
            dropped=self.dropped,
            samples=self.samples,
            tacho_total=self.pulses,
            gps_bytes=self.gps_bytes,
            last_seq=max(0, self.built - 1),
        )
