"""The sessions of a folder: list, find, name their files. Reads only; recovery is the recorder's
(recover.py).
"""

import os
from dataclasses import dataclass, field
from pathlib import Path

from messages.clock import Moment
from sessions.library.annotations import Annotations, read_annotations
from sessions.recording.manifest import (
    RECORDING,
    SESSION_ID,
    Manifest,
    SessionError,
    check_id,
    read_manifest,
)


@dataclass(frozen=True)
class SessionInfo:
    """One line of the list of sessions."""

    id: str
    devices: tuple[str, ...]
    start_utc_ns: int  # ns since 1970
    seconds: float  # start to last message
    state: str  # open, closed, recovered, or unreadable
    bytes: int
    messages: int
    lost: int  # jumps of sequence and refused messages; see docs/recordings.md
    path: Path | None  # of the MCAP file; None when there is none
    note: str
    problem: str = ""  # why it is unreadable or incomplete; empty when all is well
    number: int = 0  # of the session in its folder; grows; 0: of a version that gave none
    clock_steps: tuple[float, ...] = ()  # by which the wall clock was set while it was recorded, s
    written: Moment | None = None  # when its session.json was
    sources: tuple[str, ...] = ()  # HARDWARE, SIMULATED, EMULATED, PLAYED
    annotations: Annotations = field(
        default_factory=Annotations
    )  # title, tags, outcome and notes by people


class Catalogue:
    """What stands below one root folder."""

    def __init__(self, root: Path) -> None:
        self.root = Path(root)

    def list(self) -> list[SessionInfo]:
        """All sessions, newest first, also those that cannot be read, with the reason. A missing
        root has none.

        Raises SessionError when the root exists but cannot be listed.
        """
        try:
            names = [
                entry.name for entry in os.scandir(self.root) if SESSION_ID.fullmatch(entry.name)
            ]
        except FileNotFoundError:
            return []
        except OSError as error:
            raise SessionError(f"{self.root}: {error.strerror}") from error
        return [self._info(name) for name in sorted(names, reverse=True)]

    def get(self, session: str) -> SessionInfo:
        """One session; raises SessionError for a name that is no id and for one that does not
        exist.
        """
        if not (self.root / check_id(session)).is_dir():
            raise SessionError(f"session {session}: not in {self.root}")
        return self._info(session)

    def path(self, session: str) -> Path:
        """The MCAP file of a session; raises SessionError when there is none to read."""
        info = self.get(session)
        if info.path is None:
            raise SessionError(f"session {session}: {info.problem}")
        return info.path

    def manifest(self, session: str) -> Manifest:
        """Everything session.json says; raises SessionError."""
        return read_manifest(self.root / check_id(session))

    def _info(self, session: str) -> SessionInfo:
        folder = self.root / session
        try:
            manifest = read_manifest(folder)
            path = folder / manifest.file
            size = path.stat().st_size
        except (SessionError, OSError) as error:
            return SessionInfo(
                session, (), 0, 0.0, "unreadable", 0, 0, 0, None, "", problem=str(error)
            )
        problem = manifest.recovery
        if manifest.state == "closed" and size != manifest.bytes:
            problem = (
                f"{path}: {size} bytes, but {manifest.bytes} when it was closed: changed or cut"
                " since"
            )
        elif manifest.state == "open":
            problem = (
                f"{RECORDING} is not closed: it is being recorded, or was cut off and waits for the"
                " recorder"
            )
        notes, damage = _annotations(folder)
        return SessionInfo(
            id=session,
            devices=tuple(manifest.devices),
            start_utc_ns=manifest.start_utc_ns,
            seconds=max(0, manifest.end_utc_ns - manifest.start_utc_ns) / 1e9,
            state=manifest.state,
            bytes=size,
            messages=manifest.messages,
            lost=manifest.lost,
            path=path,
            note=manifest.note,
            problem="; ".join(filter(None, (problem, damage))),
            number=manifest.number,
            clock_steps=tuple(step.step_s for step in manifest.clock_steps),
            written=Moment.of(manifest.written),
            sources=tuple(manifest.sources),
            annotations=notes,
        )


def _annotations(folder: Path) -> tuple[Annotations, str]:
    """What people added, and why it cannot be read."""
    try:
        return read_annotations(folder), ""
    except SessionError as error:
        return Annotations(), str(error)
