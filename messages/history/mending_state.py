"""What is known of each stream while it is mended: what came, what is missing, what was asked."""

import logging
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

from google.protobuf.message import DecodeError

from messages.contract import gyrofree_pb2 as pb
from messages.contract.checks import Refusal, check
from messages.contract.door import wrong_header
from messages.contract.header import first_field
from messages.contract.topics import BY_NAME, NAME, Topic

log = logging.getLogger(__name__)

MOST_REPLIES = 10_000  # of one answer; a reply has about a MB
MOST_IDLE = 64  # of those in a row: what is missing of one topic has others around it
CLOCKS_NS = 5_000_000_000  # two clocks that are set by one another differ by less
SPLIT_NS = 2_000_000_000  # two that were heard at once by less are one after the other
FARTHEST = 10_000_000  # messages; a sequence that jumps further has begun anew: a day at 100 Hz


class Arrival(NamedTuple):
    """One message: live as it came, or filled in."""

    topic: Topic
    device: str
    estimator: str
    payload: bytes
    at_ns: int  # when it came, or, filled in, when it was published; UTC
    late: bool = False

    @property
    def name(self) -> str:
        """Topic with its estimator."""
        return f"{self.topic.name}/{self.estimator}" if self.estimator else self.topic.name


class Question(NamedTuple):
    """What to ask the publisher of a stream."""

    stream: tuple[str, str]  # device, source
    query: pb.HistoryQuery
    replies: int = 0  # parts of the answer that have come
    idle: int = 0  # of those in a row that brought nothing

    @property
    def about(self) -> str:
        """What a refusal of its answer names."""
        return f"answer about {'/'.join(self.stream)}"

    def goes_on(self, reply: pb.HistoryReply) -> Refusal | None:
        """Why a reply that says there is more is not asked for more: each part must have
        something and get ahead, some must bring something, and an answer has an end.
        """
        if not reply.items:
            return Refusal("answer", "next", str(reply.next), "0 where a reply brings nothing")
        if reply.next <= self.query.position:
            wanted = f"more than {self.query.position}"
            return Refusal("answer", "next", str(reply.next), wanted)
        if self.idle >= MOST_IDLE:
            wanted = f"an end after {MOST_IDLE} parts that brought nothing"
            return Refusal("answer", "next", str(reply.next), wanted)
        if self.replies >= MOST_REPLIES:
            return Refusal("answer", "next", str(reply.next), f"an end after {MOST_REPLIES}")
        return None

    def more(self, position: int, brought: bool = True) -> "Question":
        """The question for the next part, after one that brought something or not."""
        query = pb.HistoryQuery()
        query.CopyFrom(self.query)
        query.position = position
        idle = 0 if brought else self.idle + 1
        return Question(self.stream, query, self.replies + 1, idle)


@dataclass
class KeyState:
    """What is known of one topic of a stream."""

    run: int
    last: int
    missing: list[list[int]] = field(
        default_factory=list
    )  # [run, first, last, countable], being asked for
    filled: tuple[int, int] = (1, 0)  # sequences that came filled in before they came live
    repaired: int = 0
    lost: int = 0

    def advance(self, run: int, sequence: int) -> None:
        """A filled-in message is the newest now."""
        follows = run == self.run and self.filled[1] == self.last
        self.filled = (self.filled[0] if follows else sequence, sequence)
        self.run, self.last = run, sequence

    def overtaken(self, item: pb.HistoryItem) -> Refusal:
        """A filled-in message that comes behind what was given on already."""
        wanted = f"what comes behind {self.run}, {self.last}"
        return Refusal("stale", "message", f"{item.run}, {item.sequence}", wanted)

    def give_up(self) -> int:
        """What is missing will not come; how many messages that are."""
        lost = sum(max(0, last - first + 1) * count for _, first, last, count in self.missing)
        known = ((run, last) for run, _, last, _ in self.missing if last < 1 << 62)
        self.run, self.last = max((self.run, self.last), *known, (0, 0))
        self.lost += lost
        self.missing.clear()
        return lost


@dataclass
class Heard:
    """What came, live, of one run."""

    run: int = 0
    at_ns: int = 0  # when the newest came
    newest_ns: int = 0  # the latest of their own times

    def take(self, header: pb.Header, at_ns: int) -> None:
        """One more."""
        self.at_ns, self.newest_ns = at_ns, max(self.newest_ns, header.utc_ns)


@dataclass
class Stream:
    asking: bool = False
    full: bool = False  # holds max_held: the newest were not taken
    held: deque[Arrival] = field(default_factory=deque)
    held_bytes: int = 0
    waiting: deque[pb.HistoryQuery] = field(default_factory=deque)
    tried: set[tuple[str, int, int]] = field(default_factory=set)  # beginnings that were asked for
    live: Heard = field(default_factory=Heard)  # the newest run that is heard, live ...
    before: Heard = field(default_factory=Heard)  # ... and the one before it
    taken: tuple[int, int] = (0, 0)  # a run, and the time up to which another was heard beside it

    def heard(self, header: pb.Header, at_ns: int) -> None:
        """A live message came at at_ns (0: nobody says when). Of two publishers of one name, each
        heard while the link between them was cut, the time of the one that was heard is taken:
        the other has spoken for longer than the one has been silent.
        """
        if not at_ns or not header.run or header.run < self.live.run:
            return
        if header.run > self.live.run:
            self.before, self.live = self.live, Heard(header.run)
        self.live.take(header, at_ns)
        spoken_ns, silent_ns = header.utc_ns - header.run, at_ns - self.before.at_ns
        beside_ns = self.before.newest_ns - header.run
        if self.before.run and min(spoken_ns - silent_ns, beside_ns) > SPLIT_NS:
            self.taken = header.run, self.before.newest_ns

    def twin(self, header: pb.Header | None) -> Refusal | None:
        """Why a message that is filled in is not taken: it is of a time when another publisher of
        that name was heard.
        """
        if header is None or header.run != self.taken[0] or header.utc_ns >= self.taken[1]:
            return None
        wanted = "a time in which no other publisher of this name was heard"
        return Refusal("twin", "header.utc_ns", str(header.utc_ns), wanted)

    def hold(self, arrival: Arrival, most: int, most_bytes: int) -> bool:
        """Keep a live message until a gap is filled; False: there is no room."""
        if len(self.held) >= most or self.held_bytes + len(arrival.payload) > most_bytes:
            return False
        self.held.append(arrival)
        self.held_bytes += len(arrival.payload)
        return True

    def hold_first(self, arrival: Arrival) -> None:
        """Keep one that comes before all that are held."""
        self.held.appendleft(arrival)
        self.held_bytes += len(arrival.payload)

    def let_go(self) -> Arrival:
        """The oldest that is held."""
        arrival = self.held.popleft()
        self.held_bytes -= len(arrival.payload)
        return arrival


def wrong_item(device: str, item: pb.HistoryItem) -> Refusal | None:
    """What is wrong with one message of an answer about a device; None when nothing is."""
    wrong = check(item)
    if wrong:
        return wrong[0]
    name, _, estimator = item.topic.partition("/")
    topic = BY_NAME.get(name)
    if topic is None or topic.per_estimator != (NAME.fullmatch(estimator) is not None):
        return Refusal("answer", "topic", repr(item.topic[:80]), "one of docs/topics.md")
    refusal = wrong_header(topic, item.payload, device)
    if refusal is not None:
        return refusal
    header = header_of(Arrival(topic, device, estimator, item.payload, 0))
    if header is not None and (header.run, header.sequence) != (item.run, item.sequence):
        found = f"{header.run}, {header.sequence}"
        return Refusal("answer", "payload", found, f"{item.run}, {item.sequence}")
    return None


def wanted_whole(header: pb.Header, since_ns: int, now_ns: Callable[[], int] | None = None) -> bool:
    """Is a run that is heard for the first time wanted from its beginning? It began after since_ns
    (0: none is), and by its publisher's own clock no longer ago than that.
    """
    if not (0 < since_ns < header.run and 1 < header.sequence <= FARTHEST):
        return False
    age_ns = header.utc_ns - header.run
    return now_ns is None or age_ns <= now_ns() - since_ns + CLOCKS_NS


def take_out(missing: list[list[int]], gap: list[int], sequence: int) -> None:
    """One message of a gap has come: what is left of it before and behind."""
    run, first, last, countable = gap
    missing.remove(gap)
    if first < sequence:  # a run's own first numbers may never have been
        missing.append([run, first, sequence - 1, int(countable or first > 1)])
    if sequence < last:
        missing.append([run, sequence + 1, last, countable])


def header_of(arrival: Arrival) -> pb.Header | None:
    """The header of a message, the only part that is parsed; None for types without one and for
    damaged bytes.
    """
    if "header" not in arrival.topic.type.DESCRIPTOR.fields_by_name:
        return None
    try:
        return pb.Header.FromString(first_field(arrival.payload))
    except (DecodeError, ValueError):
        return None


def say(key: str, refusal: Refusal, device: str) -> None:
    """A refusal, where nobody counts them."""
    log.warning("%s: refused: %s", key, refusal)
