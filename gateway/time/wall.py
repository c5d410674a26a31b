"""The host's UTC clock against its monotonic one: it may be slewed or stepped under us."""

import logging
import time

log = logging.getLogger(__name__)

STEP_NS = 500_000_000


class WallClock:
    """UTC of monotonic times, by the offset that was looked up last."""

    def __init__(self, name: str) -> None:
        """name: of the device, for the log."""
        self._name = name
        self.offset_ns = time.time_ns() - time.monotonic_ns()

    def utc_ns(self, monotonic_ns: int) -> int:
        """UTC of a monotonic time, ns."""
        return monotonic_ns + self.offset_ns

    def follow(self) -> None:
        """Look the offset up; a step of the clock is said."""
        offset = time.time_ns() - time.monotonic_ns()
        if abs(offset - self.offset_ns) > STEP_NS:
            log.warning(
                "%s: the host's clock was stepped by %.3f s; UTC times follow it",
                self._name,
                (offset - self.offset_ns) / 1e9,
            )
        self.offset_ns = offset
