"""A file's segments, fetched in parts on all ways to home at once.

Over a bad link a lane carries 100 kbit/s and stands still for seconds now and then. So each asks
for little at a time and for the next before it has the last; a lane that failed comes back in, and
who finds nothing left to ask for asks once more for what another waits for too long.
"""

import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from sites.copying.roads import Ask, Ways
from sites.copying.shelf import PART
from sites.place import SiteError

AT_ONCE = 2  # questions on each way: one is answered while the other is under way
LATE_S = 1.0  # a part that is waited for this long, and twice as long as usual, is asked for again
BACK_S = 1.0  # after a fault, before the same way is tried again
LOOK_S = 0.1
MOST_KEPT = 64  # segments of which parts are here, after a link that broke


class Segment(NamedTuple):
    """One of a file."""

    first: int  # byte
    sha256: str
    size: int  # bytes


class Part(NamedTuple):
    """What one question asks for."""

    segment: Segment
    offset: int  # byte of the segment

    def question(self, name: str) -> str:
        """Below segment_key; name: `<session>/<file>`."""
        return f"{name}/{self.segment.first}-{self.segment.sha256}/{self.offset}"

    @property
    def size(self) -> int:
        return min(PART, self.segment.size - self.offset)


class Drafts:
    """Parts of segments that are not whole yet; by content, so they are good for any file."""

    def __init__(self) -> None:
        self._parts: dict[str, dict[int, bytes]] = {}

    def missing(self, segment: Segment) -> list[Part]:
        """What is to be asked for of it: nothing that is here."""
        here = self._parts.get(segment.sha256, {})
        return [Part(segment, at) for at in range(0, segment.size, PART) if at not in here]

    def add(self, part: Part, content: bytes) -> bytes | None:
        """Put a part to the others: the segment, when it was the last one."""
        parts = self._parts.setdefault(part.segment.sha256, {})
        parts[part.offset] = content
        if len(parts) < -(-part.segment.size // PART):
            return None
        del self._parts[part.segment.sha256]
        return b"".join(parts[at] for at in sorted(parts))

    def trim(self) -> None:
        """Forget the oldest where there are too many."""
        while len(self._parts) > MOST_KEPT:
            del self._parts[next(iter(self._parts))]


@dataclass
class Waiting:
    """A part that was asked for."""

    since: float  # s, monotonic
    asks: list[Ask] = field(default_factory=list)


class Gathering:
    """One file's segments; `run` once."""

    def __init__(
        self,
        name: str,
        wanted: Iterator[Segment],
        drafts: Drafts,
        keep: Callable[[Segment, bytes], bool],
    ) -> None:
        """name: `<session>/<file>`. keep: takes a segment, one at a time; False: it is not what it
        should be.
        """
        self._name, self._wanted, self._drafts, self._keep = name, wanted, drafts, keep
        self._changed = threading.Condition()
        self._left: deque[Part] = deque()
        self._waiting: dict[Part, Waiting] = {}
        self._took: deque[float] = deque([LATE_S], maxlen=32)  # s, of the last answers
        self._workers: dict[int, int] = {}  # by way
        self._again_at: dict[int, float] = {}  # likewise: after a fault, s, monotonic
        self._fault: Exception | None = None
        self._over = self._bad = False

    def run(self, ways: Ways, stop: Callable[[], bool]) -> bool:
        """Fetch all; False when a segment is not what it should be, or `stop` came first. Raises
        SiteError when the last way has failed, OSError of `keep`. It does not wait for answers
        that nobody needs any more.
        """
        with self._changed:
            try:
                while not self._done() and not stop():
                    self._send_out(ways())
                    if not self._workers:
                        raise self._fault or SiteError("there is no way to home")
                    self._changed.wait(LOOK_S)
                if isinstance(self._fault, OSError):
                    raise self._fault
                return not self._bad and not stop()
            finally:
                self._over = True
                self._drafts.trim()
                self._changed.notify_all()

    def _done(self) -> bool:
        return self._bad or self._over or (not self._more() and not self._waiting)

    def _more(self) -> bool:
        """Is there a part that nobody has asked for?"""
        while not self._left:
            segment = next(self._wanted, None)
            if segment is None:
                return False
            self._left.extend(self._drafts.missing(segment))
        return True

    def _send_out(self, ways: list[Ask]) -> None:
        now = time.monotonic()
        for ask in ways:
            way = id(ask)
            if way in self._workers or now < self._again_at.get(way, 0.0):
                continue
            self._workers[way] = AT_ONCE
            for _ in range(AT_ONCE):
                threading.Thread(
                    target=self._work, args=(ask,), name="copying", daemon=True
                ).start()

    def _work(self, ask: Ask) -> None:
        """On a thread of its own, until there is nothing left or the way has failed."""
        while (part := self._take(ask)) is not None:
            try:
                content = ask(part.question(self._name))
            except Exception as error:  # whatever it is, the part is not lost with this thread
                self._failed(ask, part, error)
                break
            self._came(part, content)
        with self._changed:
            self._workers[id(ask)] -= 1
            if not self._workers[id(ask)]:
                del self._workers[id(ask)]
            self._changed.notify_all()

    def _take(self, ask: Ask) -> Part | None:
        """What to ask for next; waits while others are asked and may still fail."""
        with self._changed:
            while not self._over:
                part = self._left.popleft() if self._more() else self._late(ask)
                if part is not None:
                    self._waiting.setdefault(part, Waiting(time.monotonic())).asks.append(ask)
                    return part
                if not self._waiting:
                    break
                self._changed.wait(LOOK_S)
            return None

    def _late(self, ask: Ask) -> Part | None:
        """What another way was asked for longest, if that is too long."""
        before = time.monotonic() - max(LATE_S, 2.0 * float(np.median(self._took)))
        late = [
            (waiting.since, part)
            for part, waiting in self._waiting.items()
            if waiting.since < before and len(waiting.asks) == 1 and waiting.asks[0] is not ask
        ]
        return min(late)[1] if late else None

    def _came(self, part: Part, content: bytes) -> None:
        with self._changed:
            waiting = self._waiting.pop(part, None)
            if waiting is None or self._over:
                return  # another way was quicker
            self._took.append(time.monotonic() - waiting.since)
            whole = content if len(content) == part.size else None
            if whole is None:
                self._bad = True
            elif (whole := self._drafts.add(part, content)) is not None:
                try:
                    self._bad |= not self._keep(part.segment, whole)
                except OSError as error:
                    self._fault, self._over = error, True
            self._changed.notify_all()

    def _failed(self, ask: Ask, part: Part, error: Exception) -> None:
        with self._changed:
            self._fault, self._again_at[id(ask)] = error, time.monotonic() + BACK_S
            waiting = self._waiting.get(part)
            if waiting is not None:
                waiting.asks.remove(ask)
                if not waiting.asks:
                    del self._waiting[part]
                    self._left.appendleft(part)
