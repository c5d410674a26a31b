"""[recorder] of gyrofree.toml."""

from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field


class RecorderSettings(BaseModel):
    """Where and how sessions are recorded."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    root: Path = Path("sessions-data")  # folder of all sessions; made when absent
    auto_start: bool = True  # begin a session as soon as the bus is there, without an order
    name: str = Field(
        default="", pattern=r"^([a-z0-9][a-z0-9_-]{0,31})?$"
    )  # added to the ids of sessions begun so
    max_file_bytes: int = Field(
        default=2 * 1024**3, ge=64 * 1024
    )  # then a new session continues, bytes
    chunk_bytes: int = Field(
        default=128 * 1024, ge=4096, le=128 * 1024
    )  # largest MCAP chunk, uncompressed, bytes
    flush_s: float = Field(default=0.4, gt=0, le=0.5)  # a chunk is closed at least this often, s
    sync_s: float = Field(
        default=0.5, gt=0, le=0.5
    )  # fdatasync after each flush, and at least this often, s
    max_pending_bytes: int = Field(
        default=32 * 1024**2, ge=1024**2
    )  # held in memory while the disk is full, bytes
    max_inbox: int = Field(
        default=200_000, ge=1000
    )  # messages waiting to be written; more are counted as overflow
    max_inbox_bytes: int = Field(default=256 * 1024**2, ge=1024**2)  # likewise, bytes
    max_devices: int = Field(
        default=256, ge=1, le=4096
    )  # recorded in one session, those that come first; messages of more are counted as refused
    keep_days: float = Field(
        default=0.0, ge=0
    )  # older sessions are deleted at the start, unless tagged `keep`; 0: never
    keep_bytes: int = Field(
        default=0, ge=0
    )  # the oldest are deleted until all are below this, in bytes; 0: no limit
