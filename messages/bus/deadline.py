"""Until when an order is good: as long as who gave it waits.

A service that was stopped, or a router that was, has what was ordered meanwhile in its queue, and
would carry it out long after a person was told that nobody answers: a table would begin to turn by
itself. So an order bears its end by the elapsed time of the site's home, which every process
compares its own with (beating.py) and which nobody sets. Where that is not known an order is good
as it comes.
"""

from typing import NamedTuple

from messages.clock import elapsed_ns
from messages.offset import DRIFT

WORST_NS = 2 * 10**9  # that a comparison which is believed may be off
GRACE_NS = 5 * 10**8
UNTIL = "until"  # parameter of an order's selector, ns


class Heard(NamedTuple):
    """The last comparison of this process."""

    theta_ns: int  # home's elapsed time minus ours
    bound_ns: float  # the most that it is off
    at_ns: int  # by ours


_last: list[Heard] = []


def heard(theta_ns: int, bound_ns: float) -> None:
    """Go by this comparison from now on."""
    _last[:] = [Heard(theta_ns, bound_ns, elapsed_ns())]


def _now() -> tuple[int, int] | None:
    """Home's elapsed time, ns, and the most that it may be off; None where it is not known. One
    that was stopped goes by what it knew before.
    """
    if not _last:
        return None
    last, now = _last[0], elapsed_ns()
    bound = int(last.bound_ns + DRIFT * (now - last.at_ns))
    return (now + last.theta_ns, bound) if bound < WORST_NS else None


def until(patience_s: float) -> str:
    """What is put behind the key of an order; empty where home's time is not known."""
    now = _now()
    return "" if now is None else f"?{UNTIL}={now[0] + now[1] + int(patience_s * 1e9)}"


def late_s(said: str | None) -> float:
    """How long ago who gave an order has surely given it up, s; 0: he has not, as far as is
    known. said: value of the parameter.
    """
    now = _now()
    if now is None or said is None or not (said.isascii() and said.isdecimal()) or len(said) > 20:
        return 0.0
    return max(0, now[0] - now[1] - GRACE_NS - int(said)) * 1e-9
