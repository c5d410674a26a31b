"""Between the bus and the file: gaps are filled before anything is written, so that a recording is
in order.

While a gap of a stream is being filled its live messages wait in memory (mending.Mender); they are
in the publisher's spool too, so a crash of the recorder loses none of them.
"""

import time
from collections import deque
from collections.abc import Callable, Iterator
from typing import NamedTuple

from messages.contract import gyrofree_pb2 as pb
from messages.contract.checks import Refusal
from messages.contract.door import Door
from messages.contract.topics import KEEPING
from messages.history.mending import Mender
from messages.history.mending_state import Arrival, Question
from sessions.recording.manifest import Manifest

REMEMBERED = 20_000  # messages; one that comes again is recognised among so many


class Entry(NamedTuple):
    """One message to be recorded."""

    log_ns: int
    key: str
    payload: bytes
    late: bool


class Intake:
    """Takes messages in the order of arrival, gives them in the order of publication."""

    def __init__(
        self,
        prefix: str,
        ask: Callable[[Question], None] | None,
        since_ns: int,
        door: Door,
        now_ns: Callable[[], int] = time.time_ns,
    ) -> None:
        """Without `ask` nothing is repaired. Runs that began after since_ns (UTC) are wanted from
        their beginning. What may not come in is refused at the `door`.
        now_ns: the clock of the receive times.
        """
        self._now_ns = now_ns
        self._prefix = prefix
        self._door = door
        self._mender = (
            None
            if ask is None
            else Mender(ask, sources=KEEPING, since_ns=since_ns, refuse=door.refuse, now_ns=now_ns)
        )
        self._newest: deque[int] = deque()  # hashes of the newest messages, and the same as a set
        self._known: set[int] = set()
        self._answers: deque[tuple[Question, pb.HistoryReply | None]] = deque()
        self._keys: dict[
            tuple[str, str, str], str
        ] = {}  # bus keys by topic, device, estimator: checked names cost
        self._last_ns: dict[
            tuple[str, str], int
        ] = {}  # by device and source: the time of recording goes on

    @property
    def asking(self) -> bool:
        """True while an answer is awaited."""
        return self._mender is not None and self._mender.asking

    @property
    def held(self) -> int:
        """Messages that wait for a gap before them to be filled."""
        return 0 if self._mender is None else self._mender.held

    def resume(self, manifest: Manifest) -> None:
        """Go on where a session ended that a crash cut off: what came in between is asked for."""
        for key, count in manifest.keys.items():
            address = self._door.address(key)
            if self._mender is not None and address is not None and count.last_sequence:
                name = (
                    f"{address.topic.name}/{address.estimator}"
                    if address.estimator
                    else address.topic.name
                )
                self._mender.seed(address.device, name, count.last_run, count.last_sequence)

    def answered(self, question: Question, reply: pb.HistoryReply | None) -> None:
        """An answer, on any thread; `answers` takes it in."""
        self._answers.append((question, reply))

    def answers(self) -> Iterator[Entry]:
        """What the answers that came bring."""
        while self._answers and self._mender is not None:
            yield from self._entries(self._mender.answer(*self._answers.popleft()))

    def take(self, received_ns: int, key: str, payload: bytes) -> Iterator[Entry]:
        """One message from the bus."""
        address = self._door.address(key)
        if address is None or not address.topic.recorded:
            return
        if not self._door.admit(key, address, len(payload)):
            return
        if not self._door.header(address, payload, key):
            return
        if self._mender is None:
            yield Entry(received_ns, key, payload, False)
            return
        arrival = Arrival(address.topic, address.device, address.estimator, payload, received_ns)
        yield from self._entries(self._mender.take(arrival))

    def release(self) -> Iterator[Entry]:
        """What is still held, gaps and all."""
        if self._mender is not None:
            yield from self._entries(self._mender.release())

    def _entries(self, arrivals: list[Arrival]) -> Iterator[Entry]:
        for arrival in arrivals:
            stream = arrival.device, arrival.topic.source
            at_ns = arrival.at_ns
            if arrival.late:  # the publisher's clock may differ from ours; the order must not
                at_ns = min(at_ns, self._now_ns())
            at_ns = self._last_ns[stream] = max(at_ns, self._last_ns.get(stream, 0))
            name = arrival.topic.name, arrival.device, arrival.estimator
            key = self._keys.get(name)
            if key is None:
                key = self._keys[name] = arrival.topic.key(
                    self._prefix, arrival.device, arrival.estimator
                )
            if self._new(key, arrival):
                yield Entry(at_ns, key, arrival.payload, arrival.late)

    def _new(self, key: str, arrival: Arrival) -> bool:
        """Has this very message not come lately?"""
        mark = hash((key, arrival.payload))
        if mark in self._known:
            why = Refusal("repeated", "message", "the same, byte for byte", "each message once")
            self._door.refuse(key, why, arrival.device)
            return False
        self._known.add(mark)
        self._newest.append(mark)
        if len(self._newest) > REMEMBERED:
            self._known.discard(self._newest.popleft())
        return True
