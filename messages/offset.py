"""How far another machine's clock is from ours, by questions and answers over a link.

One question has four stamps: t1 when it was sent and t4 when its answer came, by our elapsed time,
t2 when it was received and t3 when it was answered, by the other's clock. After D. Mills et al.,
RFC 5905, section 8 (equations T-1 and T-2 of docs/equations-time.md):

    theta = ((t2 - t1) + (t3 - t4)) / 2        the other's clock minus our elapsed time
    delta = (t4 - t1) - (t3 - t2)              the way there and back
    |error of theta| <= delta / 2              however the way is shared between there and back

Of the last questions the one with the least bound counts, which grows with its age by what clocks
drift: the minimum filter of RFC 5905, section 10. Ours is elapsed time, so that a step of our own
wall clock changes nothing in here; two answers that cannot both be true say that the other clock
was set, and the older ones are dropped.
"""

from collections import deque
from typing import NamedTuple

WINDOW = 8  # questions, as in RFC 5905
OLD_NS = 60_000_000_000  # after which an answer says nothing about now
DRIFT = 1e-3  # of two clocks against one another: each is slewed by at most 500 ppm


class Measured(NamedTuple):
    """An offset, ns, and the most that it may be wrong by, ns."""

    theta_ns: float
    bound_ns: float


class Exchange(NamedTuple):
    """The four stamps of one question, ns: t1 and t4 by our elapsed time, t2 and t3 by the other's
    clock.
    """

    t1: int
    t2: int
    t3: int
    t4: int

    @property
    def delta_ns(self) -> int:
        """The way there and back (T-2)."""
        return (self.t4 - self.t1) - (self.t3 - self.t2)

    @property
    def measured(self) -> Measured:
        """Of this one alone (T-1)."""
        theta = ((self.t2 - self.t1) + (self.t3 - self.t4)) / 2
        return Measured(theta, self.delta_ns / 2)


class Offset:
    """The other's clock minus our elapsed time, as the last questions tell it."""

    def __init__(self) -> None:
        self._kept: deque[Exchange] = deque(maxlen=WINDOW)
        self.refused = 0  # answers that no pair of clocks can give
        self.steps = 0  # times that the other clock was set

    def take(self, one: Exchange) -> None:
        """Another answer."""
        if one.t4 < one.t1 or one.t3 < one.t2 or one.delta_ns < 0:
            self.refused += 1
            return
        new, before = one.measured, self.at(one.t4)
        if before is not None and abs(new.theta_ns - before.theta_ns) > (
            new.bound_ns + before.bound_ns
        ):
            self._kept.clear()
            self.steps += 1
        self._kept.append(one)

    def at(self, now_ns: int) -> Measured | None:
        """The best of them at an elapsed time; None where none is young enough."""
        found = [
            Measured(one.measured.theta_ns, one.measured.bound_ns + DRIFT * (now_ns - one.t4))
            for one in self._kept
            if now_ns - one.t4 <= OLD_NS
        ]
        return min(found, key=lambda one: one.bound_ns, default=None)
