"""How many frames a second the link carries, judged by how late they come; without a clock that is
set: only how much later than the quickest ones.
"""

from collections import deque
from dataclasses import dataclass, field

import numpy as np

from messages.previews.frames import RATES

FULL = 0  # the rate of everything, as it is published
BEGIN = 10  # Hz
LOOK_S = 3.0  # of arrivals that are judged
QUEUE_S = 0.7  # the usual frame comes so much later than the quickest: the link has a queue
DRAINS = 0.97  # ... and the later ones are not less late by this: the queue does not end
CALM_S = 0.25  # ... so little later: there is room
CLEAR_S = 0.05  # nine of ten come within that: a link that everything may be tried on
TRY_S = 6.0  # of calm, before more is tried
FULL_AFTER_S = 20.0  # likewise, before everything is
AGAIN_S, LONGEST_S = 30.0, 1800.0  # what was too much is tried again after so long, and longer
SETTLE_S = 4.0  # after a change, before the next one
HASTY_S = 1.5  # likewise, after one up that was too much
SILENT_S = 3.0  # without a frame: the link is cut, and says nothing about rates
BASE_S = 300.0  # so long the quickest frame is remembered


@dataclass
class Pace:
    """Chooses the rate; times are monotonic, s."""

    highest: int = RATES[0]  # Hz
    may_be_full: bool = True
    rate: int = BEGIN
    _came: deque[tuple[float, float]] = field(default_factory=deque)  # when, and how late it came
    _quickest: deque[tuple[float, float]] = field(default_factory=deque)  # of 10 s: begin, least
    _since: float = 0.0  # of the rate
    _rose: bool = False  # to it
    _refused: dict[int, tuple[float, float]] = field(default_factory=dict)  # rate: until, how long

    def __post_init__(self) -> None:
        self.rate = max((rate for rate in RATES if rate <= min(BEGIN, self.highest)), default=1)

    def came(self, now: float, transit_s: float) -> None:
        """A message came, so long after it was published, by whatever clocks."""
        self._came.append((now, transit_s))
        if not self._quickest or now - self._quickest[-1][0] > 10.0:
            self._quickest.append((now, transit_s))
        elif transit_s < self._quickest[-1][1]:
            self._quickest[-1] = (self._quickest[-1][0], transit_s)
        while self._quickest and now - self._quickest[0][0] > BASE_S:
            self._quickest.popleft()
        while self._came and now - self._came[0][0] > LOOK_S:
            self._came.popleft()

    @property
    def late_s(self) -> float:
        """How much later than the quickest the usual message comes, s; NaN where none came."""
        return float(np.median(self._lates())) if self._came else float("nan")

    def choose(self, now: float) -> int:
        """The rate from now on, Hz; FULL: everything."""
        if not self._came or now - self._came[-1][0] > SILENT_S:
            self._since = now  # what comes first after a cut was long under way
            return self.rate
        if now - self._since < (HASTY_S if self._rose else SETTLE_S):
            return self.rate
        lates = self._lates()
        half = len(lates) // 2
        drains = half > 0 and np.mean(lates[half:]) < DRAINS * np.mean(lates[:half])
        if np.median(lates) > QUEUE_S and not drains:
            self._refuse(now)
        elif np.median(lates) < CALM_S and now - self._since > TRY_S:
            self._more(now, float(np.quantile(lates, 0.9)))
        return self.rate

    def _lates(self) -> np.ndarray:
        least = min(value for _, value in self._quickest)
        return np.array([value for _, value in self._came]) - least

    def _refuse(self, now: float) -> None:
        _, before = self._refused.get(self.rate, (0.0, AGAIN_S / 2))
        self._refused[self.rate] = (now + min(2 * before, LONGEST_S), min(2 * before, LONGEST_S))
        if self.rate == FULL:
            self._change(now, RATES[0])
        elif self.rate != RATES[-1]:  # at once to what comes through, at least one down
            span_s = max(self._came[-1][0] - self._came[0][0], 1.0)
            through = [rate for rate in RATES if rate <= (len(self._came) - 1) / span_s]
            self._change(now, min(self._next(1), max(through, default=RATES[-1])))

    def _more(self, now: float, late_s: float) -> None:
        if self.rate == FULL:
            return
        wanted = FULL if self.rate == min(self.highest, RATES[0]) else self._next(-1)
        if wanted == FULL and not (
            self.may_be_full and late_s < CLEAR_S and now - self._since > FULL_AFTER_S
        ):
            return
        if now >= self._refused.get(wanted, (0.0, 0.0))[0]:
            self._change(now, wanted)

    def _next(self, step: int) -> int:
        return RATES[RATES.index(self.rate) + step]

    def _change(self, now: float, rate: int) -> None:
        # 0 is everything: more than any rate of a preview
        self._rose = rate == FULL or (self.rate != FULL and rate > self.rate)
        self.rate, self._since = rate, now
        self._came.clear()
