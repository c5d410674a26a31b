"""A journal's folder: its lock, its segments' names and ends."""

import errno
import fcntl
import logging
import os
import struct
import time
from collections.abc import Iterator
from pathlib import Path

from messages.clock import elapsed_s
from messages.history.journal_file import SEGMENT_HEAD, SEGMENT_MAGIC

log = logging.getLogger(__name__)

SLOW_S = 1.5  # for fdatasync; a busy disk takes half a second
RUN = "run"  # file that keeps the greatest run of a folder
FAR_NS = 100 * 365 * 86400 * 10**9  # a run further ahead of any clock is damage
LOOK_BYTES = 1 << 18  # of a segment's end, to find its last record
REMEDIES = {
    errno.ENOSPC: "free some space",
    errno.EAGAIN: "stop the other one, or set another `journal` folder",
}


def remedy_of(error: OSError) -> str:
    """What a person can do about a journal that cannot be written."""
    return REMEDIES.get(error.errno or 0, "make the folder writable for this user")


class JournalBusy(OSError):
    """Another gateway writes this journal; str() is one line with the remedy."""

    def __str__(self) -> str:
        return f"journal {self.filename}: {self.strerror}; {REMEDIES[errno.EAGAIN]}"


def lock_folder(folder: Path) -> int:
    """Descriptor of the folder's locked lock file; raises JournalBusy when another has it, OSError
    without access.
    """
    lock = os.open(folder / "lock", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o640)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(lock)
        raise JournalBusy(errno.EAGAIN, "another gateway writes it", str(folder)) from None
    except (
        OSError
    ) as error:  # a file system without locks, as some network ones: better a journal than none
        log.warning(
            "journal %s: cannot be locked (%s): let only one gateway write it",
            folder,
            error.strerror,
        )
    return lock


def slow(what: Path, seconds: float) -> str:
    """What to say of a disk that took so long to keep what was written; "" where that is usual."""
    if seconds < SLOW_S:
        return ""
    return f"{what}: the disk is slow, it took {seconds:.1f} s: a power cut may cost as much"


def end_of(name: Path, n: int = LOOK_BYTES) -> bytes:
    """The last n bytes of a file; nothing when it has gone."""
    try:
        with name.open("rb") as stream:
            stream.seek(max(0, os.fstat(stream.fileno()).st_size - n))
            return stream.read()
    except FileNotFoundError:
        return b""


def first_of(name: Path) -> int:
    """Sequence of the first record of a segment file."""
    return int(name.stem)


def newest_run(folder: Path) -> int:
    """The greatest run that has written here, 0 without any: by the file that keeps it, and by the
    heads of the newest segments.
    """
    found = [0]
    try:
        found.append(int((folder / RUN).read_text()))
    except (OSError, ValueError):
        pass
    for name in sorted(folder.glob("*.gfj"))[-2:]:
        try:
            with name.open("rb") as stream:
                magic, run, _ = SEGMENT_HEAD.unpack(stream.read(SEGMENT_HEAD.size))
        except (OSError, struct.error):
            continue
        found.append(run if magic == SEGMENT_MAGIC else 0)
    return min(max(found), time.time_ns() + FAR_NS)


def keep_run(folder: Path, run: int) -> None:
    """Remember it over a restart, where the disk takes it."""
    new = folder / f"{RUN}.new"
    try:
        new.write_text(f"{run}\n")
        os.replace(new, folder / RUN)
    except OSError:
        pass  # the journal says what the disk refuses; the segments' heads have it too


class Ages:
    """How long ago segments were written, by what has elapsed; the wall clock, which may be set
    under us, is asked once and for those of an earlier process only.
    """

    def __init__(self) -> None:
        self._begun = time.time(), elapsed_s()
        self._known: dict[str, tuple[float, float]] = {}  # age when first seen, and when that was

    def of(self, name: Path, state: os.stat_result) -> float:
        """At least so many s ago."""
        if name.name not in self._known:
            wall_s, at_s = self._begun
            older_s = wall_s - state.st_mtime
            # later than our start, or as if: this process's own, finished just now
            self._known[name.name] = (older_s, at_s) if older_s > 0.0 else (0.0, elapsed_s())
        age_s, at_s = self._known[name.name]
        return age_s + elapsed_s() - at_s


def superfluous(names: list[Path], max_bytes: int, max_age_s: float, ages: Ages) -> Iterator[Path]:
    """Segments, oldest first, that are to go so that the others keep within max_bytes, and those
    older than max_age_s (0: of any age); never the newest.
    """
    states = [name.stat() for name in names]
    total = sum(state.st_size for state in states)
    for name, state in zip(names[:-1], states, strict=False):
        old = max_age_s and ages.of(name, state) > max_age_s
        if total <= max_bytes and not old:
            return
        yield name
        total -= state.st_size
