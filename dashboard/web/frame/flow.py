"""What the browsers of a sign-in really get of the scene: counted where it is sent to them, so that
what a slow one leaves out is not in it.
"""

import time
from collections import deque

SPAN_S = 10.0  # over which a rate is taken
MOST = 1000  # frames remembered


class Flow:
    """One scene."""

    def __init__(self) -> None:
        self._frames: deque[tuple[float, int]] = deque(maxlen=MOST)

    def add(self, size: int) -> None:
        """A frame of so many bytes was taken."""
        self._frames.append((time.monotonic(), size))

    def rates(self) -> tuple[float, float]:
        """Frames and bytes per second of the last SPAN_S."""
        now, frames = time.monotonic(), list(self._frames)
        recent = [(at, size) for at, size in frames if now - at <= SPAN_S]
        if len(recent) < 2:
            return 0.0, 0.0
        span = max(now - recent[0][0], 1.0)
        return len(recent) / span, sum(size for _, size in recent) / span
