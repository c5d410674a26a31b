"""Of two processes that publish the same, the newer one counts: fencing by a number that only
grows.

A process sends the number of its claim (claiming.py) with every message, as the attachment. Who
listens refuses messages with a smaller number than it has heard on the same key.

A number is believed when its publisher has claimed it: whoever sends a great one beside the process
that serves silences nobody, and when the one with the greater number has gone, the one that is left
is heard again.
"""

import logging
import threading
import time
from collections.abc import Callable

import zenoh

from messages.bus.claiming import FAR_NS, QUERY_S, Rank, rank_of, session_watch
from messages.contract.checks import Refusal
from messages.contract.door import device_of
from messages.contract.topics import (
    BY_NAME,
    CLAIMED,
    GATEWAY,
    RECORDER,
    REPLAY_SUFFIX,
    TopicError,
    claim_key,
    fence_key,
    parse,
)

log = logging.getLogger(__name__)

BYTES = 8  # of a number in an attachment
KEYS = 1 << 16  # whose numbers are remembered
CLAIMS = 1 << 16  # live ones that are remembered


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
        device, source = key.split("/")[-3:-1]
        rank, about = rank_of(key), _claimed(device, source)
        if rank is None or source not in CLAIMED:
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

    def publisher(self, device: str, source: str) -> str:
        """Id of the session that serves: of those that have claimed it the one with the greatest
        number; empty where nobody has.
        """
        with self._lock:
            return max(self._live.get(_claimed(device, source), ()), default=(0, ""))[1]

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
    """What a claim is about: a device's gateway, or a service that there is one of."""
    return f"{name}/{source}" if source == GATEWAY else source


def _fenced(key: str) -> bool:
    """Is this a key that one process publishes on? Anybody notes and logs."""
    parts = key.split("/", 3)
    topic = BY_NAME.get(parts[2]) if len(parts) > 2 else None
    return topic is not None and topic.source in CLAIMED


class Fence:
    """The numbers that a consumer has heard, key by key; may be used by several threads."""

    def __init__(self, refuse: Callable[[str, Refusal, str], None]) -> None:
        """refuse(key, why, device): count and say a message that is not taken."""
        self.refuse = refuse
        self._numbers: dict[str, int] = {}
        self.claims = Claims()

    def admit(self, key: str, attachment: "zenoh.ZBytes | None") -> bool:
        """Is this message of the newest publisher of its key? One without a number is where nobody
        has claimed the key, and one of a topic that nobody has for himself always.
        """
        if not _fenced(key):
            return True
        if attachment is None or len(attachment) != BYTES:
            return self._without_number(key)
        number = int.from_bytes(attachment.to_bytes(), "little")
        known = self._numbers.get(key, 0)
        if number == known:
            return True
        claimed = self.claims.numbers(key)
        if number < known and (number not in claimed or known in claimed):
            wanted = f"{known}, of the process that took its place"
            self.refuse(key, Refusal("stale", "publisher", str(number), wanted), device_of(key))
            return False
        if number > time.time_ns() + FAR_NS or (claimed and number not in claimed):
            wanted = f"a number that its publisher has claimed: {max(claimed, default=known)}"
            self.refuse(key, Refusal("claim", "publisher", str(number), wanted), device_of(key))
            return False
        if len(self._numbers) < KEYS or key in self._numbers:
            self._numbers[key] = number
        return True

    def _without_number(self, key: str) -> bool:
        """A replay speaks under names of its own, also where an estimator serves."""
        if device_of(key).endswith(REPLAY_SUFFIX):
            return True
        claimed = self.claims.numbers(key)
        if claimed:
            wanted = f"the number that its publisher has claimed: {max(claimed)}"
            self.refuse(key, Refusal("claim", "publisher", "none", wanted), device_of(key))
        return not claimed

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
                query.reply(fence_key(prefix, name), number.to_bytes(BYTES, "little"))

        watches = [
            session_watch(session, f"{claim_key(prefix, source, '*')}/*", self.claims.heard)
            for source in CLAIMED
        ]
        return Declared([*watches, session.declare_queryable(fence_key(prefix, "*"), on_query)])


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
        fence_key(prefix, device),
        payload=source,
        timeout=QUERY_S,
        target=zenoh.QueryTarget.ALL,
        consolidation=zenoh.ConsolidationMode.NONE,
    ):
        if reply.ok is not None:
            number = int.from_bytes(reply.ok.payload.to_bytes()[:BYTES], "little")
            found = max(found, number if number < time.time_ns() + FAR_NS else 0)
    return found
