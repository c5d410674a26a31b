"""How far another machine's clock is from ours, by questions and answers over a link.

One question has four stamps: t1 when it was sent and t4 when its answer came, by our elapsed time,
t2 when it was received and t3 when it was answered, by the other's. After D. Mills et al., RFC
5905, section 8 (equations T-1 and T-2 of docs/equations-time.md):

    theta = ((t2 - t1) + (t3 - t4)) / 2        the other's elapsed time minus ours
    delta = (t4 - t1) - (t3 - t2)              the way there and back
    |error of theta| <= delta / 2              however the way is shared between there and back,
                                               and what the clocks drift in t4 - t1

Of the last questions the one with the least bound counts, which grows with its age by what clocks
drift: the minimum filter of RFC 5905, section 10. Elapsed time is set by nobody: what the other's
wall clock says beyond it comes with each answer, so a step of it counts at once. Two answers that
cannot both be true say that another machine answers, or that it began anew; older ones are dropped.
"""

from collections import deque
from collections.abc import Iterable
from typing import NamedTuple

WINDOW = 8  # questions, as in RFC 5905
OLD_NS = 300_000_000_000  # after which an answer says nothing about now
ROUNDED_NS = 2.0
DRIFT = 1e-3  # of two clocks against one another: each is slewed by at most 500 ppm


class Measured(NamedTuple):
    """An offset, ns, and the most that it may be wrong by, ns."""

    theta_ns: int
    bound_ns: float


class Exchange(NamedTuple):
    """The four stamps of one question, ns: t1 and t4 by our elapsed time, t2 and t3 by the other's;
    and what the other's wall clock said beyond its elapsed time.
    """

    t1: int
    t2: int
    t3: int
    t4: int
    wall: int = 0

    @property
    def delta_ns(self) -> int:
        """The way there and back (T-2)."""
        return (self.t4 - self.t1) - (self.t3 - self.t2)

    @property
    def drift_ns(self) -> float:
        """By what the clocks may have drifted meanwhile."""
        return DRIFT * (self.t4 - self.t1)

    @property
    def measured(self) -> Measured:
        """Of this one alone (T-1)."""
        theta = ((self.t2 - self.t1) + (self.t3 - self.t4)) // 2
        return Measured(theta, max(self.delta_ns, 0) / 2 + self.drift_ns + ROUNDED_NS)


class Offset:
    """The other's wall clock minus our elapsed time, as the last questions tell it. One thread may
    take answers while others ask.
    """

    def __init__(self) -> None:
        self._kept: deque[Exchange] = deque(maxlen=WINDOW)
        self.refused = 0  # answers that no pair of clocks can give
        self.anew = 0  # times that what was known before had to be dropped

    def take(self, one: Exchange) -> None:
        """Another answer."""
        if one.t4 < one.t1 or one.t3 < one.t2 or one.delta_ns < -one.drift_ns - ROUNDED_NS:
            self.refused += 1
            return
        new, before = one.measured, _best(self._kept, one.t4)
        if before is not None and abs(new.theta_ns - before.theta_ns) > (
            new.bound_ns + before.bound_ns
        ):
            self._kept.clear()
            self.anew += 1
        self._kept.append(one)

    def at(self, now_ns: int) -> Measured | None:
        """The best of them at an elapsed time, with the wall clock of the newest answer; None where
        none is young enough.
        """
        kept = tuple(self._kept)  # in one piece: an answer may come meanwhile
        best = _best(kept, now_ns)
        if best is None:
            return None
        return best._replace(theta_ns=best.theta_ns + kept[-1].wall)

    def elapsed(self, now_ns: int) -> Measured | None:
        """The same of both elapsed times, which nobody sets."""
        return _best(tuple(self._kept), now_ns)


def _best(kept: Iterable[Exchange], now_ns: int) -> Measured | None:
    """Of elapsed times (T-3)."""
    found = [
        Measured(one.measured.theta_ns, one.measured.bound_ns + DRIFT * (now_ns - one.t4))
        for one in kept
        if now_ns - one.t4 <= OLD_NS
    ]
    return min(found, key=lambda one: one.bound_ns, default=None)
