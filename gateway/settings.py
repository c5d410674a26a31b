"""[gateway] of gyrofree.toml."""

from pathlib import Path

from pydantic import BaseModel, ConfigDict, model_validator

from gateway.samples.analogue import AnalogueSettings
from messages.contract.names import Name
from messages.setting import setting


class DeviceSettings(BaseModel):
    """[[gateway.devices]]: one board and how it is attached."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: Name = setting(..., "second part of every bus key of this board")
    port: str = setting(
        ...,
        "`/dev/serial/by-id/...` (`/dev/ttyUSB0` may be another board tomorrow), a pty's path,"
        " `tcp://host:port`, `rfc2217://host:port` or `file:///path`",
    )
    baud: int = setting(
        921600, "ignored by pty, tcp and file", unit="bit/s", shown=True, ge=1200, le=4_000_000
    )
    layout: str = setting(
        "cube", "a note for people; the estimator goes by `[estimator.layout]` and `layouts`"
    )
    gnss_port: str | None = setting(
        None, "of a receiver on its own port; left out: only what the board's frames bring"
    )
    gnss_baud: int = setting(38400, "of that port", unit="bit/s", ge=1200, le=4_000_000)
    gnss_latency_s: float = setting(
        0.0, "shortest delay from the time of a fix to its arrival", unit="s", ge=0.0, le=2.0
    )
    tacho_pulses_per_rev: int = setting(
        360,
        "rising edges of the tachometer in one turn of the table",
        unit="1",
        shown=True,
        ge=1,
        le=1_000_000,
    )
    analogue: AnalogueSettings = setting(
        AnalogueSettings(), "of a board with analogue sensors (ADC frames)"
    )
    time_scale: float = setting(
        1.0, "device seconds per host second; N for a log played at N x", gt=0.0, le=1000.0
    )


class GatewaySettings(BaseModel):
    """[gateway]: the boards of this machine and the journal of what they said."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    devices: list[DeviceSettings] = setting([], "the boards, a block for each")
    journal: Path = setting(
        Path("var/journal"),
        "every byte that was read, before anything else happens with it; a folder per device",
        shown=True,
    )
    journal_bytes: int = setting(
        2 << 30, "kept per device, oldest segments go first", unit="bytes", ge=1 << 20
    )
    published_bytes: int = setting(
        1 << 30,
        "of published messages kept per device, for consumers that missed some",
        unit="bytes",
        ge=1 << 20,
    )
    published_age_s: float = setting(
        7200.0, "published messages are kept no longer", unit="s", ge=60.0
    )
    segment_bytes: int = setting(
        4 << 20, "of a journal file; a history query reads whole ones", unit="bytes", ge=1 << 16
    )
    sync_s: float = setting(
        0.25,
        "between fdatasync calls: what a power cut may cost",
        unit="s",
        gt=0.0,
        le=60.0,
    )

    @model_validator(mode="after")
    def _names_differ(self) -> "GatewaySettings":
        names = [device.name for device in self.devices]
        double = sorted({name for name in names if names.count(name) > 1})
        if double:
            raise ValueError(
                f"devices: the name {double[0]!r} stands twice; every board needs its own"
            )
        return self
