"""How often one browser is brought up to date: as often as can be, or sparingly for a slow link."""

import time

QUALITIES = {  # least s between two poses, two updates of charts and tables
    "full": (0.0, 0.0),
    "economy": (0.25, 2.0),
}


class Pace:
    """Of one browser; asked by the two loops of the service."""

    def __init__(self) -> None:
        self.quality = "full"
        self._last = [float("-inf"), float("-inf")]

    def choose(self, quality: str) -> None:
        """What is no quality changes nothing."""
        self.quality = quality if quality in QUALITIES else self.quality

    def due(self, panels: bool, now_s: float | None = None) -> bool:
        """Is it this browser's turn? now_s: time.monotonic()."""
        now_s = time.monotonic() if now_s is None else now_s
        if now_s - self._last[panels] < QUALITIES[self.quality][panels]:
            return False
        self._last[panels] = now_s
        return True
