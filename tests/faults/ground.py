"""What every bench of faults has: a log, patience, and who of its services is there."""

import re
import time
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

import psutil

from faults.disk import Disk

PATIENCE_S = 180.0  # a busy machine; nothing is judged by it
LOOK_S = 0.05
# what the estimator says when it publishes fewer estimates than there are samples, and when all
THINNED, AS_SET = "too slow for all", "estimates are published as set"


class NotWell(AssertionError):
    """It did not become as it was wanted, with the end of the log."""


class Hearing(Protocol):
    """What of a watch (watch.py) judges ask for."""

    alarms: set[str]
    active: set[str]
    recording: list[str]
    durable: dict[str, int]

    def begin(self) -> None: ...
    def record(self, name: str) -> None: ...
    def stop(self) -> None: ...


class Ground:
    """A bench's log, of one file or several, in the order in which it was read."""

    watch: Hearing
    sessions: Disk  # where the recordings lie that are counted

    def __init__(self, *logs: Path) -> None:
        self._read = dict.fromkeys(logs, 0)
        self._text = ""

    def text(self) -> str:
        """The log of all services so far, whole lines."""
        for path, start in self._read.items():
            if not path.exists():
                continue
            with path.open("rb") as stream:
                stream.seek(start)
                lines, newline, _ = stream.read().rpartition(b"\n")
            self._read[path] = start + len(lines + newline)
            self._text += (lines + newline).decode(errors="replace")
        return self._text

    def until(self, condition: Callable[[], object], what: str) -> float:
        """Wait for it; how long it took, s. Raises NotWell."""
        began = time.monotonic()
        while not condition():
            if time.monotonic() - began > PATIENCE_S:
                raise NotWell(f"no {what} within {PATIENCE_S:g} s:\n{self.text()[-4000:]}")
            time.sleep(LOOK_S)
        return time.monotonic() - began

    def hear(self, *alarms: str) -> None:
        """Wait until these were there: for a fault that lasts until it is said. Raises NotWell."""
        self.until(lambda: self.watch.alarms >= set(alarms), f"alarms {', '.join(alarms)}")

    def said(self, pattern: str, since: int) -> bool:
        """Does the log have such a line behind the character `since`?"""
        return re.search(pattern, self.text()[since:]) is not None

    def thinned(self, since: int) -> bool:
        """Has the estimator said, for the time behind the character `since`, that its machine was
        too slow for all estimates?
        """
        before = self.text()[:since]
        slow = before.rfind(THINNED) > before.rfind(AS_SET)
        return slow or self.said(THINNED, since)

    def well(self, since_ns: int = 0) -> bool:
        """Is everything there? since_ns: monotonic; nothing older counts."""
        raise NotImplementedError

    def settle(self) -> None:
        """Wait for what takes longer than the recording, before it is counted. Raises NotWell."""


def services_below(pid: int) -> dict[str, list[psutil.Process]]:
    """By service the processes that a `gyrofree up` has, the oldest first."""
    found: dict[str, list[psutil.Process]] = {}
    for process in sorted(psutil.Process(pid).children(recursive=True), key=lambda p: p.pid):
        try:
            words = process.cmdline()
        except psutil.Error:
            continue  # it has just ended
        if "gyrofree" in words:
            found.setdefault(words[words.index("gyrofree") + 1], []).append(process)
    return found
