"""What is known of each stream while it is mended: what came, what is missing, what was asked."""

from collections import deque
from dataclasses import dataclass, field
from typing import NamedTuple

from google.protobuf.message import DecodeError

from messages.contract import gyrofree_pb2 as pb
from messages.contract.header import first_field
from messages.contract.topics import Topic


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


@dataclass
class Stream:
    asking: bool = False
    full: bool = False  # holds max_held: the newest were not taken
    held: deque[Arrival] = field(default_factory=deque)
    waiting: deque[pb.HistoryQuery] = field(default_factory=deque)
    tried: set[tuple[str, int, int]] = field(default_factory=set)  # beginnings that were asked for


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
