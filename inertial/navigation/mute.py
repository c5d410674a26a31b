"""GNSS outages on an operator's order, as a function of the data's own time.

An order says which fixes it is about: those later than a moment and before another one, on the
board's clock. It does not say when it came. So it may be given to a pipeline before, between or
after the messages that it was given among live, as long as no fix that it is about has been used,
and the estimates are the same to the bit.
"""

import math
from dataclasses import dataclass, field
from typing import NamedTuple

LONGEST_MUTE = 600.0  # s
KEPT = 64  # orders; older ones are about fixes that were used long ago


class Mute(NamedTuple):
    """Fixes later than `after` and before `until` (s of the board's clock, of one boot) are held
    back.
    """

    epoch: int  # boot counter
    after: float
    until: float  # not above `after`: from there on fixes are used again


@dataclass
class Mutes:
    """All orders for one device. Of several, the latest one that began before a fix decides."""

    orders: list[Mute] = field(default_factory=list)

    def add(self, order: Mute) -> None:
        """Take an order, the newest there is."""
        others = [o for o in self.orders if o != order]
        self.orders = sorted([*others, order], key=lambda o: (o.epoch, o.after))[
            -KEPT:
        ]  # stable: the newest last

    def held(self, epoch: int, t: float) -> bool:
        """Whether a fix (or a solution) of time t, s, falls into an outage."""
        deciding = [o for o in self.orders if o.epoch == epoch and o.after < t]
        return bool(deciding) and t < deciding[-1].until


def order_for(seconds: float, epoch: int, newest: float) -> Mute:
    """Hold the fixes of the next seconds back, `newest` (s) being the latest time that anything
    came for; 0 ends it.

    Raises ValueError for a length that makes no sense.
    """
    if not 0.0 <= seconds <= LONGEST_MUTE:
        raise ValueError(f"mute GNSS for {seconds:g} s: want 0 to {LONGEST_MUTE:g} s")
    if not math.isfinite(newest):
        raise ValueError("mute GNSS: no sample has come yet")
    return Mute(epoch, newest, newest + seconds)
