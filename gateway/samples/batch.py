"""One frame, one message; very fast boards that send single samples are joined to messages of at
most 10 ms.
"""

from dataclasses import dataclass, field

from gateway.time.clock import unwrap

JOIN_BELOW_NS = 5_000_000  # frames shorter than this (above 200 Hz with n = 1) are joined
FARTHEST = 1 << 30  # samples; a longer gap is none
JOIN_UP_TO_NS = 10_000_000


@dataclass
class Batch:
    """Consecutive samples on their way to the bus; rows are flat lists of one sample each or
    already joined.
    """

    first_index: int
    device_us: int
    period_ns: int
    n: int
    lost: int
    frame_sequence: int
    received_ns: int
    flags: int
    stale_mask: int = 0
    columns: tuple[list, ...] = field(default_factory=tuple)  # equal in kind from batch to batch
    kind: tuple = ()  # what else must be the same for two batches to be joined

    def follows(self, next_one: "Batch") -> bool:
        """True when the next one continues this without gap or change."""
        return (
            not next_one.lost
            and next_one.first_index == self.first_index + self.n
            and next_one.period_ns == self.period_ns
            and next_one.flags == self.flags
            and next_one.kind == self.kind
        )

    def extend(self, next_one: "Batch") -> None:
        """Append the samples of the next one."""
        self.n += next_one.n
        self.stale_mask |= next_one.stale_mask
        self.frame_sequence, self.received_ns = next_one.frame_sequence, next_one.received_ns
        for mine, theirs in zip(self.columns, next_one.columns, strict=True):
            mine.extend(theirs)


class Joiner:
    """Holds back what is too small to travel alone."""

    def __init__(self) -> None:
        self._open: Batch | None = None

    def add(self, batch: Batch) -> list[Batch]:
        """Batches that are ready now, in order."""
        ready: list[Batch] = []
        if self._open is not None:
            if self._open.follows(batch):
                self._open.extend(batch)
                return self.flush() if self._open.n * batch.period_ns >= JOIN_UP_TO_NS else []
            ready = self.flush()
        self._open = batch
        if batch.n * batch.period_ns < JOIN_BELOW_NS:
            return ready
        return ready + self.flush()

    @property
    def waiting(self) -> bool:
        """True while samples are held back."""
        return self._open is not None

    def flush(self) -> list[Batch]:
        """What is held back."""
        held, self._open = self._open, None
        return [held] if held else []


class Index:
    """Sample index since boot, unwrapped from 32 bits, and the samples missing before each
    batch.
    """

    def __init__(self) -> None:
        self._next: int | None = None

    def take(self, first_index: int, n: int) -> tuple[int, int]:
        """(unwrapped first index, samples lost directly before it)."""
        first = first_index if self._next is None else unwrap(self._next, first_index)
        lost = 0 if self._next is None else max(0, first - self._next)
        if first < 0 or lost >= FARTHEST:  # no gap: the board counts anew
            first, lost = first_index, 0
        self._next = first + n
        return first, lost
