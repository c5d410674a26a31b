"""Ports that stay open while the gateway is not there.

A gateway that is killed takes its descriptors with it: the port closes, and what the board says
until the next one has opened it is lost. So each open port is also given to somebody who does
nothing but hold it (gyrofree/running/guardian.py). The kernel goes on collecting its bytes, and the
next gateway takes the port over as it is and reads them.
"""

import os
import select
import threading
import time
from typing import NamedTuple

READ_BYTES = 65536


class Left(NamedTuple):
    """An open port of an earlier life, and what was read of it since: bytes and monotonic time,
    ns.
    """

    fd: int
    read: list[tuple[bytes, int]]


class Catcher:
    """Reads a port into memory from now on: a pseudo-terminal holds 16 KiB, and opening a journal
    takes its time.
    """

    def __init__(self, fd: int) -> None:
        self._fd, self._read = fd, []
        self._wake_out, self._wake_in = os.pipe()
        self._thread = threading.Thread(target=self._run, name="catcher", daemon=True)
        self._thread.start()

    def stop(self) -> Left:
        """Read no more; what there is goes to whoever reads on."""
        os.write(self._wake_in, b"x")
        self._thread.join()
        os.close(self._wake_in)
        os.close(self._wake_out)
        return Left(self._fd, self._read)

    def _run(self) -> None:
        poller = select.poll()
        poller.register(self._fd, select.POLLIN)
        poller.register(self._wake_out, select.POLLIN)
        try:
            while all(fd != self._wake_out for fd, _ in poller.poll()):
                data = os.read(self._fd, READ_BYTES)
                if not data:
                    return
                self._read.append((data, time.monotonic_ns()))
        except OSError:
            return  # whoever reads on finds it lost, and says so


class Keeper:
    """Keeps nothing: for a gateway that nobody guards."""

    def keep(self, url: str, fd: int) -> None:
        """Hold an open port for whoever comes after us."""

    def drop(self, url: str) -> None:
        """Let a port go that was lost or closed, so that it can be opened anew."""

    def take(self, url: str) -> Left | None:
        """A port that an earlier life left open, once; None when there is none."""
        return None

    def holds(self, url: str) -> bool:
        """True while `take` has something to give."""
        return False
