"""What travels between board and gateway: one frozen type per frame of spec.toml.

Values are raw: counts, device ticks, masks.  Scales and units stand in spec.toml; conversion to SI
is the gateway's. Sequence numbers, epoch, flags and time are in the frame's header, see
`codec.Frame`.
"""

from dataclasses import dataclass, fields
from typing import ClassVar

Row12 = tuple[int, int, int, int, int, int, int, int, int, int, int, int]
Row6 = tuple[int, int, int, int, int, int]


@dataclass(frozen=True, slots=True)
class SensorInfo:
    """One sensor of the board, as HELLO describes it."""

    model: int = 0
    """0 none, 1 ADXL345, 2 six-axis IMU, 3 analogue."""
    bus: int = 0
    range_code: int = 0
    rate_code: int = 0
    scale_ng: int = 0
    """1e-9 g (9.80665e-9 m/s^2) per count."""


NO_SENSORS = (SensorInfo(), SensorInfo(), SensorInfo(), SensorInfo())


@dataclass(frozen=True, slots=True)
class Hello:
    """Who speaks: sent at boot, on command and every 10 s."""

    TYPE: ClassVar[int] = 0x01

    minor: int
    board_id: int
    """0 LPC1768 cube, 1 simulated cube, 2 played log of real sensors, 3 emulated LPC1768 cube."""
    sensor_mask: int
    n_axes: int
    tick_hz: int
    sample_period_ns: int
    batch: int
    uid: bytes = b""
    """16 bytes; shorter ones are filled up with zeros."""
    firmware: bytes | str = b""
    """20 bytes: the git commit; 40 hex digits or a short ASCII name are converted."""
    version: tuple[int, int, int] = (0, 0, 0)
    config_crc: int = 0
    sensors: tuple[SensorInfo, ...] = NO_SENSORS

    def __post_init__(self) -> None:
        object.__setattr__(self, "uid", _padded(self.uid, 16, "uid"))
        object.__setattr__(self, "firmware", _padded(_commit_bytes(self.firmware), 20, "firmware"))

    @property
    def firmware_text(self) -> str:
        """The firmware's name if it is ASCII, else its commit in hex."""
        stem = bytes(self.firmware).rstrip(b"\0")
        return (
            stem.decode("ascii")
            if stem.isascii() and stem.decode("ascii").isprintable()
            else self.firmware.hex()
        )


def _commit_bytes(firmware: bytes | str) -> bytes:
    if isinstance(firmware, bytes):
        return firmware
    if len(firmware) == 40:
        try:
            return bytes.fromhex(firmware)
        except ValueError:
            pass
    return firmware.encode("ascii")


def _padded(value: bytes, length: int, name: str) -> bytes:
    if len(value) > length:
        raise ValueError(
            f"HELLO {name} has {len(value)} bytes, the wire carries {length}: shorten it"
        )
    return bytes(value).ljust(length, b"\0")


@dataclass(frozen=True, slots=True)
class Status:
    """The device's own counters since boot, 1 Hz.  All of them wrap at 2^32."""

    TYPE: ClassVar[int] = 0x02

    built: int = 0
    sent: int = 0
    dropped: int = 0
    samples: int = 0
    missed_ticks: int = 0
    sample_drops: int = 0
    spi_errors: tuple[int, int, int, int] = (0, 0, 0, 0)
    init_errors: tuple[int, int, int, int] = (0, 0, 0, 0)
    fifo_overruns: tuple[int, int, int, int] = (0, 0, 0, 0)
    tacho_total: int = 0
    tacho_overflow: int = 0
    pps_total: int = 0
    gps_bytes: int = 0
    rx_ok: int = 0
    rx_bad: int = 0
    uart_errors: int = 0
    free_stack: int = 0
    cpu_permille: int = 0
    last_seq: int = 0


@dataclass(frozen=True, slots=True)
class Acc12:
    """Samples of twelve accelerometer axes, counts as HELLO scales them."""

    TYPE: ClassVar[int] = 0x10

    first_index: int
    period_ns: int
    sensor_mask: int
    stale_mask: int
    counts: tuple[Row12, ...]
    """One row per sample: sensor 0 x y z, sensor 1 x y z, ..."""


@dataclass(frozen=True, slots=True)
class Adc:
    """Samples of an analogue accelerometer and gyroscope board."""

    TYPE: ClassVar[int] = 0x11

    first_index: int
    period_ns: int
    channel_mask: int
    vref_mv: int
    counts: tuple[tuple[int, ...], ...]
    """One row per sample, one column per set bit of `channel_mask`."""


@dataclass(frozen=True, slots=True)
class Tacho:
    """Pulse times of the tachometer."""

    TYPE: ClassVar[int] = 0x12

    first_pulse: int
    edge: int
    """Bit 0 rising edge, bit 1 direction known, bit 2 direction negative."""
    offsets_10ns: tuple[int, ...]
    """Time of each pulse after the frame's t_us, in 10 ns."""


@dataclass(frozen=True, slots=True)
class Pps:
    """One pulse per second of the GNSS receiver."""

    TYPE: ClassVar[int] = 0x13

    index: int
    fraction_ns: int
    flags: int


@dataclass(frozen=True, slots=True)
class Gps:
    """Raw bytes of the GNSS receiver, cut anywhere; t_us is the time of the first."""

    TYPE: ClassVar[int] = 0x14

    data: bytes


@dataclass(frozen=True, slots=True)
class Imu6:
    """Samples of a six-axis IMU, 32-bit counts."""

    TYPE: ClassVar[int] = 0x15

    first_index: int
    period_ns: int
    accel_scale_ug: int
    """1e-6 m/s^2 per count."""
    gyro_scale_nrad: int
    """1e-9 rad/s per count."""
    counts: tuple[Row6, ...]
    """One row per sample: specific force x y z, angular rate x y z."""


@dataclass(frozen=True, slots=True)
class Command:
    """Host to device."""

    TYPE: ClassVar[int] = 0x40

    command: int
    token: int
    arguments: bytes = b""


@dataclass(frozen=True, slots=True)
class Ack:
    """The device's answer to one `Command`."""

    TYPE: ClassVar[int] = 0x41

    command: int
    token: int
    status: int
    echo: bytes = b""


@dataclass(frozen=True, slots=True)
class Unknown:
    """A whole frame of a type this version does not know: received, not damage."""

    type: int
    payload: bytes

    @property
    def TYPE(self) -> int:  # noqa: N802, the same name as the constant of the other frames
        return self.type


Payload = Hello | Status | Acc12 | Adc | Tacho | Pps | Gps | Imu6 | Command | Ack | Unknown

CLASSES: tuple[type, ...] = (Hello, Status, Acc12, Adc, Tacho, Pps, Gps, Imu6, Command, Ack)


def field_names(payload_class: type) -> tuple[str, ...]:
    """Names of a payload's fields in wire order."""
    return tuple(field.name for field in fields(payload_class))
