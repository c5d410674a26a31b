"""One after the other: several processes read a file of a folder, change it and write it as a
whole; two at once would lose what one of them wrote.
"""

import errno
import fcntl
import os
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

PATIENCE_S = 30.0
LOOK_S = 0.02
_held = threading.local()


@contextmanager
def alone(folder: Path) -> Iterator[None]:
    """Nobody else is within this at the same folder, in no thread and no process; who is may enter
    again. It goes with its process, however that ends. Raises TimeoutError when another does not
    leave, other OSErrors for a folder that is not there.
    """
    mine: set[Path] = _held.__dict__.setdefault("folders", set())
    place = folder.resolve()
    if place in mine:
        yield
        return
    fd = os.open(place, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        _take(fd, folder)
        mine.add(place)
        try:
            yield
        finally:
            mine.discard(place)
    finally:
        os.close(fd)


def _take(fd: int, folder: Path) -> None:
    end = time.monotonic() + PATIENCE_S
    while True:
        try:
            fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return
        except BlockingIOError:
            if time.monotonic() > end:
                why = f"{folder}: another process changes it, and does not end: is one stopped?"
                raise TimeoutError(errno.ETIMEDOUT, why) from None
        time.sleep(LOOK_S)
