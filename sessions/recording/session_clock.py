"""The clock of a recording's receive times, and the wall clock's steps in its session.json."""

import logging
import time

from messages.clock import Clock
from sessions.recording.manifest import ClockStep, Manifest

log = logging.getLogger(__name__)

LOOK_S = 1.0  # between two looks at the wall clock


class SessionClock:
    """Elapsed time as UTC; the wall clock is asked when a session begins, and then watched."""

    def __init__(self) -> None:
        self._clock = Clock()
        self._look_at = 0.0

    def now_ns(self) -> int:
        """Now, ns since 1970."""
        return self._clock.now_ns()

    def begin(self) -> None:
        """A session begins: by what the wall clock says now."""
        self._clock = Clock()

    def look(self, manifest: Manifest | None) -> None:
        """Call often: a step of the wall clock is said, and written down where a session runs."""
        if time.monotonic() < self._look_at:
            return
        self._look_at = time.monotonic() + LOOK_S
        step = self._clock.look()
        if step is None:
            return
        log.warning("%s; the recording goes on by what has elapsed", step)
        if manifest is not None:
            manifest.clock_steps.append(ClockStep(at_utc_ns=step.at_ns, step_s=step.step_ns * 1e-9))
