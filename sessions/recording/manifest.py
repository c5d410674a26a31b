"""session.json: what a session is, beside its recording.

A session is a folder `<root>/<id>/` with `session.json` and one MCAP file. The state says how far
to trust the file: open (being recorded, or cut off), closed (complete, with its hash), recovered
(rebuilt from one cut off, which stays).
"""

import os
import re
import unicodedata
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from inertial.whole_file import sync_folder
from messages import text
from messages.clock import Moment

MANIFEST = "session.json"
RECORDING = "recording.mcap"
RECOVERED = "recovered.mcap"
NUMBER = "number"  # file of a folder of sessions: the newest one's number
SESSION_NAME = re.compile(r"[a-z0-9][a-z0-9_-]{0,31}")  # what a person may add to an id
SESSION_ID = re.compile(r"[0-9]{8}-[0-9]{6}(-[a-z0-9][a-z0-9_-]{0,40})?")


NAME_LENGTH = 100  # characters that a person may call a session
GERMAN = str.maketrans({"ä": "ae", "ö": "oe", "ü": "ue", "ß": "ss"})  # the usual way to write them


def name_fault(name: str) -> str:
    """Why a session may not be called so, or "". Its id takes of the name what it can: slug."""
    if len(name) > NAME_LENGTH:
        return f"name of {len(name)} characters: want at most {NAME_LENGTH}"
    fault = text.check(name)
    return f"name: {fault}" if fault else ""


def slug(name: str, longest: int = 32) -> str:
    """What a person calls a session, as it may stand in an id: "Messung Prüfstand (2)" ->
    "messung-pruefstand-2"; empty when no letter of it can.
    """
    small = unicodedata.normalize("NFC", name).lower().translate(GERMAN)
    ascii_only = unicodedata.normalize("NFKD", small).encode("ascii", "ignore").decode()
    return re.sub(r"[^a-z0-9_-]+", "-", ascii_only)[:longest].strip("-_")


class SessionError(ValueError):
    """A session that cannot be named, found or read; the text says which and why."""


def name_of(recording: Path) -> str:
    """What a recording is called: its session's id, else the file's own name."""
    return recording.parent.name if recording.name in (RECORDING, RECOVERED) else recording.stem


Count = Annotated[int, Field(ge=0, lt=2**63)]
Nanoseconds = Annotated[int, Field(ge=-(2**63), lt=2**63)]  # so that any time can be written


class KeyCount(BaseModel):
    """What came in on one bus key."""

    model_config = ConfigDict(extra="ignore")

    messages: Count = 0
    lost: Count = 0  # sum of forward jumps of header.sequence within one run
    restarts: Count = 0  # header.run changed or header.sequence went back: the publisher began anew
    repeated: Count = 0  # the same header.sequence twice running
    unreadable: Count = 0  # payloads without a readable header; recorded all the same
    repaired: Count = 0  # of `messages`, filled in from what their publisher had kept
    missing_samples: int = 0  # between its batches, by their index and the device's own clock
    # s, by the board's clock, that nobody spoke between one publisher's last message and the next's
    dark_s: float = 0.0
    last_run: int = 0  # of the newest message: where the session after a crash goes on
    last_sequence: int = 0

    @property
    def expected(self) -> int:
        """Messages that ought to be here: those that are, without repetitions, and those known to
        be missing.
        """
        return self.messages - self.repeated + self.lost


class ClockStep(BaseModel):
    """The wall clock was set while a session was recorded. Its times go on without the step."""

    model_config = ConfigDict(extra="ignore")

    at_utc_ns: Nanoseconds = 0  # on the session's axis
    step_s: float = 0.0  # by how much it went forward


class Manifest(BaseModel):
    """The content of session.json. Unknown fields are left out on reading: later versions may add
    some.
    """

    model_config = ConfigDict(extra="ignore")

    format: Literal[1] = 1
    id: str = Field(pattern=rf"^{SESSION_ID.pattern}$")
    state: Literal["open", "closed", "recovered"] = "open"
    file: Literal["recording.mcap", "recovered.mcap"] = RECORDING
    note: str = ""
    user: str = ""  # who ordered the start; empty when it began by itself
    continues: str = (
        ""  # id of the session before, when this one began because that file was full or cut off
    )
    devices: list[str] = []
    sources: list[str] = []  # names of messages.Source seen in headers: HARDWARE, SIMULATED, ...
    number: int = 0  # grows from session to session of a folder, whatever the wall clock says
    # Receive time of the start and of the last message counted here, ns since 1970: the wall clock
    # at the start, and what has elapsed since.
    start_utc_ns: Nanoseconds = 0
    end_utc_ns: Nanoseconds = 0
    clock_steps: list[ClockStep] = []
    written: list[str | int] = []  # when this was written: messages.clock.Moment
    bytes: Count = 0  # of the file
    sha256: str = ""  # of the closed or recovered file
    keys: dict[str, KeyCount] = {}
    channels: dict[
        int, str
    ] = {}  # MCAP channel id -> bus key, so that a file can be read without its first chunk
    overflow: Count = 0  # messages not recorded because the disk or the process could not keep up
    unknown: Count = 0  # messages on keys that are not in the topic table; not recorded
    # messages not recorded, by device and what was wrong with them (messages/contract/door.py)
    refused: dict[str, dict[str, int]] = {}
    recovery: str = ""  # what the recovery found and kept
    certificate: dict[str, dict[str, object]] = {}  # per device: certificate.DeviceCertificate
    provenance: dict[str, dict[str, object]] = {}  # per device: firmware, board, calibration files
    versions: dict[str, str] = {}
    configuration: dict[str, object] = {}

    @property
    def messages(self) -> int:
        """Messages counted over all keys."""
        return sum(count.messages for count in self.keys.values())

    @property
    def lost(self) -> int:
        """Messages known to be missing: jumps of sequence, and what was refused."""
        return sum(count.lost for count in self.keys.values()) + self.overflow


def whole(manifest: Manifest | None, *before: Manifest) -> Manifest | None:
    """That of a session with the counts of those that it goes on with."""
    if manifest is None or not before:
        return manifest
    keys = {key: count.model_copy() for key, count in manifest.keys.items()}
    for key, count in [item for one in before for item in one.keys.items()]:
        mine = keys.setdefault(key, KeyCount())
        mine.messages += count.messages
        mine.lost += count.lost
        mine.repeated += count.repeated
    return manifest.model_copy(update={"keys": keys})


def check_id(session: str) -> str:
    """The id itself; raises SessionError for anything that is not one, so that an id can be used as
    a folder name.
    """
    if not SESSION_ID.fullmatch(session):
        raise SessionError(
            f"session {session[:80]!r}: want an id like 20260131-120000 or 20260131-120000-name"
        )
    return session


def read_manifest(folder: Path) -> Manifest:
    """session.json of a folder; raises SessionError with the file and the reason."""
    path = folder / MANIFEST
    try:
        manifest = Manifest.model_validate_json(path.read_bytes())
    except OSError as error:
        raise SessionError(f"{path}: {error.strerror}") from error
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"]) or "the file"
        raise SessionError(f"{path}: {where}: {first['msg']}") from error
    if manifest.id != folder.name:
        raise SessionError(f"{path}: id {manifest.id!r} stands in the folder of {folder.name!r}")
    return manifest


def next_number(root: Path) -> int:
    """The number of a session that begins now: above those of all sessions in the folder, and of
    all that ever were as far as the file beside them tells.
    """
    path = root / NUMBER
    try:
        known = [int(path.read_text())]
    except (OSError, ValueError):
        known = []
    try:
        names = [entry.name for entry in os.scandir(root) if SESSION_ID.fullmatch(entry.name)]
    except OSError:
        names = []
    if not known:  # once, in a folder of before: its sessions have none, or a backup came without
        for name in names:
            try:
                known.append(read_manifest(root / name).number)
            except SessionError:
                continue
    number = max(known, default=0) + 1
    try:
        root.mkdir(parents=True, exist_ok=True)
        new = path.with_suffix(".new")
        new.write_text(f"{number}\n")
        os.replace(new, path)
    except OSError:
        pass  # the session itself says what the disk refuses
    return number


def write_manifest(folder: Path, manifest: Manifest) -> None:
    """Replace session.json in one step: after a crash there is the old or the new one. Raises
    OSError.
    """
    manifest.written = list(Moment.now())
    new = folder / (MANIFEST + ".new")
    with new.open("w", encoding="utf-8") as stream:
        stream.write(manifest.model_dump_json(indent=1) + "\n")
        stream.flush()
        os.fsync(stream.fileno())
    os.replace(new, folder / MANIFEST)
    sync_folder(folder)
