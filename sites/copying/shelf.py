"""The files of recorded sessions as segments, each named by its content.

A recording only grows, so a segment that is full never changes, and a copy can begin while the
recording still runs. What does change (the last segment, a recovered file, a note in session.json)
gets another hash, and is fetched again; nothing else is.
"""

import hashlib
import os
import re
import threading
from pathlib import Path
from typing import NamedTuple

from pydantic import BaseModel, ConfigDict, Field

SEGMENT = 250_000  # bytes
PART = 25_000  # of a segment, asked for at once
KEPT = (".mcap", ".json")  # what is copied; drawings of curves are made anew where they are wanted
SESSION = re.compile(r"[0-9]{8}-[0-9]{6}(-[a-z0-9][a-z0-9_-]{0,40})?")
FILE = re.compile(r"[a-z][a-z0-9_-]{0,39}\.(mcap|json)")
MOST_FILES = 32  # of a session


class ShelfError(ValueError):
    """There is no such session, file or segment."""


class Listed(BaseModel):
    """One file."""

    model_config = ConfigDict(extra="forbid")

    # first, so that of a list that has grown only the end is another (since.py)
    segments: list[str] = Field(max_length=4_000_000)  # sha256 of each
    size: int = Field(ge=0, lt=1 << 46)
    sha256: str = Field(pattern="^[0-9a-f]{64}$")


class Listing(BaseModel):
    """One session."""

    model_config = ConfigDict(extra="forbid")

    files: dict[str, Listed] = Field(max_length=MOST_FILES)


class Shelf:
    """The sessions below a folder. Hashes are kept as long as a file has not changed."""

    def __init__(self, root: Path) -> None:
        self._root = root
        self._known: dict[Path, tuple[tuple[int, int, int], Hashed]] = {}
        self._hashing = threading.Lock()  # a long file is hashed once, whoever asks

    def stamps(self) -> dict[str, str]:
        """By session what changes when one of its files does, without reading them."""
        try:
            names = sorted(e.name for e in os.scandir(self._root) if SESSION.fullmatch(e.name))
        except FileNotFoundError:
            return {}
        found = {}
        for name in names:
            said = [f"{path.name} {_stamp(path)}" for path in self._files(name)]
            if said:
                found[name] = hashlib.sha256("\n".join(said).encode()).hexdigest()
        return found

    def listing(self, session: str) -> Listing:
        """All segments of a session; raises ShelfError where there is none, OSError."""
        files = {path.name: self.listed(path) for path in self._files(session)}
        if not files:
            raise ShelfError(f"no session {session[:60]!r}")
        return Listing(files=files)

    def listed(self, path: Path) -> Listed:
        """One file; raises OSError."""
        with self._hashing:
            stamp = _stamp(path)
            old, hashed = self._known.get(path, (None, None))
            if hashed is None or old != stamp:
                grown = old is not None and old[2] == stamp[2] and old[0] <= stamp[0]
                hashed = hash_file(path, hashed if grown else None)
                self._known[path] = stamp, hashed
            return hashed.listed

    def segment(self, session: str, name: str, first: int) -> bytes:
        """The bytes from `first` on, one segment at most; raises ShelfError, OSError."""
        return self._bytes(session, name, first, 0, SEGMENT)

    def part(self, session: str, name: str, first: int, offset: int) -> bytes:
        """Of the segment at `first` the bytes from `offset` on, one part at most; raises
        ShelfError, OSError.
        """
        return self._bytes(session, name, first, offset, PART)

    def _bytes(self, session: str, name: str, first: int, offset: int, size: int) -> bytes:
        if not FILE.fullmatch(name) or first % SEGMENT or offset % PART or offset >= SEGMENT:
            raise ShelfError(f"no segment {name[:60]!r} {first}, or no part {offset} of it")
        path = next((each for each in self._files(session) if each.name == name), None)
        if path is None:
            raise ShelfError(f"no file {name!r} in {session[:60]!r}")
        with path.open("rb") as stream:
            stream.seek(first + offset)
            return stream.read(size)

    def _files(self, session: str) -> list[Path]:
        folder = self._root / session
        if not SESSION.fullmatch(session) or not folder.is_dir():
            return []
        return sorted(
            path
            for path in folder.iterdir()
            if FILE.fullmatch(path.name) and path.is_file() and not path.is_symlink()
        )[:MOST_FILES]


class Hashed(NamedTuple):
    """A file's hashes, and where the next look at it begins."""

    listed: Listed
    full: "hashlib._Hash"  # over the full segments


def list_file(path: Path) -> Listed:
    """Hash a file and its segments; raises OSError."""
    return hash_file(path, None).listed


def hash_file(path: Path, before: Hashed | None) -> Hashed:
    """The same; of a file that has only grown since `before` what is new. Raises OSError."""
    count = before.listed.size // SEGMENT if before else 0
    segments = before.listed.segments[:count] if before else []
    full = before.full.copy() if before else hashlib.sha256()
    size = count * SEGMENT
    whole = full
    with path.open("rb") as stream:
        stream.seek(size)
        while piece := stream.read(SEGMENT):
            segments.append(hashlib.sha256(piece).hexdigest())
            size += len(piece)
            whole = full.copy()
            whole.update(piece)
            if len(piece) == SEGMENT:
                full = whole
    return Hashed(Listed(size=size, sha256=whole.hexdigest(), segments=segments), full)


def _stamp(path: Path) -> tuple[int, int, int]:
    status = path.stat()
    return status.st_size, status.st_mtime_ns, status.st_ino
