"""The receiver's time on the board's clock.

A receiver reports a fix 30 to 200 ms late, and never by the same amount. The device time of a fix
is found as the host finds the board's: by the lower envelope of arrival against time of fix. What
remains is the shortest delay, which cannot be seen from here.

The receiver's own time steps, too: UTC by a leap second when it learns of one, by days when it has
its first fix, by 1024 weeks. Where the receiver gives the time of the GPS week (UBX), which knows
no leap seconds, that is used; a step of either is seen because arrivals do not step with it. A fix
behind a step has no device time until STEP_AFTER_S have shown that it is a step and no late read.
"""

import logging
import math

from gateway.gnss.fix import Fix
from gateway.time.clock import DeviceClock

log = logging.getLogger(__name__)

WEEK_NS = 7 * 86400 * 10**9
MOST_DELAY_S = 0.5  # by which arrivals may be late without being a step
DRIFT = 1e-3  # of the board's clock, at most, while nothing was heard
STEP_SPREAD_S = 0.25  # by which fixes behind a step may differ
STEP_AFTER_S = 1.0  # of board's time, and at least STEP_FIXES
STEP_FIXES = 3


class ReceiverClock:
    """Learns from every fix; tells each its time on the board's clock."""

    def __init__(self) -> None:
        self.steps = 0
        self.last_step_s = math.nan
        self.restart()

    def restart(self) -> None:
        """The board's clock begins again."""
        self._clock = DeviceClock()
        self._weeks: bool | None = None  # counts by time of week, else by UTC
        self._last: tuple[int, int] | None = None  # us: receiver's, board's
        self._behind: list[tuple[int, int]] = []  # fixes that may be behind a step
        self._trusted = 0  # fixes of one count so far

    def device_us(self, fix: Fix, arrival_us: int) -> float | None:
        """us of the board's clock at the fix, which came at arrival_us; None: unknown."""
        now_us = self._receiver_us(fix)
        if now_us is None:
            return None
        here = now_us, arrival_us
        if self._last is not None and abs(ahead := _ahead_s(self._last, here)) > _limit(
            self._last, here
        ):
            if not self._stepped(here):
                return None
            if self._trusted >= STEP_FIXES:  # before that it has only begun
                log.warning("the receiver's time stepped by %+.3f s", ahead)
                self.steps, self.last_step_s = self.steps + 1, ahead
            self._trusted = len(self._behind)
            self._clock = DeviceClock()
            for before in self._behind:
                self._clock.add(before[0], before[1] * 1000)
        self._behind, self._last, self._trusted = [], here, self._trusted + 1
        self._clock.add(now_us, arrival_us * 1000)
        return self._clock.host_ns(now_us) / 1e3

    def _stepped(self, here: tuple[int, int]) -> bool:
        """Whether the fixes since the step agree for long enough with each other."""
        behind = self._behind
        if behind and abs(_ahead_s(behind[0], here)) > STEP_SPREAD_S:
            behind.clear()
        behind.append(here)
        lasted_s = (here[1] - behind[0][1]) / 1e6
        return len(behind) >= STEP_FIXES and lasted_s >= STEP_AFTER_S

    def _receiver_us(self, fix: Fix) -> int | None:
        """A count of us that goes on as time does; None where the fix has no time."""
        if fix.tow_ns is None:
            if not fix.fix_utc_ns:
                return None
            self._use(False)
            return fix.fix_utc_ns // 1000
        self._use(True)
        tow_ns = _with_fraction(fix.tow_ns, fix.fix_utc_ns)
        if self._last is not None:  # Saturday to Sunday it begins again
            newest = self._behind[-1] if self._behind else self._last
            tow_ns += round((newest[0] * 1000 - tow_ns) / WEEK_NS) * WEEK_NS
        return tow_ns // 1000

    def _use(self, weeks: bool) -> None:
        if self._weeks is not None and self._weeks != weeks:
            self.restart()
        self._weeks = weeks


def _with_fraction(tow_ns: int, utc_ns: int) -> int:
    """Time of week is told in whole ms; UTC has the same second's fraction to a nanosecond."""
    if not utc_ns:
        return tow_ns
    half = 5 * 10**8
    off = (utc_ns - tow_ns + half) % 10**9 - half
    return tow_ns + off if abs(off) < 2 * 10**6 else tow_ns


def _ahead_s(before: tuple[int, int], here: tuple[int, int]) -> float:
    """By how much more the receiver's time went on than the board's, s."""
    return ((here[0] - before[0]) - (here[1] - before[1])) / 1e6


def _limit(before: tuple[int, int], here: tuple[int, int]) -> float:
    return MOST_DELAY_S + DRIFT * abs(here[1] - before[1]) / 1e6
