"""Of two processes that publish the same, the newer one counts: fencing by a number that only
grows.

A process that was stopped (a signal, a debugger, a machine that slept) and goes on does not know
that another took its place meanwhile. So each claims what it publishes under a number, greater than
all that were heard of, and sends it with every message (as the attachment). Who listens refuses
messages with a smaller number than it has heard on the same key. The one with the smaller number
finds out by the other's token and steps back.

A claim is a Zenoh liveliness token `<base>/<number>-<id>`, which goes with its process's
connection. While another has one, a newcomer waits; of two that claim at the same time the greater
number serves.
"""

import logging
import threading
import time
from collections.abc import Callable, Iterable

import zenoh

from messages.contract.checks import Refusal
from messages.contract.door import device_of
from messages.contract.topics import RECORDER, TopicError, check_name, parse

log = logging.getLogger(__name__)

QUERY_S = 1.0  # how long to wait for other tokens; a router answers in milliseconds
RETRY_S = 2.0
BYTES = 8  # of a number in an attachment
KEYS = 1 << 16  # whose numbers are remembered
FAR_NS = 100 * 365 * 86400 * 10**9  # a number is about a time; further ahead it is none

Rank = tuple[int, str]  # number, and the session's id where two are equal


def packed(number: int) -> bytes | None:
    """A number as an attachment; None for 0, which fences nothing."""
    return number.to_bytes(BYTES, "little") if number else None


class Fence:
    """The numbers that a consumer has heard, key by key; may be used by several threads."""

    def __init__(self, refuse: Callable[[str, Refusal, str], None]) -> None:
        """refuse(key, why, device): count and say a message that is not taken."""
        self._refuse = refuse
        self._numbers: dict[str, int] = {}

    def admit(self, key: str, attachment: "zenoh.ZBytes | None") -> bool:
        """Is this message of the newest publisher of its key? One without a number always is."""
        if attachment is None or len(attachment) != BYTES:
            return True
        number = int.from_bytes(attachment.to_bytes(), "little")
        known = self._numbers.get(key, 0)
        if number < known:
            wanted = f"{known}, of the process that took its place"
            self._refuse(key, Refusal("stale", "publisher", str(number), wanted), device_of(key))
            return False
        if number > known:
            if number > time.time_ns() + FAR_NS:
                why = Refusal("stale", "publisher", str(number), "a number about the present time")
                self._refuse(key, why, device_of(key))
                return False
            if len(self._numbers) < KEYS or key in self._numbers:
                self._numbers[key] = number
        return True

    def highest(self, device: str, source: str) -> int:
        """The greatest number heard of a device's topics of one source."""
        found = 0
        for key, number in list(self._numbers.items()):
            try:
                address = parse(key)
            except TopicError:
                continue
            if device in ("*", address.device) and address.topic.source == source:
                found = max(found, number)
        return found

    def declare(self, session: zenoh.Session, prefix: str) -> zenoh.Queryable:
        """Tell whoever takes a device over which numbers were heard of it."""

        def on_query(query: zenoh.Query) -> None:
            device = str(query.key_expr).split("/")[1]
            source = query.payload.to_string() if query.payload is not None else ""
            number = self.highest(device, source)
            if number:
                name = RECORDER if device == "*" else device  # a reply's key names one
                query.reply(f"{prefix}/{name}/fence", number.to_bytes(BYTES, "little"))

        return session.declare_queryable(f"{prefix}/*/fence", on_query)


def heard_of(session: zenoh.Session, prefix: str, device: str, source: str) -> int:
    """The greatest number that any consumer has heard of a device's (`*`: any's) topics of one
    source.
    """
    found = 0
    for reply in session.get(
        f"{check_name(prefix)}/{device}/fence",
        payload=source,
        timeout=QUERY_S,
        target=zenoh.QueryTarget.ALL,
        consolidation=zenoh.ConsolidationMode.NONE,
    ):
        if reply.ok is not None:
            number = int.from_bytes(reply.ok.payload.to_bytes()[:BYTES], "little")
            found = max(found, number if number < time.time_ns() + FAR_NS else 0)
    return found


class Claim:
    """What a process has claimed. `lost` is set when another claims it under a greater number."""

    def __init__(self, session: zenoh.Session, bases: Iterable[str], number: int) -> None:
        self.number, self.lost = number, threading.Event()
        self._session, self._bases = session, tuple(bases)
        self._rank: Rank = (number, str(session.zid()))
        self._tokens = [
            session.liveliness().declare_token(f"{base}/{number:020d}-{session.zid()}")
            for base in self._bases
        ]
        self._watches: list[zenoh.Subscriber] = []

    def watch(self) -> None:
        """From now on `lost` is set when it comes to that."""
        self._watches = [
            session_watch(self._session, f"{base}/*", self._heard) for base in self._bases
        ]

    def look(self) -> bool:
        """Ask now; False, and `lost` is set, when another has it."""
        if self._outdone(alive(self._session, self._bases)):
            self.lost.set()
        return not self.lost.is_set()

    def release(self) -> None:
        """Give it up."""
        for one in (*self._watches, *self._tokens):
            one.undeclare()

    def _outdone(self, ranks: Iterable[Rank]) -> bool:
        return any(rank > self._rank for rank in ranks)

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
    session: zenoh.Session,
    bases: Iterable[str],
    own: int,
    stop: threading.Event,
    on_refused: Callable[[str], None],
    heard: Callable[[], int] = lambda: 0,
) -> Claim | None:
    """Wait until what the bases name is free and claim it; None when `stop` came first.

    own: the number to claim under, at least; heard(): the greatest that others know of.
    on_refused(id) is called once, before waiting, when another has it.
    """
    names, greatest, said = tuple(bases), 0, False
    while not stop.is_set():
        others = [rank for rank in alive(session, names) if rank[1] != str(session.zid())]
        if not others:
            greatest = max(greatest, heard())
            mine = Claim(session, names, max(own, greatest + 1) if greatest else own)
            if mine.look():
                mine.watch()
                return mine
            mine.release()
        greatest = max([greatest, *(number for number, _ in others)])
        if not said:
            on_refused(others[0][1] if others else "one that came at the same time")
            said = True
        stop.wait(RETRY_S)
    return None


def alive(session: zenoh.Session, bases: Iterable[str]) -> list[Rank]:
    """Numbers and ids of the tokens below the bases."""
    found = []
    for base in bases:
        for reply in session.liveliness().get(f"{base}/*", timeout=QUERY_S):
            rank = None if reply.ok is None else rank_of(str(reply.ok.key_expr))
            found += [] if rank is None else [rank]
    return sorted(found)


def rank_of(key: str) -> Rank | None:
    """What a token says; None for one that says nothing of the kind."""
    number, _, name = key.rsplit("/", 1)[-1].partition("-")
    if not number.isdecimal() or int(number) > time.time_ns() + FAR_NS:
        return None
    return int(number), name
