"""What was read and waits to be decoded: bounded, so that a line faster than any board's costs
neither memory nor the other boards.

A reader whose backlog is full, or that was faster than its pace, reads later. The port holds its
sender back meanwhile, or drops what it cannot hold, which the decoder counts as damage.
"""

import queue
import threading
import time
from collections import Counter
from typing import Generic, Protocol, TypeVar

MOST_BYTES = 2 << 20  # waiting, of one channel
LINE_BYTES_S = 2e6  # the fastest serial line brings a fifth of it
BURST_BYTES = 4 << 20  # at once, above the pace


class Read(Protocol):
    """One read of one port."""

    @property
    def channel(self) -> int: ...
    @property
    def data(self) -> bytes: ...


R = TypeVar("R", bound=Read)


class Backlog(Generic[R]):
    """Reads in their order, from several threads to one; None wakes that one."""

    def __init__(self, most_bytes: int = MOST_BYTES) -> None:
        self._queue: queue.SimpleQueue[R | None] = queue.SimpleQueue()
        self._most, self._bytes = most_bytes, Counter[int]()
        self._lock = threading.Lock()

    def put(self, read: R | None) -> None:
        """Add one; never blocks and never refuses: whoever reads asks `full` before."""
        if read is not None:
            with self._lock:
                self._bytes[read.channel] += len(read.data)
        self._queue.put(read)

    def get(self, timeout: float | None = None) -> R | None:
        """The next one; raises queue.Empty after `timeout` s."""
        read = self._queue.get(timeout=timeout)
        if read is not None:
            with self._lock:
                self._bytes[read.channel] -= len(read.data)
        return read

    def full(self, channel: int) -> bool:
        """Whether this channel has to wait; another of the same device need not."""
        return self._bytes[channel] >= self._most

    def waiting(self, channel: int) -> int:
        """Bytes of this channel that wait."""
        return self._bytes[channel]

    def qsize(self) -> int:
        """Reads that wait."""
        return self._queue.qsize()


class Pace:
    """How fast a port may be read in the long run."""

    def __init__(self, rate: float = LINE_BYTES_S, burst: int = BURST_BYTES) -> None:
        self._rate, self._burst = rate, burst
        self._left, self._at = float(burst), time.monotonic()

    def wait_s(self, size: int) -> float:
        """s to wait after reading so many bytes; 0 for every line of a board."""
        now = time.monotonic()
        self._left = min(self._burst, self._left + (now - self._at) * self._rate) - size
        self._at = now
        return max(0.0, -self._left / self._rate)
