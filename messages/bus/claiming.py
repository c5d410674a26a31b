"""Who publishes what: of two processes that would do the same, one serves and the other waits.

A process claims what it is going to publish with a Zenoh liveliness token `<base>/<number>-<id>`,
which goes with its connection. The number is greater than all that were heard of, and goes with
every message (fencing.py). While another has a claim a newcomer waits, in a queue of tokens
`<base>/waiting-<since>-<id>`: of those that wait the one that came first is next, so that of two
that start in the same moment one serves and the other never did. Should two have claimed all the
same (the router began anew, or there are several), the greater number serves.

A process that was stopped (a signal, a debugger, a machine that slept) and goes on does not know
that another took its place meanwhile: it hears of the other's token, and steps back.

Who is there is asked by a session of its own, the onlooker, which declares nothing and subscribes
to nothing. A session that does answers such a question partly itself: while its connection is made
anew, with its own tokens alone, and with what it watches, as far as it has heard of it. The
onlooker knows nothing itself: an answer that names the token of the session beside it is the
router's, and whole.
"""

import logging
import threading
import time
from collections.abc import Callable, Iterable
from typing import NamedTuple

import zenoh

log = logging.getLogger(__name__)

QUERY_S = 1.0  # how long to wait for other tokens; a router answers in milliseconds
LOOK_S = 0.01  # between two questions, until the own token is known to the router
RETRY_S = 2.0
FAR_NS = 100 * 365 * 86400 * 10**9  # a number is about a time; further ahead it is none
OVERDUE = b"Timeout"  # what Zenoh answers, here or in the router, when the time is over
WAITING = "waiting"  # first part of the name of a token of who waits

Rank = tuple[int, str]  # number, and the session's id where two are equal


class Claimant(NamedTuple):
    """The two sessions of a process that claims something."""

    session: zenoh.Session  # has the tokens, and publishes
    onlooker: zenoh.Session  # does nothing but ask


class Claim:
    """What a process has claimed. `lost` is set when another claims it under a greater number."""

    def __init__(self, claimant: Claimant, bases: Iterable[str], number: int) -> None:
        self.number, self.lost = number, threading.Event()
        self._claimant, self._bases = claimant, tuple(bases)
        self._id = str(claimant.session.zid())
        self._tokens = self._declare()
        self._watches: list[zenoh.Subscriber] = []

    def _declare(self) -> list[zenoh.LivelinessToken]:
        return _tokens(self._claimant.session, self._bases, name_of((self.number, self._id)))

    def raise_to(self, number: int) -> None:
        """Claim the same under a greater number, the one that messages are going to have."""
        if number > self.number:
            self.number, old = number, self._tokens
            self._tokens = self._declare()
            for token in old:
                token.undeclare()
            self.look()  # a round trip: the token is known before the first message

    def watch(self) -> None:
        """From now on `lost` is set when it comes to that."""
        self._watches = [
            session_watch(self._claimant.session, f"{base}/*", self._heard) for base in self._bases
        ]

    def look(self) -> bool:
        """Ask now; False when another has it, and `lost` is set, or when that is not known."""
        there = alive(self._claimant.onlooker, self._bases, name_of((self.number, self._id)))
        if there is not None and self._outdone(there.serving):
            self.lost.set()
        return there is not None and not self.lost.is_set()

    def release(self) -> None:
        """Give it up."""
        for one in (*self._watches, *self._tokens):
            one.undeclare()

    def _outdone(self, ranks: Iterable[Rank]) -> bool:
        mine = self.number, self._id
        return any(rank > mine and rank[1] != self._id for rank in ranks)

    def _heard(self, sample: zenoh.Sample) -> None:
        rank = rank_of(str(sample.key_expr))
        if sample.kind == zenoh.SampleKind.PUT and rank is not None and self._outdone([rank]):
            self.lost.set()


def session_watch(
    session: zenoh.Session, pattern: str, handler: Callable[[zenoh.Sample], None]
) -> zenoh.Subscriber:
    """Tokens that come and go from now on, and those that are there."""
    return session.liveliness().declare_subscriber(pattern, handler, history=True)


def claim(
    claimant: Claimant,
    bases: Iterable[str],
    own: int,
    stop: threading.Event,
    on_refused: Callable[[str], None],
    heard: Callable[[], int] = lambda: 0,
    wait: bool = True,
) -> Claim | None:
    """Wait until what the bases name is free and claim it; None when `stop` came first, or when
    it is not free and there is no time to `wait`.

    own: the number to claim under, at least; heard(): the greatest that others know of.
    on_refused(id) is called once, before waiting, when another has it, or came earlier.
    """
    names = tuple(bases)
    since = time.time_ns(), str(claimant.session.zid())
    waiting = _tokens(claimant.session, names, f"{WAITING}-{name_of(since)}")
    try:
        return _claim(claimant, names, since, own, stop, on_refused, heard, wait)
    finally:
        for token in waiting:
            token.undeclare()


def _claim(
    claimant: Claimant,
    bases: tuple[str, ...],
    since: Rank,
    own: int,
    stop: threading.Event,
    on_refused: Callable[[str], None],
    heard: Callable[[], int],
    wait: bool,
) -> Claim | None:
    greatest, looks, wanted = 0, 0, 1  # looks in a row that found nobody, and how many it takes
    while not stop.is_set():
        there = alive(claimant.onlooker, bases, f"{WAITING}-{name_of(since)}")
        others = there.others(since) if there is not None else []
        looks = looks + 1 if there is not None and not others else 0
        refused = others[0][1] if others else ""
        if looks >= wanted:
            greatest = max(greatest, heard())
            mine = Claim(claimant, bases, max(own, greatest + 1) if greatest else own)
            if mine.look():
                mine.watch()
                return mine
            mine.release()
            refused = "one that came at the same time"
        if there is not None:
            greatest = max([greatest, *(number for number, _ in there.serving)])
        if refused and wanted == 1:
            on_refused(refused)
            if not wait:
                break
            wanted = 2  # who was there may only be late in coming back to a router that began anew
        stop.wait(RETRY_S)
    return None


class There(NamedTuple):
    """Who is there."""

    serving: list[Rank]
    waiting: list[Rank]

    def others(self, since: Rank) -> list[Rank]:
        """Who serves, else who has waited longer than one that began at `since`."""
        serving = [rank for rank in self.serving if rank[1] != since[1]]
        return serving or [rank for rank in self.waiting if rank < since and rank[1] != since[1]]


def alive(onlooker: zenoh.Session, bases: Iterable[str], own: str) -> There | None:
    """Who serves and who waits below the bases. None when that is not known: without a router, or
    when it does not answer, nobody may be taken for gone.

    own: name of a token below each base, of the onlooker's neighbour: an answer without it is none.
    """
    end, all_of_them = time.monotonic() + QUERY_S, There([], [])
    for base in bases:
        while (there := _there(onlooker, base, own)) is None:
            if time.monotonic() > end:
                return None
            time.sleep(LOOK_S)  # the two have a connection each: the question may come first
        all_of_them.serving.extend(there.serving)
        all_of_them.waiting.extend(there.waiting)
    return There(sorted(all_of_them.serving), sorted(all_of_them.waiting))


def _there(onlooker: zenoh.Session, base: str, own: str) -> There | None:
    """One question about one base."""
    there, seen = There([], []), False
    for reply in onlooker.liveliness().get(f"{base}/*", timeout=QUERY_S):
        if reply.ok is None:
            return None
        name = str(reply.ok.key_expr).rsplit("/", 1)[-1]
        seen = seen or name == own
        rank, waits = rank_of(name), rank_of(name.removeprefix(f"{WAITING}-"))
        if rank is not None:
            there.serving.append(rank)
        elif waits is not None:
            there.waiting.append(waits)
    return there if seen else None


def rank_of(key: str) -> Rank | None:
    """What a token says; None for one that says nothing of the kind."""
    number, _, name = key.rsplit("/", 1)[-1].partition("-")
    if not number.isdecimal() or int(number) > time.time_ns() + FAR_NS:
        return None
    return int(number), name


def id_of(reply: zenoh.Reply) -> str:
    """Of the session that answered; empty where nobody did."""
    return str(reply.replier_id.zid) if reply.replier_id is not None else ""


def newest(session: zenoh.Session, base: str) -> str:
    """Id of the session that serves what the base names, by the tokens that this one can learn of;
    empty where there is none.
    """
    replies = session.liveliness().get(f"{base}/*", timeout=QUERY_S)
    ranks = [rank_of(str(reply.ok.key_expr)) for reply in replies if reply.ok is not None]
    return max((rank for rank in ranks if rank is not None), default=(0, ""))[1]


def name_of(rank: Rank) -> str:
    """The last part of a token's key."""
    return f"{rank[0]:020d}-{rank[1]}"


def _tokens(session: zenoh.Session, bases: Iterable[str], name: str) -> list[zenoh.LivelinessToken]:
    return [session.liveliness().declare_token(f"{base}/{name}") for base in bases]
