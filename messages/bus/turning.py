"""Does the main work of a process go on? Each of its loops marks its turns, and a beat
(beating.py) says how long ago the last turn was.

The thread that beats lives on where the one that works stands: in a call to a disk that does not
answer, on a lock, under a debugger. Time is counted by the beats, at most one pause from each to
the next: a process that was stopped, or got no processor, blames none of its loops for it.
"""

import contextlib
import threading
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, Self

MOST_S = 3.0  # a turn that takes longer stands
COMM = 15  # characters of a thread's name in the kernel

_lock = threading.Lock()
_loops: dict[str, "Loop"] = {}


@dataclass(frozen=True)
class Standing:
    """The loop of a process that has not turned for longest, measured by what it may take."""

    loop: str = ""  # empty: no loop is known
    ago_s: float = 0.0  # since its last turn
    most_s: float = 0.0  # that this turn may take
    doing: str = ""  # what it began to do, where it said so


class Loop:
    """Marks the turns of one loop. A context manager: one that ends by a fault goes on standing."""

    def __init__(self, name: str, most_s: float = MOST_S) -> None:
        """name: for people; another loop of that name is replaced. most_s: that a turn may take."""
        self.name, self.turns = name, 0
        self._usual_s = self.most_s = most_s
        self.doing = ""

    def __enter__(self) -> Self:
        with _lock:
            _loops[self.name] = self
        _name_thread(self.name)
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is not None and issubclass(kind, Exception):
            self.doing = f"ended by {kind.__name__}"
            return
        with _lock:
            if _loops.get(self.name) is self:
                del _loops[self.name]

    def turn(self) -> None:
        """It goes on. Cheap: may be called for every message."""
        self.turns += 1

    @contextlib.contextmanager
    def during(self, doing: str, most_s: float) -> Iterator[None]:
        """What takes longer than a turn, for a reason: so long it may."""
        self.turns += 1
        self.doing, self.most_s = doing, most_s
        try:
            yield
        finally:
            self.doing, self.most_s = "", self._usual_s
            self.turns += 1


class Turning(Protocol):
    """What is told of a loop."""

    name: str
    doing: str
    most_s: float

    @property
    def turns(self) -> int:
        """So far."""


class Observer:
    """What who beats knows of the loops of its process."""

    def __init__(self) -> None:
        # its turns, and for how long it stands, s
        self._seen: dict[Turning, tuple[int, float]] = {}

    def look(self, passed_s: float, loops: Iterable[Turning] | None = None) -> Standing:
        """Once for each beat; passed_s: since the one before. loops: all of this process, unless
        others are meant.
        """
        if loops is None:
            with _lock:
                loops = list(_loops.values())
        worst, seen = Standing(), {}
        for one in loops:
            turns, ago_s = self._seen.get(one, (-1, 0.0))
            ago_s = ago_s + passed_s if turns == one.turns else 0.0
            seen[one] = one.turns, ago_s
            if not worst.loop or ago_s / one.most_s > worst.ago_s / worst.most_s:
                worst = Standing(one.name, ago_s, one.most_s, one.doing)
        self._seen = seen
        return worst


def _name_thread(name: str) -> None:
    """As `top -H` and debuggers show it; the first thread's name is the process's and stays."""
    if threading.current_thread() is not threading.main_thread():
        with contextlib.suppress(OSError):
            path = Path(f"/proc/self/task/{threading.get_native_id()}/comm")
            path.write_text(name[:COMM])
