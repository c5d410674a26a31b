"""The file of a backup: a zip of everything with a list of sizes and sha256 in front.

Nothing in it is believed before it was checked: the list against its model, the names against
paths that leave their place, every file against its size and sha256. A damaged or hostile file ends
in BackupError and in nothing else.
"""

import hashlib
import io
import os
import stat
import struct
import zipfile
import zlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import IO, Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from gyrofree.operations.backup.collecting import BLOCK, Collection, Taken
from gyrofree.operations.backup.parts import NAMES, BackupError
from inertial.whole_file import sync_folder
from messages.text import check as fault_in
from messages.text import plain

CONTENTS = "contents.json"
LARGEST_LIST = 64 << 20  # bytes
COMPRESSED = (".mcap", ".lz4", ".zst", ".png", ".jpg")
METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
DEPTH, LONG = 16, 200  # folders in a path, bytes of a name
# what the library raises for a file that is none, or is damaged
DAMAGED = (
    zipfile.BadZipFile,
    zipfile.LargeZipFile,
    zlib.error,
    EOFError,
    RuntimeError,  # encrypted, or a method that is not there
    ValueError,
    OverflowError,
    struct.error,
    KeyError,
    IndexError,
)

Size = Annotated[int, Field(ge=0, lt=2**62)]


class Entry(BaseModel):
    """A file of the list."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    part: str
    unit: str = ""
    path: str = ""
    size: Size
    sha256: str = Field(pattern="^[0-9a-f]{64}$")
    mode: Annotated[int, Field(ge=0, le=0o7777)] = 0o600
    note: str = ""

    @property
    def name(self) -> str:
        """In the archive."""
        return "/".join(filter(None, (self.part, self.unit, self.path)))


class Contents(BaseModel):
    """The list."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    what: Literal["gyrofree backup"] = "gyrofree backup"
    format: Literal[1] = 1
    made: str
    version: str  # of gyrofree
    entries: list[Entry]
    left_out: dict[str, str] = {}


def write(path: Path, collection: Collection, progress: Callable[[int], None]) -> Contents:
    """Write the archive, which is there whole or not at all. Raises BackupError, OSError."""
    if path.exists() and not path.is_file():  # it would take the place of a device
        raise BackupError(f"{path} is no file: name one")
    entries, taken = [], []
    for one in collection.taken:
        if not _stays(one.part, one.unit, one.path):
            collection.left_out[plain(one.name, 200)] = "its name can stand in no archive"
            continue
        fields = {name: getattr(one, name) for name in Entry.model_fields}
        entries.append(Entry(**fields))
        taken.append(one)
    contents = Contents(
        made=datetime.now(UTC).isoformat(timespec="seconds"),
        version=version("gyrofree"),
        entries=entries,
        left_out=collection.left_out,
    )
    if fault := _fault(contents):
        raise BackupError(fault)
    draft = path.with_name(f".{path.name}.{os.getpid()}.draft")
    flags = os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC
    try:
        with os.fdopen(os.open(draft, flags, 0o600), "w+b") as stream:
            with zipfile.ZipFile(stream, "w", allowZip64=True) as archive:
                text = contents.model_dump_json(indent=1)
                archive.writestr(CONTENTS, text, zipfile.ZIP_DEFLATED)
                for one in taken:
                    _add(archive, one, progress)
            stream.flush()
            os.fsync(stream.fileno())
        os.replace(draft, path)
        sync_folder(path.parent)
    finally:
        draft.unlink(missing_ok=True)
    return contents


def _add(archive: zipfile.ZipFile, one: Taken, progress: Callable[[int], None]) -> None:
    info = zipfile.ZipInfo(one.name)
    stored = one.name.endswith(COMPRESSED)
    info.compress_type = zipfile.ZIP_STORED if stored else zipfile.ZIP_DEFLATED
    info.external_attr = 0o600 << 16
    with archive.open(info, "w", force_zip64=one.size > BLOCK) as target:
        if one.content is not None:
            target.write(one.content)
            progress(one.size)
            return
        fd = os.open(one.source, os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC | os.O_NONBLOCK)
        with os.fdopen(fd, "rb") as source:
            if _copy(source, target, one.size, progress) != one.sha256:
                raise BackupError(f"{one.source} changed while it was read: try again")


@contextmanager
def opened(path: Path) -> Iterator["Archive"]:
    """An archive whose list is sound. Raises BackupError, OSError."""
    fd = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK)
    with os.fdopen(fd, "rb") as stream:
        if not stat.S_ISREG(os.fstat(fd).st_mode):
            raise BackupError(f"{path}: is no file")
        try:
            archive = zipfile.ZipFile(stream)
        except DAMAGED as error:
            raise BackupError(f"{path}: no backup of gyrofree: {plain(error, 100)}") from None
        yield Archive(path, archive)


class Archive:
    """A backup that is read."""

    def __init__(self, path: Path, archive: zipfile.ZipFile) -> None:
        self._path, self._archive = path, archive
        self.contents = self._contents()
        names = [CONTENTS, *(entry.name for entry in self.contents.entries)]
        if sorted(names) != sorted(archive.namelist()):
            raise BackupError(f"{path}: holds other files than its list says: it is damaged")

    def _contents(self) -> Contents:
        try:
            info = self._archive.getinfo(CONTENTS)
            if info.file_size > LARGEST_LIST or info.compress_type not in METHODS:
                raise ValueError("its list is too large")
            with self._archive.open(info) as stream:
                contents = Contents.model_validate_json(stream.read(LARGEST_LIST + 1))
        except ValidationError as error:
            first = error.errors()[0]
            where = ".".join(map(str, first["loc"])) or "the list"
            raise BackupError(
                f"{self._path}: {CONTENTS}: {plain(where, 80)}: {plain(first['msg'], 100)}; it is"
                " damaged, or of a later version"
            ) from None
        except (*DAMAGED, OSError) as error:
            raise BackupError(
                f"{self._path}: no backup of gyrofree: {CONTENTS} cannot be read:"
                f" {plain(error, 100)}"
            ) from None
        if fault := _fault(contents):
            raise BackupError(f"{self._path}: {fault}")
        return contents

    def verify(
        self, entries: Iterable[Entry], progress: Callable[[int], None] = lambda _: None
    ) -> None:
        """Read files against their hashes; raises BackupError."""
        for entry in entries:
            self.copy(entry, _Nowhere(), progress)

    def content(self, entry: Entry) -> bytes:
        """Of a small file; raises BackupError."""
        target = io.BytesIO()
        self.copy(entry, target)
        return target.getvalue()

    def copy(
        self, entry: Entry, target: IO[bytes], progress: Callable[[int], None] = lambda _: None
    ) -> None:
        """Write a file's bytes, which have its size and hash when this returns. Raises BackupError
        for what the archive has, OSError for what the target refuses.
        """
        try:
            info = self._archive.getinfo(entry.name)
            if info.compress_type not in METHODS or info.file_size != entry.size:
                raise ValueError("its size is not that of the list")
            source: IO[bytes] = self._archive.open(info)
        except (*DAMAGED, OSError) as error:
            raise self._damaged(entry, error) from None
        with source:
            checked = _Checked(source, lambda error: self._damaged(entry, error))
            if _copy(checked, target, entry.size, progress) != entry.sha256:
                raise self._damaged(entry, ValueError("its sha256 is another"))

    def _damaged(self, entry: Entry, error: Exception) -> BackupError:
        return BackupError(f"{self._path}: {plain(entry.name, 120)}: {plain(error, 100)}: damaged")


class _Checked(io.RawIOBase):
    """A source whose faults are the archive's, not the target's."""

    def __init__(self, source: IO[bytes], said: Callable[[Exception], BackupError]) -> None:
        self._source, self._said = source, said

    def read(self, size: int = -1) -> bytes:
        try:
            return self._source.read(size)
        except (*DAMAGED, OSError) as error:
            raise self._said(error) from None


class _Nowhere(io.RawIOBase):
    def write(self, data) -> int:  # noqa: ANN001
        return len(data)


def _copy(source: IO[bytes], target: IO[bytes], size: int, progress: Callable[[int], None]) -> str:
    """Copy `size` bytes; their sha256, or "" where there are not so many, or more."""
    hashed, read = hashlib.sha256(), 0
    while read < size and (block := source.read(min(BLOCK, size - read))):
        hashed.update(block)
        target.write(block)
        read += len(block)
        progress(len(block))
    return hashed.hexdigest() if read == size else ""


def _fault(contents: Contents) -> str:
    """What is wrong with the names of a list, or ""."""
    names = [entry.name for entry in contents.entries]
    if len(set(names)) != len(names):
        return "its list names a file twice"
    folders = {"/".join(n.split("/")[:k]) for n in names for k in range(1, n.count("/") + 1)}
    for entry in contents.entries:
        if entry.part not in NAMES or entry.name in folders or not _stays(*_place(entry)):
            return f"its list names {plain(entry.name, 120)!r}, which may be in no backup"
    return ""


def _place(entry: Entry) -> tuple[str, str, str]:
    return entry.part, entry.unit, entry.path


def _stays(part: str, unit: str, path: str) -> bool:
    """Does a name stay below its part, whatever the part is?"""
    pieces = [piece for text in (unit, path) if text for piece in text.split("/")]
    return len(pieces) <= DEPTH and all(map(_sound, pieces))


def _sound(piece: str) -> bool:
    return (
        piece not in ("", ".", "..")
        and "\\" not in piece
        and len(piece.encode(errors="replace")) <= LONG
        and not fault_in(piece)
    )
