"""Time in one process: what has elapsed, and what the wall clock says beside it.

The wall clock is no axis of time: people, NTP and a flat battery set it, forward and back. Elapsed
time comes from CLOCK_BOOTTIME, which nobody sets and which counts a suspended machine too. A
`Clock` is read off the wall once, when it is made, and from there on counts what has elapsed; what
the wall clock says later is an attribute (`offset_ns`), and each step of it an event (`look`).
`Moment` is a time that means something to a later process: within one boot the age of a moment
takes nothing from the wall clock.
"""

import time
from pathlib import Path
from typing import Any, NamedTuple

STEP_NS = 500_000_000  # the wall clock differs by more than this from what it should say: a step
BOOT_ID = Path("/proc/sys/kernel/random/boot_id")


def elapsed_ns() -> int:
    """Since the machine's start, a suspension counted, ns."""
    return time.clock_gettime_ns(time.CLOCK_BOOTTIME)


def elapsed_s() -> float:
    """Since the machine's start, a suspension counted, s."""
    return elapsed_ns() * 1e-9


class Step(NamedTuple):
    """The wall clock was set."""

    at_ns: int  # when it was noticed, by the Clock that noticed it
    step_ns: int  # by how much it went forward

    def __str__(self) -> str:
        way = "forward" if self.step_ns > 0 else "back"
        return f"the wall clock was set {way} by {abs(self.step_ns) * 1e-9:,.3f} s"


class Clock:
    """UTC as it was when this was made, and what has elapsed since: never goes back, has no steps.

    `offset_ns`: what the wall clock said beyond it at the last step; 0 while it was not set.
    `difference_ns`: at the last `look`, with what is too little for a step.
    """

    def __init__(self) -> None:
        self._begin_ns = time.time_ns() - elapsed_ns()
        self._asleep_ns = elapsed_ns() - time.monotonic_ns()
        self.offset_ns = self.difference_ns = 0

    def now_ns(self) -> int:
        """Now, ns since 1970."""
        return self._begin_ns + elapsed_ns()

    def at_ns(self, monotonic_ns: int) -> int:
        """The time of a reading of CLOCK_MONOTONIC, ns since 1970."""
        return self._begin_ns + self._asleep_ns + monotonic_ns

    def look(self) -> Step | None:
        """Compare with the wall clock, about once a second; the step it made since last time."""
        now = elapsed_ns()
        self._asleep_ns = now - time.monotonic_ns()
        self.difference_ns = time.time_ns() - self._begin_ns - now
        step = self.difference_ns - self.offset_ns
        if abs(step) < STEP_NS:
            return None
        self.offset_ns += step
        return Step(self._begin_ns + now, step)


class Moment(NamedTuple):
    """A time to be written down, for the age of a thing in another process."""

    boot: str  # which start of the machine; empty where it does not say
    elapsed_ns: int
    wall_ns: int

    @classmethod
    def now(cls) -> "Moment":
        """This very moment."""
        return cls(boot_id(), elapsed_ns(), time.time_ns())

    @classmethod
    def of(cls, written: Any) -> "Moment | None":
        """One that was written down as a list; None for anything else."""
        try:
            boot, elapsed, wall = written
            return cls(str(boot), int(elapsed), int(wall))
        except (TypeError, ValueError):
            return None

    @property
    def age_s(self) -> float:
        """s since then, never negative: by elapsed time within one boot, else by the wall clock."""
        if self.boot and self.boot == boot_id():
            return max(0, elapsed_ns() - self.elapsed_ns) * 1e-9
        return max(0, time.time_ns() - self.wall_ns) * 1e-9


def boot_id() -> str:
    """Name of this start of the machine; empty where the system has none."""
    try:
        return BOOT_ID.read_text().strip()
    except OSError:
        return ""
