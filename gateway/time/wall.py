"""UTC of one gateway run: the host's clock as it was at the start, and what has elapsed since.

The wall clock may be set under us. Time stamps go on as if it had not been, so that they stay in
order and their differences true; by how much the wall clock differs is said beside them.
"""

import logging

from messages.clock import Clock

log = logging.getLogger(__name__)


class WallClock:
    """UTC of monotonic times, without steps."""

    def __init__(self, name: str) -> None:
        """name: of the device, for the log."""
        self._name, self._clock = name, Clock()

    def utc_ns(self, monotonic_ns: int) -> int:
        """UTC of a monotonic time, ns."""
        return self._clock.at_ns(monotonic_ns)

    def now_ns(self) -> int:
        """UTC of now, ns."""
        return self._clock.now_ns()

    @property
    def offset_s(self) -> float:
        """By how much the wall clock was set since the start, s."""
        return self._clock.offset_ns * 1e-9

    @property
    def difference_s(self) -> float:
        """Likewise, with what is too little for a step."""
        return self._clock.difference_ns * 1e-9

    def follow(self) -> None:
        """Look at the wall clock; a step is said."""
        step = self._clock.look()
        if step is not None:
            log.warning(
                "%s: %s; time stamps go on without the step, LinkStatus.clock_offset_s says it",
                self._name,
                step,
            )
