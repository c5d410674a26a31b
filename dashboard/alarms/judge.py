"""Is a number beyond its limit? With dead band and delays, sample by sample, by the data's clock.

Pure: no clock, no bus. A value that is not known is neither inside nor beyond. What was beyond
stays so through the dead band, and through a time in which nothing is known.
"""

import math
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Answer(Enum):
    """What is to be said of a number."""

    OK = "ok"
    BEYOND = "beyond"
    UNKNOWN = "unknown"


@dataclass(frozen=True)
class Bounds:
    """Where the limits are. above and below: one at least; a value at a limit is inside."""

    above: float | None = None
    below: float | None = None
    dead_band: float = 0.0
    on_delay_s: float = 0.0
    off_delay_s: float = 0.0
    gap_s: float = 1.0  # s between two samples; beyond it nothing was known in between

    def beyond(self, y: Array) -> NDArray[np.bool_]:
        """Which of y (n,) are outside."""
        out = np.zeros(np.shape(y), dtype=bool)
        if self.above is not None:
            out |= y > self.above
        if self.below is not None:
            out |= y < self.below
        return out

    def clear(self, y: Array) -> NDArray[np.bool_]:
        """Which of y (n,) are inside of the dead band too."""
        inside = np.isfinite(y)
        if self.above is not None:
            inside &= y <= self.above - self.dead_band
        if self.below is not None:
            inside &= y >= self.below + self.dead_band
        return inside

    def crossed(self, y: float) -> float:
        """The limit that y is beyond, or next to."""
        if self.below is not None and (self.above is None or y < self.below):
            return self.below
        return math.nan if self.above is None else self.above


@dataclass(frozen=True)
class Turn:
    """The answer has changed: when, s of the data's clock, to what, and the value it was by."""

    t: float
    answer: Answer
    value: float


class Judge:
    """The answer on one number."""

    def __init__(self, bounds: Bounds, active: bool = False) -> None:
        """active: it was beyond when it was last known."""
        self._bounds = bounds
        self.active, self.known = active, False
        self.value = math.nan  # the newest
        self._t = -math.inf
        self._since: float | None = None  # when what would change the answer began

    @property
    def answer(self) -> Answer:
        """Of the newest sample."""
        if not self.known:
            return Answer.UNKNOWN
        return Answer.BEYOND if self.active else Answer.OK

    def take(self, t: Array, y: Array) -> list[Turn]:
        """Samples t (n,) s ascending, y (n,), NaN where nothing is known; those that are not after
        the newest one are passed over. Every change of the answer in them, in order.
        """
        new = t > self._t
        t, y = t[new], y[new]
        if not len(t):
            return []
        if self._is_quiet(t, y):
            self._t, self.value = float(t[-1]), float(y[-1])
            return []
        found = []
        out, clear = self._bounds.beyond(y), self._bounds.clear(y)
        for k in range(len(t)):
            turn = self._step(float(t[k]), float(y[k]), bool(out[k]), bool(clear[k]))
            found += [turn] if turn is not None else []
        return found

    def forget(self) -> list[Turn]:
        """Nothing is known now: no samples come, or their clock began anew."""
        self._t, self._since = -math.inf, None
        self.value = math.nan
        if not self.known:
            return []
        self.known = False
        return [Turn(math.nan, Answer.UNKNOWN, math.nan)]

    def _is_quiet(self, t: Array, y: Array) -> bool:
        """Whether these samples change nothing and no time is being counted; most do."""
        if not self.known or self._since is not None or not np.isfinite(y).all():
            return False
        test = self._bounds.clear(y) if self.active else self._bounds.beyond(y)
        return not test.any()

    def _step(self, t: float, y: float, out: bool, clear: bool) -> Turn | None:
        if t - self._t > self._bounds.gap_s:
            self._since = None
        self._t, self.value = t, y
        if not math.isfinite(y):
            self._since, known = None, self.known
            self.known = False
            return Turn(t, Answer.UNKNOWN, y) if known else None
        before = self.answer
        self.known = True
        if not (clear if self.active else out):
            self._since = None
        else:
            self._since = t if self._since is None else self._since
            delay = self._bounds.off_delay_s if self.active else self._bounds.on_delay_s
            if t - self._since >= delay:
                self.active, self._since = not self.active, None
        return Turn(t, self.answer, y) if self.answer is not before else None
