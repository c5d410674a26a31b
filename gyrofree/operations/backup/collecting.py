"""What a backup takes, as it is at one moment, while services run.

Small files are read at once, all of a part between two looks that find it unchanged; files of
recordings are only added to, so a running one is taken up to the last whole record that it has
now.
"""

import hashlib
import os
import stat
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from gyrofree.operations.backup.parts import (
    FILES,
    BackupError,
    Part,
    files_below,
)
from sessions.recording.manifest import RECORDING, SESSION_ID, SessionError, read_manifest
from sessions.recording.mcap_records import RECORD
from sessions.recording.mcap_writer import MAGIC

SMALL = 1 << 20  # bytes of a file that is kept in memory
BLOCK = 1 << 20
LOOKS, PAUSE_S = 20, 0.1  # until a part has not changed while it was read
DRAFTS = (".new", ".draft", ".part", ".tmp")  # ends of names of what is being written
ENDS = (0x0F, 0x02)  # records after the last message: DataEnd, Footer


@dataclass
class Taken:
    """One file."""

    part: str
    unit: str  # of the part that is restored as a whole; "" where the part is one
    path: str  # within the unit; "" where the unit is a file
    source: Path
    size: int
    sha256: str
    mode: int
    content: bytes | None = None  # of a small one
    note: str = ""

    @property
    def name(self) -> str:
        """In the archive."""
        return "/".join(filter(None, (self.part, self.unit, self.path)))


@dataclass
class Collection:
    """All of them, and what was left out with its reason."""

    taken: list[Taken] = field(default_factory=list)
    left_out: dict[str, str] = field(default_factory=dict)


def collect(
    parts: list[Part], named: dict[str, Path], progress: Callable[[int], None] = lambda _: None
) -> Collection:
    """Look at every file. progress: called with the bytes read. Raises BackupError, OSError."""
    found = Collection()
    for part in parts:
        if part.kind == "sessions":
            _sessions(part, found, progress)
        else:
            _steady(part, found, progress)
    for key, path in named.items():
        if _regular(path, f"{FILES}/{key}", found):
            found.taken.append(take(FILES, key, "", _real(path), progress))
    return found


def whole_part(path: Path) -> int:
    """Bytes of a recording that is being written, to the end of its last whole record, without
    what a closed one has at its end. Raises OSError.
    """
    with path.open("rb") as stream:
        size = os.fstat(stream.fileno()).st_size
        end = len(MAGIC)
        while end + RECORD.size <= size:
            stream.seek(end)
            opcode, length = RECORD.unpack(stream.read(RECORD.size))
            if opcode in ENDS or end + RECORD.size + length > size:
                break
            end += RECORD.size + length
    return min(end, size)


def take(
    part: str,
    unit: str,
    path: str,
    source: Path,
    progress: Callable[[int], None],
    size: int | None = None,
) -> Taken:
    """Read one file, or its first `size` bytes. Raises BackupError, OSError."""
    fd = os.open(source, os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC | os.O_NONBLOCK)
    with os.fdopen(fd, "rb") as stream:
        status = os.fstat(stream.fileno())
        if not stat.S_ISREG(status.st_mode):
            raise BackupError(f"{source}: no file any more; try again")
        wanted = status.st_size if size is None else size
        if wanted <= SMALL:
            content = stream.read(wanted)
            digest = hashlib.sha256(content).hexdigest()
            progress(len(content))
            mode = stat.S_IMODE(status.st_mode)
            return Taken(part, unit, path, source, len(content), digest, mode, content)
        hashed, read = hashlib.sha256(), 0
        while read < wanted and (block := stream.read(min(BLOCK, wanted - read))):
            hashed.update(block)
            read += len(block)
            progress(len(block))
    return Taken(part, unit, path, source, read, hashed.hexdigest(), stat.S_IMODE(status.st_mode))


def _steady(part: Part, found: Collection, progress: Callable[[int], None]) -> None:
    """All of a part between two looks that find the same."""
    for _ in range(LOOKS):
        left_out: dict[str, str] = {}
        before = _stamps(part)
        try:
            taken = [
                take(part.name, unit, path, source, progress)
                for unit, path, source in _listed(part, left_out)
            ]
        except FileNotFoundError:
            taken = None
        if taken is not None and _stamps(part) == before:
            found.taken += taken
            found.left_out |= left_out
            return
        time.sleep(PAUSE_S)
    raise BackupError(f"{part.path} changes all the time: stop what writes it, or try again")


def _listed(part: Part, left_out: dict[str, str]) -> Iterator[tuple[str, str, Path]]:
    """(unit, path in it, file) of a part that is no folder of sessions."""
    path = part.path
    if part.kind == "file":
        if _is_file(_real(path), part.name, left_out):
            yield "", "", _real(path)
    elif part.kind == "family":
        for member in sorted(path.parent.glob(f"{path.name}*")) if path.parent.is_dir() else []:
            if member.is_dir() and not member.is_symlink():
                yield from _below(member, part.name, member.name, left_out)
            elif _is_file(member, f"{part.name}/{member.name}", left_out):
                yield member.name, "", member
    elif path.is_dir():
        for below, entry in files_below(_real(path)):
            if _is_file(Path(entry.path), f"{part.name}/{below}", left_out):
                whole = part.kind == "folder"
                yield ("", below, Path(entry.path)) if whole else (below, "", Path(entry.path))


def _below(
    folder: Path, part: str, unit: str, left_out: dict[str, str]
) -> Iterator[tuple[str, str, Path]]:
    for below, entry in files_below(folder):
        if _is_file(Path(entry.path), f"{part}/{unit}/{below}", left_out):
            yield unit, below, Path(entry.path)


def _stamps(part: Part) -> list[tuple[str, int, int]]:
    """Of all files of a part."""
    found = []
    for unit, path, source in _listed(part, {}):
        try:
            status = source.lstat()
        except FileNotFoundError:
            continue
        found.append((f"{unit}/{path}", status.st_size, status.st_mtime_ns))
    return found


def _sessions(part: Part, found: Collection, progress: Callable[[int], None]) -> None:
    if not part.path.is_dir():
        return
    root = _real(part.path)
    for entry in sorted(os.scandir(root), key=lambda entry: entry.name):
        name = f"{part.name}/{entry.name}"
        if SESSION_ID.fullmatch(entry.name) and entry.is_dir(follow_symlinks=False):
            try:
                found.taken += _session(part, Path(entry.path), found, progress)
            except FileNotFoundError:
                found.left_out[name] = "it was removed meanwhile"
        elif entry.is_symlink():
            found.left_out[name] = "is a link"
        elif entry.is_file() and not entry.name.endswith(DRAFTS):
            found.taken.append(take(part.name, entry.name, "", Path(entry.path), progress))


def _session(
    part: Part, folder: Path, found: Collection, progress: Callable[[int], None]
) -> list[Taken]:
    """The files of a session; of one that is being recorded what is whole now."""
    try:
        running = read_manifest(folder).state == "open"
    except SessionError:
        running = False  # whatever it is, it is kept as it is
    taken = []
    # what says how it stands is read before what it is about
    listed = sorted(files_below(folder), key=lambda pair: (pair[0] == RECORDING, pair[0]))
    for below, entry in listed:
        source = Path(entry.path)
        if below.endswith(DRAFTS) or not _is_file(
            source, f"{part.name}/{folder.name}/{below}", found.left_out
        ):
            continue
        size = whole_part(source) if running and below == RECORDING else None
        one = take(part.name, folder.name, below, source, progress, size)
        if size is not None:
            one.note = "being recorded: up to its last whole record"
        taken.append(one)
    return taken


def _real(path: Path) -> Path:
    """Where a path of the settings leads: that may be a link, what is found there may not."""
    return Path(os.path.realpath(path))


def _regular(path: Path, name: str, found: Collection) -> bool:
    """Is a file that the settings name there? They may name a link."""
    if not path.exists():
        found.left_out[name] = f"{path} is not there"
    elif not path.is_file():
        found.left_out[name] = f"{path} is no file"
    else:
        return True
    return False


def _is_file(path: Path, name: str, left_out: dict[str, str]) -> bool:
    try:
        mode = path.lstat().st_mode
    except FileNotFoundError:
        return False
    if stat.S_ISLNK(mode):
        left_out[name] = "is a link"
    elif not stat.S_ISREG(mode):
        left_out[name] = "is no file"
    return stat.S_ISREG(mode) and not path.name.endswith(DRAFTS)
