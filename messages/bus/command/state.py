"""Who has the command. Pure: what is asked and the time go in, what came of it comes out.

One operator has it, or nobody. It is taken silently by whoever orders first, asked for by others,
given by its holder, and passes without his answer; an admin takes it. A holder who is not heard of
any more, because his sign-in, his page or his link ended, has it no longer.
"""

from dataclasses import dataclass, replace

ANSWER_S = 30.0  # a holder has to answer who asks; then it passes
AWAY_S = 20.0  # without a word of the holder's dashboard, after which nobody has it
ASKING_S = 20.0  # without a word of who asks, after which he does not any more


@dataclass(frozen=True)
class Seat:
    """Who may order: a sign-in, or a program's token, at one place."""

    id: str
    user: str = ""
    place: str = ""
    admin: bool = False

    @property
    def name(self) -> str:
        """For people."""
        return f"{self.user or 'somebody'} ({self.place})" if self.place else self.user


@dataclass(frozen=True)
class Held:
    """How things are. epoch: greater with each holder. Times in s of one clock."""

    epoch: int = 0
    holder: Seat | None = None
    since_utc_ns: int = 0
    seen_s: float = 0.0  # when the holder was heard of
    asks: Seat | None = None
    asked_s: float = 0.0
    asking_s: float = 0.0  # when who asks was heard of
    last: str = ""


class Refusal(Exception):
    """Not done; the text says why."""


def _to(held: Held, seat: Seat | None, now_s: float, utc_ns: int, last: str) -> Held:
    return Held(held.epoch + 1, seat, utc_ns, now_s, last=last)


def _is(one: Seat | None, seat: Seat) -> bool:
    return one is not None and one.id == seat.id


def taken(held: Held, seat: Seat, now_s: float, utc_ns: int) -> Held:
    """It was free, or his already; raises Refusal."""
    if _is(held.holder, seat):
        return kept(held, seat, now_s)
    if held.holder is not None:
        raise Refusal(f"{held.holder.name} has the command: ask for it")
    return _to(held, seat, now_s, utc_ns, f"{seat.name} took it, it was free")


def forced(held: Held, seat: Seat, now_s: float, utc_ns: int) -> Held:
    """By an admin, from whoever has it; raises Refusal."""
    if not seat.admin:
        raise Refusal("to take the command from somebody takes the role admin: ask for it")
    if _is(held.holder, seat):
        return kept(held, seat, now_s)
    whom = "" if held.holder is None else f" from {held.holder.name}"
    return _to(held, seat, now_s, utc_ns, f"{seat.name} took it{whom}, as admin")


def asked(held: Held, seat: Seat, now_s: float, utc_ns: int) -> Held:
    """He wishes to have it, or still does; raises Refusal while another asks."""
    if held.holder is None or _is(held.holder, seat):
        return taken(held, seat, now_s, utc_ns)
    if _is(held.asks, seat):
        return replace(held, asking_s=now_s)
    if held.asks is not None:
        raise Refusal(f"{held.asks.name} asks for it already")
    return replace(held, asks=seat, asked_s=now_s, asking_s=now_s)


def granted(held: Held, seat: Seat, to: str, now_s: float, utc_ns: int) -> Held:
    """The holder gives it to who asks; raises Refusal. to: id of whom he was shown."""
    if not _is(held.holder, seat):
        raise Refusal("who does not have the command cannot give it")
    if held.asks is None or (to and held.asks.id != to):
        raise Refusal("he does not ask for it any more")
    return _to(held, held.asks, now_s, utc_ns, f"{seat.name} gave it to {held.asks.name}")


def denied(held: Held, seat: Seat) -> Held:
    """The holder keeps it, or who asks does so no more; raises Refusal."""
    if _is(held.asks, seat):
        return replace(held, asks=None)
    if not _is(held.holder, seat):
        raise Refusal("who does not have the command cannot refuse it")
    if held.asks is None:
        return held
    return replace(held, asks=None, last=f"{seat.name} keeps it; {held.asks.name} asked for it")


def released(held: Held, seat: Seat, now_s: float, utc_ns: int, why: str = "") -> Held:
    """He gives it up: it passes to who asks, else nobody has it."""
    if _is(held.asks, seat):
        return replace(held, asks=None)
    if not _is(held.holder, seat):
        return held
    said = why or "gave it up"
    return _left(held, now_s, utc_ns, f"{seat.name} {said}")


def kept(held: Held, seat: Seat, now_s: float) -> Held:
    """The holder, or who asks, is still there."""
    if _is(held.holder, seat):
        return replace(held, seen_s=now_s)
    return replace(held, asking_s=now_s) if _is(held.asks, seat) else held


def ticked(held: Held, now_s: float, utc_ns: int) -> Held:
    """What time brings."""
    if held.asks is not None and now_s - held.asking_s > ASKING_S:
        held = replace(held, asks=None)
    if held.holder is None:
        return held
    if now_s - held.seen_s > AWAY_S:
        return _left(held, now_s, utc_ns, f"nothing was heard of {held.holder.name}")
    if held.asks is not None and now_s - held.asked_s > ANSWER_S:
        return _left(held, now_s, utc_ns, f"{held.holder.name} did not answer")
    return held


def _left(held: Held, now_s: float, utc_ns: int, why: str) -> Held:
    to = held.asks
    last = f"{why}: {to.name} has it" if to is not None else f"{why}: nobody has it"
    return _to(held, to, now_s, utc_ns, last)


def left_s(held: Held, now_s: float) -> float:
    """Until it passes to who asks; 0 where nobody does."""
    return 0.0 if held.asks is None else max(0.0, ANSWER_S - (now_s - held.asked_s))
