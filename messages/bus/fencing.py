"""Of two processes that publish the same, the newer one counts: fencing by a number that only
grows.

A process that was stopped (a signal, a debugger, a machine that slept) and goes on does not know
that another took its place meanwhile. So each claims what it publishes under a number, greater than
all that were heard of, and sends it with every message (as the attachment). Who listens refuses
messages with a smaller number than it has heard on the same key. The one with the smaller number
finds out by the other's token and steps back.

A claim is a Zenoh liveliness token `<base>/<number>-<id>`, which goes with its process's
connection. While another has one, a newcomer waits, with a token `<base>/waiting-<id>` of its own;
of two that claim at the same time the greater number serves. A number is believed when its
publisher has claimed it: whoever sends a great one beside the process that serves silences nobody,
and when the one with the greater number has gone, the one that is left is heard again.
"""

import logging
import threading
import time
from collections.abc import Callable, Iterable

import zenoh

from messages.contract.checks import Refusal
from messages.contract.door import device_of
from messages.contract.topics import ESTIMATES, GATEWAY, RECORDER, TopicError, check_name, parse

log = logging.getLogger(__name__)

QUERY_S = 1.0  # how long to wait for other tokens; a router answers in milliseconds
RETRY_S = 2.0
BOTH = 2  # a session's own token in an answer: as the session knows it, and as the router does
BYTES = 8  # of a number in an attachment
KEYS = 1 << 16  # whose numbers are remembered
FAR_NS = 100 * 365 * 86400 * 10**9  # a number is about a time; further ahead it is none

CLAIMED_ESTIMATES = "estimates"  # in the tokens of estimators
CLAIMS = 1 << 16  # live ones that are remembered

Rank = tuple[int, str]  # number, and the session's id where two are equal


def packed(number: int) -> bytes | None:
    """A number as an attachment; None for 0, which fences nothing."""
    return number.to_bytes(BYTES, "little") if number else None


class Claims:
    """Who has claimed what at this moment, as their tokens say; may be used by several threads."""

    def __init__(self) -> None:
        self._live: dict[str, set[Rank]] = {}  # by what is claimed
        self._count = 0
        self._lock = threading.Lock()

    def heard(self, sample: zenoh.Sample) -> None:
        """Zenoh's thread: a token has come or gone."""
        key = str(sample.key_expr)
        rank, about = rank_of(key), _claimed(*key.split("/")[-3:-1])
        if rank is None:
            return
        with self._lock:
            ranks = self._live.setdefault(about, set())
            if sample.kind != zenoh.SampleKind.PUT:
                self._count -= rank in ranks
                ranks.discard(rank)
            elif self._count < CLAIMS:
                self._count += rank not in ranks
                ranks.add(rank)
            if not ranks:
                del self._live[about]

    def numbers(self, key: str) -> set[int]:
        """Under which numbers messages of this key are claimed; empty when nobody has, and when
        there are more claims than can be remembered.
        """
        try:
            address = parse(key)
        except TopicError:
            return set()
        with self._lock:
            if self._count >= CLAIMS:
                return set()
            ranks = self._live.get(_claimed(address.device, address.topic.source), ())
            return {number for number, _ in ranks}


def _claimed(name: str, source: str) -> str:
    """What a claim is about: a device's gateway, or estimates, whoever's they are."""
    return f"{name}/{source}" if source == GATEWAY else ESTIMATES


class Fence:
    """The numbers that a consumer has heard, key by key; may be used by several threads."""

    def __init__(self, refuse: Callable[[str, Refusal, str], None]) -> None:
        """refuse(key, why, device): count and say a message that is not taken."""
        self._refuse = refuse
        self._numbers: dict[str, int] = {}
        self.claims = Claims()

    def admit(self, key: str, attachment: "zenoh.ZBytes | None") -> bool:
        """Is this message of the newest publisher of its key? One without a number always is."""
        if attachment is None or len(attachment) != BYTES:
            return True
        number = int.from_bytes(attachment.to_bytes(), "little")
        known = self._numbers.get(key, 0)
        if number == known:
            return True
        claimed = self.claims.numbers(key)
        if number < known and (number not in claimed or known in claimed):
            wanted = f"{known}, of the process that took its place"
            self._refuse(key, Refusal("stale", "publisher", str(number), wanted), device_of(key))
            return False
        if number > time.time_ns() + FAR_NS or (claimed and number not in claimed):
            wanted = f"a number that its publisher has claimed: {max(claimed, default=known)}"
            self._refuse(key, Refusal("claim", "publisher", str(number), wanted), device_of(key))
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

    def declare(self, session: zenoh.Session, prefix: str) -> "Declared":
        """Watch who claims what from now on, and tell whoever takes a device over which numbers
        were heard of it.
        """

        def on_query(query: zenoh.Query) -> None:
            device = str(query.key_expr).split("/")[1]
            source = query.payload.to_string() if query.payload is not None else ""
            number = self.highest(device, source)
            if number:
                name = RECORDER if device == "*" else device  # a reply's key names one
                query.reply(f"{prefix}/{name}/fence", number.to_bytes(BYTES, "little"))

        watches = [
            session_watch(session, f"{prefix}/*/{kind}/*", self.claims.heard)
            for kind in (GATEWAY, CLAIMED_ESTIMATES)
        ]
        return Declared([*watches, session.declare_queryable(f"{prefix}/*/fence", on_query)])


class Declared:
    """What a fence has declared on the bus."""

    def __init__(self, parts: "list[zenoh.Subscriber[None] | zenoh.Queryable[None]]") -> None:
        self._parts = parts

    def undeclare(self) -> None:
        """Take it back."""
        for part in self._parts:
            part.undeclare()


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
        self._id = str(session.zid())
        self._tokens = self._declare()
        self._watches: list[zenoh.Subscriber] = []

    def _declare(self) -> list[zenoh.LivelinessToken]:
        return [
            self._session.liveliness().declare_token(f"{base}/{self.number:020d}-{self._id}")
            for base in self._bases
        ]

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
            session_watch(self._session, f"{base}/*", self._heard) for base in self._bases
        ]

    def look(self) -> bool:
        """Ask now; False when another has it, and `lost` is set, or when that is not known."""
        ranks = alive(self._session, self._bases, f"{self.number:020d}-{self._id}")
        if self._outdone(ranks or ()):
            self.lost.set()
        return ranks is not None and not self.lost.is_set()

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
    names = tuple(bases)
    name = f"waiting-{session.zid()}"
    waiting = [session.liveliness().declare_token(f"{base}/{name}") for base in names]
    try:
        return _claim(session, names, name, own, stop, on_refused, heard)
    finally:
        for token in waiting:
            token.undeclare()


def _claim(
    session: zenoh.Session,
    bases: tuple[str, ...],
    waiting: str,
    own: int,
    stop: threading.Event,
    on_refused: Callable[[str], None],
    heard: Callable[[], int],
) -> Claim | None:
    greatest, looks, wanted = 0, 0, 1  # looks in a row that found nobody, and how many it takes
    while not stop.is_set():
        ranks = alive(session, bases, waiting)
        others = [rank for rank in ranks or () if rank[1] != str(session.zid())]
        looks = looks + 1 if ranks is not None and not others else 0
        refused = others[0][1] if others else ""
        if looks >= wanted:
            greatest = max(greatest, heard())
            mine = Claim(session, bases, max(own, greatest + 1) if greatest else own)
            if mine.look():
                mine.watch()
                return mine
            mine.release()
            refused = "one that came at the same time"
        greatest = max([greatest, *(number for number, _ in others)])
        if refused and wanted == 1:
            on_refused(refused)
            wanted = 2  # who was there may only be late in coming back to a router that began anew
        stop.wait(RETRY_S)
    return None


def alive(session: zenoh.Session, bases: Iterable[str], own: str) -> list[Rank] | None:
    """Numbers and ids of the tokens below the bases. None when that is not known: without a router,
    or when it does not answer, nobody may be taken for gone.

    own: name of a token of this session below each base. The session itself answers with it, and so
    does the router: only an answer that has it twice is the router's. (While a connection is being
    made anew, a query ends at once, and without an error, with what the session knows itself.)
    """
    found = []
    for base in bases:
        seen = 0
        for reply in session.liveliness().get(f"{base}/*", timeout=QUERY_S):
            if reply.ok is None:
                return None
            key = str(reply.ok.key_expr)
            seen += key == f"{base}/{own}"
            rank = rank_of(key)
            found += [] if rank is None else [rank]
        if seen < BOTH:
            return None
    return sorted(found)


def rank_of(key: str) -> Rank | None:
    """What a token says; None for one that says nothing of the kind."""
    number, _, name = key.rsplit("/", 1)[-1].partition("-")
    if not number.isdecimal() or int(number) > time.time_ns() + FAR_NS:
        return None
    return int(number), name
