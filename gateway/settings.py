"""[gateway] of gyrofree.toml."""

from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field, model_validator

from gateway.samples.analogue import AnalogueSettings
from messages.contract.names import Name


class DeviceSettings(BaseModel):
    """[[gateway.devices]]: one board and how it is attached."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: Name  # second part of every key of this board
    # /dev/serial/by-id/..., a pty's path, tcp://host:port, rfc2217://host:port, file:///path
    port: str
    baud: int = Field(
        default=921600, ge=1200, le=4_000_000
    )  # bits per second; ignored by pty, tcp and file
    layout: str = "cube"  # name of the sensor layout, read by the estimator
    gnss_port: str | None = (
        None  # a receiver on its own port; None: only what comes inside GPS frames
    )
    gnss_baud: int = Field(default=38400, ge=1200, le=4_000_000)  # bits per second
    gnss_latency_s: float = Field(
        default=0.0, ge=0.0, le=2.0
    )  # shortest delay from time of fix to arrival, s
    tacho_pulses_per_rev: int = Field(
        default=360, ge=1, le=1_000_000
    )  # rising edges per turn of the table
    analogue: AnalogueSettings = AnalogueSettings()  # of a board with analogue sensors (ADC frames)
    time_scale: float = Field(
        default=1.0, gt=0.0, le=1000.0
    )  # device s per host s; N for a log played at N x


class GatewaySettings(BaseModel):
    """[gateway]: the boards of this machine and the journal of what they said."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    devices: list[DeviceSettings] = Field(default_factory=list)
    journal: Path = Path("journal")  # folder; one sub-folder per device
    journal_bytes: int = Field(
        default=2 << 30, ge=1 << 20
    )  # bytes kept per device, oldest segments go first
    published_bytes: int = Field(
        default=1 << 30, ge=1 << 20
    )  # bytes of published messages kept per device ...
    published_age_s: float = Field(
        default=7200.0, ge=60.0
    )  # ... and s, for consumers that missed some
    segment_bytes: int = Field(
        default=4 << 20, ge=1 << 16
    )  # bytes; a history query reads whole segments
    sync_s: float = Field(
        default=0.25, gt=0.0, le=60.0
    )  # s between fdatasync calls: what a power cut may cost

    @model_validator(mode="after")
    def _names_differ(self) -> "GatewaySettings":
        names = [device.name for device in self.devices]
        double = sorted({name for name in names if names.count(name) > 1})
        if double:
            raise ValueError(
                f"devices: the name {double[0]!r} stands twice; every board needs its own"
            )
        return self
