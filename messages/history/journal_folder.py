"""A journal's folder: its lock, its segments' names and ends."""

import errno
import fcntl
import logging
import os
from pathlib import Path

log = logging.getLogger(__name__)

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
