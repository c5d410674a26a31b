"""[recorder] of gyrofree.toml."""

from pathlib import Path

from pydantic import BaseModel, ConfigDict

from messages.setting import setting


class RecorderSettings(BaseModel):
    """Where and how sessions are recorded."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    root: Path = setting(
        Path("var/sessions"), "folder of all sessions; made when absent", shown=True
    )
    auto_start: bool = setting(
        False,
        "begin a session as soon as the bus is there, without an order from the page",
        shown=True,
    )
    name: str = setting(
        "", "added to the ids of sessions begun so", pattern=r"^([a-z0-9][a-z0-9_-]{0,31})?$"
    )
    max_file_bytes: int = setting(
        2 * 1024**3, "of a session's file; then a new session continues", unit="bytes", ge=64 * 1024
    )
    chunk_bytes: int = setting(
        128 * 1024,
        "largest MCAP chunk, uncompressed",
        unit="bytes",
        ge=4096,
        le=128 * 1024,
    )
    flush_s: float = setting(0.4, "a chunk is closed at least this often", unit="s", gt=0, le=0.5)
    sync_s: float = setting(
        0.5, "fdatasync after each flush, and at least this often", unit="s", gt=0, le=0.5
    )
    max_pending_bytes: int = setting(
        32 * 1024**2, "held in memory while the disk is full", unit="bytes", ge=1024**2
    )
    max_inbox: int = setting(
        200_000, "messages waiting to be written; more are counted as overflow", ge=1000
    )
    max_inbox_bytes: int = setting(256 * 1024**2, "likewise", unit="bytes", ge=1024**2)
    max_devices: int = setting(
        256,
        "recorded in one session, those that come first; messages of more are counted as refused",
        ge=1,
        le=4096,
    )
    keep_days: float = setting(
        0.0,
        "older sessions are deleted at the start, unless tagged `keep`; 0: never",
        unit="d",
        ge=0,
    )
    keep_bytes: int = setting(
        0, "the oldest are deleted until all are below this; 0: no limit", unit="bytes", ge=0
    )
