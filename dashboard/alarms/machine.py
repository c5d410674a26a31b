"""The states of one alarm after ISA-18.2, as a pure function of what happens to it.

    normal --raised--> unacknowledged --acknowledged--> acknowledged --ended--> normal
                             |                                                    ^
                             '--ended--> returned, unacknowledged --acknowledged--'

Shelved lies over all of them: the alarm is silent until its time is over, and goes on below. Time
is elapsed time (messages.clock), which nobody sets; UTC stands beside it for people.
"""

import math
from dataclasses import dataclass, replace
from enum import StrEnum

CHATTER_S = 60.0  # s in which ...
CHATTER = 4  # ... an alarm that is raised so often chatters
LEVELS = ("watch", "warning", "critical")


class State(StrEnum):
    """Where an alarm stands."""

    NORMAL = "normal"
    UNACKNOWLEDGED = "unacknowledged"
    ACKNOWLEDGED = "acknowledged"
    RETURNED = "returned"
    SHELVED = "shelved"


@dataclass(frozen=True)
class Now:
    """A moment: elapsed s, and ns since 1970 for people."""

    s: float
    utc_ns: int


@dataclass(frozen=True)
class Cause:
    """What is found to be wrong."""

    kind: str
    title: str
    text: str
    level: str  # one of LEVELS
    page: str = ""
    value: float = math.nan
    limit: float = math.nan
    unit: str = ""


@dataclass(frozen=True)
class Point:
    """One alarm: what it is about, whether that is there, and what people did."""

    id: str
    device: str  # empty: the bench
    cause: Cause
    active: bool = False
    unknown: bool = False  # whether the cause is there is not known
    owed: bool = False  # it was raised and nobody has taken note since
    raised_ns: int = 0
    returned_ns: int = 0
    returned_s: float = 0.0
    acknowledged_by: str = ""
    acknowledged_ns: int = 0
    note: str = ""
    shelved_until_s: float = 0.0  # elapsed; 0: on no shelf
    shelved_by: str = ""
    reason: str = ""
    times: int = 0
    raises: tuple[float, ...] = ()  # the newest, elapsed s
    first_out: bool = False

    @property
    def state(self) -> State:
        """Of it now."""
        if self.shelved_until_s:
            return State.SHELVED
        if self.owed:
            return State.UNACKNOWLEDGED if self.active else State.RETURNED
        return State.ACKNOWLEDGED if self.active else State.NORMAL

    @property
    def chattering(self) -> bool:
        """Whether it comes and goes."""
        return len(self.raises) >= CHATTER and self.raises[-1] - self.raises[0] <= CHATTER_S


def raised(point: Point, cause: Cause, now: Now, first: bool) -> Point:
    """The cause is there. first: nothing else is, of the same device."""
    if point.active:
        worse = LEVELS.index(cause.level) > LEVELS.index(point.cause.level)
        return replace(point, cause=cause, unknown=False, owed=point.owed or worse)
    anew = point.state in (State.NORMAL, State.SHELVED) and not point.owed
    return replace(
        point,
        cause=cause,
        active=True,
        unknown=False,
        owed=True,
        raised_ns=now.utc_ns,
        returned_ns=0,
        acknowledged_by="",
        acknowledged_ns=0,
        note="",
        times=1 if anew else point.times + 1,
        raises=(*point.raises, now.s)[-CHATTER:],
        first_out=first,
    )


def ended(point: Point, now: Now) -> Point:
    """The cause is gone, for certain."""
    if not point.active:
        return replace(point, unknown=False)
    return replace(point, active=False, unknown=False, returned_ns=now.utc_ns, returned_s=now.s)


def unknown(point: Point) -> Point:
    """Whether the cause is there is not known: what was there is not taken for gone."""
    return replace(point, unknown=True)


def acknowledged(point: Point, who: str, note: str, now: Now) -> Point:
    """A person has taken note."""
    return replace(point, owed=False, acknowledged_by=who, acknowledged_ns=now.utc_ns, note=note)


def shelved(point: Point, who: str, reason: str, seconds: float, now: Now) -> Point:
    """A person does not want to hear of it for a while."""
    return replace(point, shelved_until_s=now.s + seconds, shelved_by=who, reason=reason)


def unshelved(point: Point) -> Point:
    """Off the shelf. What is there then has to be taken note of again."""
    return replace(
        point, shelved_until_s=0.0, shelved_by="", reason="", owed=point.owed or point.active
    )


def lapsed(point: Point, now: Now) -> bool:
    """Whether its time on the shelf is over."""
    return bool(point.shelved_until_s) and now.s >= point.shelved_until_s
