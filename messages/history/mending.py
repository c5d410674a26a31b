"""Gaps of the bus, noticed by jumps of header.sequence, and filled with what the publisher kept.

A Mender stands between a subscriber and its consumer. It takes messages as they arrive and gives
them on in the order of publication, with the missing ones in their place; they come from the
publisher's spool (spool.py). It has no thread, no clock and no bus: questions go out through `ask`,
answers come back through `answer`, so that recorder, estimator and dashboard use it on their own
threads, and a test without any.

Messages belong together by device and publishing process (a "stream"): one question about a stream
fills the gaps of all its topics, in the right order among them. With `hold`, live messages of a
stream wait while one of its gaps is being filled, at most `max_held` of them; newer ones are as if
lost, and asked for later. Without, they pass at once and the filled ones come late.
"""

import logging
from collections import deque
from collections.abc import Callable

from messages.contract import gyrofree_pb2 as pb
from messages.contract.checks import Refusal
from messages.contract.topics import BY_NAME, REPLAY_SUFFIX, Topic
from messages.history.mending_state import (
    FARTHEST,
    MOST_REPLIES,
    Arrival,
    KeyState,
    Question,
    Stream,
    header_of,
    say,
    take_out,
    wanted_whole,
    wrong_item,
)

log = logging.getLogger(__name__)

MAX_HELD = 60_000
MAX_HELD_BYTES = 128 << 20  # of one stream
MOST_WAITING = 1000  # questions of a stream, gaps of a topic
REMEMBERED = 4096  # payloads without a header: the newest are recognised when they come again


class Mender:
    """See the module. `ask(question)` must not block; `sources` are the processes that have a
    spool.
    """

    def __init__(
        self,
        ask: Callable[[Question], None],
        *,
        hold: bool = True,
        max_held: int = MAX_HELD,
        topics: tuple[Topic, ...] = (),
        sources: tuple[str, ...] = ("gateway", "estimator"),
        since_ns: int = 0,
        refuse: Callable[[str, Refusal, str], None] | None = None,
        now_ns: Callable[[], int] | None = None,
    ) -> None:
        """`topics` limits what is asked for; none: everything. A run that began after `since_ns` is
        wanted whole, `now_ns()` is its clock. `refuse(key, why, device)` is told what is not taken.
        """
        self._refuse, self._now_ns = refuse or say, now_ns
        self._ask, self._hold, self._max_held = ask, hold, max_held
        self._topics, self._sources, self._since_ns = topics, sources, since_ns
        self._keys: dict[tuple[str, str], KeyState] = {}
        self._streams: dict[tuple[str, str], Stream] = {}
        self._seen: deque[int] = deque(maxlen=REMEMBERED)  # hashes of payloads without a header

    @property
    def held(self) -> int:
        """Live messages that wait for a gap to be filled."""
        return sum(len(stream.held) for stream in self._streams.values())

    @property
    def asking(self) -> bool:
        """True while an answer is awaited."""
        return any(stream.asking for stream in self._streams.values())

    def counts(self) -> dict[str, tuple[int, int]]:
        """Repaired and finally lost messages by "<device>/<topic>", where there are any."""
        return {
            f"{device}/{name}": (key.repaired, key.lost)
            for (device, name), key in self._keys.items()
            if key.repaired or key.lost
        }

    def seed(self, device: str, name: str, run: int, last: int) -> None:
        """The consumer has everything of this topic up to here, from an earlier life."""
        self._keys[device, name] = KeyState(run, last)

    def forget(self, device: str) -> None:
        """A device is gone; what waits for it is let go."""
        for table in (self._keys, self._streams):
            for name in [name for name in table if name[0] == device]:
                del table[name]

    def taken(self) -> dict[tuple[str, str], tuple[int, int]]:
        """Run and sequence of the newest message given on, by device and topic: for `seed` in a
        later life.
        """
        return {name: (key.run, key.last) for name, key in self._keys.items()}

    def take(self, arrival: Arrival) -> list[Arrival]:
        """One live message; what can be given on now, in order."""
        if arrival.topic.source not in self._sources or arrival.device.endswith(REPLAY_SUFFIX):
            return [arrival]
        stream = self._streams.setdefault((arrival.device, arrival.topic.source), Stream())
        header = header_of(arrival)
        if header is not None:
            stream.heard(header, arrival.at_ns)
        if self._hold and stream.asking:
            if stream.hold(arrival, self._max_held, MAX_HELD_BYTES):
                return []
            if not stream.full:
                log.warning(
                    "%s: %d messages wait; newer ones are asked for later",
                    arrival.device,
                    len(stream.held),
                )
            stream.full = True
            return []
        return self._pass(stream, arrival)

    def answer(self, question: Question, reply: pb.HistoryReply | None) -> list[Arrival]:
        """The publisher's answer (None: there is none); what can be given on now, in order."""
        stream = self._streams.setdefault(question.stream, Stream())
        out: list[Arrival] = []
        for item in reply.items if reply is not None else ():
            refusal = wrong_item(question.stream[0], item)
            if refusal is not None:
                self._refuse(question.about, refusal, question.stream[0])
                continue
            skipped = self._skipped(stream, question, item)
            if skipped is not None:
                self._ask(skipped)
                return out
            out += self._fill(stream, question.stream[0], item)
        if reply is not None and reply.next:
            refusal = question.goes_on(reply)
            if refusal is None:
                self._ask(question.more(reply.next, bool(out)))
                return out
            self._refuse(question.about, refusal, question.stream[0])
        if stream.waiting:
            self._ask(Question(question.stream, stream.waiting.popleft()))
            return out
        self._give_up(question.stream, answered=reply is not None)
        stream.asking = stream.full = False
        stream.tried.clear()
        while stream.held and not stream.asking:
            out += self._pass(stream, stream.let_go())
        return out

    def release(self) -> list[Arrival]:
        """All that is held, without waiting: the end."""
        return [arrival for stream in self._streams.values() for arrival in self._release(stream)]

    # --- one message

    def _pass(self, stream: Stream, arrival: Arrival) -> list[Arrival]:
        header = header_of(arrival)
        if header is None:
            return [] if self._known(arrival.payload) else [arrival]
        key = self._keys.get((arrival.device, arrival.name))
        if key is None:
            key = self._keys[arrival.device, arrival.name] = KeyState(header.run, header.sequence)
            if not wanted_whole(header, self._since_ns, self._now_ns):
                return [arrival]
            key.last = 0
        if header.run == key.run and header.sequence == key.last + 1:
            key.last += 1
            return [arrival]
        if header.run == key.run and header.sequence <= key.last:
            if key.filled[0] <= header.sequence <= key.filled[1]:
                return []  # it was filled in already
            key.last = header.sequence  # a publisher without a spool began anew, or repeats itself
            return [arrival]
        if header.run > key.run and header.sequence == key.last + 1:  # the same estimator counts on
            key.run, key.last = header.run, header.sequence
            return [arrival]
        if header.run < key.run:
            key.run, key.last = (
                header.run,
                header.sequence,
            )  # another recording, or a clock set back
            return [arrival]
        if header.sequence > FARTHEST + (key.last if header.run == key.run else 0):
            key.run, key.last = header.run, header.sequence  # that is no gap: it began anew
            return [arrival]
        if self._notice(stream, arrival, key, header) and self._hold:
            stream.hold_first(arrival)
            return []
        key.run, key.last = header.run, header.sequence
        return [arrival]

    def _notice(self, stream: Stream, arrival: Arrival, key: KeyState, header: pb.Header) -> bool:
        """A gap lies before this message: ask for what is in it. False: there are too many."""
        query = pb.HistoryQuery(
            topics=self._wanted(arrival),
            of=arrival.name,
            after_run=key.run,
            after_sequence=key.last,
            until_run=header.run,
            until_sequence=header.sequence,
        )
        if len(stream.waiting) >= MOST_WAITING or len(key.missing) >= MOST_WAITING:
            missed = header.sequence - key.last - 1 if header.run == key.run else 0
            key.lost += missed  # a publisher that jumps all the time is not asked all the time
            return False
        if header.run == key.run:
            key.missing.append([key.run, key.last + 1, header.sequence - 1, 1])
        # how many there were at the end of the one run, and where the other began to count, only
        # the answer says
        else:
            key.missing.append([key.run, key.last + 1, 1 << 62, 0])
            key.missing.append([header.run, 1, header.sequence - 1, 0])
        if stream.asking:
            stream.waiting.append(query)
        else:
            stream.asking = True
            self._ask(Question((arrival.device, arrival.topic.source), query))
        return True

    def _wanted(self, arrival: Arrival) -> list[str]:
        if not self._topics:
            return []
        return [
            t.name for t in self._topics if t.source == arrival.topic.source and not t.per_estimator
        ]

    def _skipped(self, stream: Stream, question: Question, item: pb.HistoryItem) -> Question | None:
        """Another topic had lost some before this question's beginning: what to ask instead, from
        there on.
        """
        key = self._keys.get((question.stream[0], item.topic))
        if key is None or item.run < key.run or item.sequence == key.last + 1:
            return None
        if (item.run == key.run and item.sequence <= key.last) or any(
            gap[0] == key.run and gap[1] <= gap[2] for gap in key.missing
        ):
            return None
        begin = item.topic, key.run, key.last
        if begin in stream.tried or question.replies >= MOST_REPLIES:
            return None  # it is gone
        stream.tried.add(begin)
        query = pb.HistoryQuery()
        query.CopyFrom(question.query)
        query.until_of, query.position = query.until_of or query.of, 0
        query.of, query.after_run, query.after_sequence = begin
        return Question(question.stream, query, question.replies + 1)

    def _fill(self, stream: Stream, device: str, item: pb.HistoryItem) -> list[Arrival]:
        name, _, estimator = item.topic.partition("/")
        topic = BY_NAME.get(name)
        if topic is None:
            return []
        arrival = Arrival(topic, device, estimator, item.payload, item.published_ns, late=True)
        if not item.run:
            return [] if self._known(item.payload) else [arrival]
        key = self._keys.get((device, item.topic))
        if key is None:
            return []  # never heard live: not this consumer's gap
        twin = stream.twin(header_of(arrival))
        if twin is not None:
            self._refuse(f"{device}/{item.topic}", twin, device)
            return []
        for gap in key.missing:
            if gap[0] == item.run and gap[1] <= item.sequence <= gap[2]:
                if self._hold and (item.run, item.sequence) < (key.run, key.last):
                    # a second publisher's answer came after one that goes on behind this
                    self._refuse(f"{device}/{item.topic}", key.overtaken(item), device)
                    return []
                take_out(key.missing, gap, item.sequence)
                key.repaired += 1
                if (item.run, item.sequence) > (key.run, key.last):
                    key.advance(item.run, item.sequence)
                return [arrival]
        if (item.run, item.sequence) <= (key.run, key.last):
            return []
        if item.sequence > FARTHEST + (key.last if item.run == key.run else 0):
            return []
        key.lost += item.sequence - key.last - 1 if item.run == key.run else 0
        key.advance(item.run, item.sequence)
        key.repaired += 1
        return [arrival]

    def _give_up(self, stream: tuple[str, str], answered: bool) -> None:
        """What the answers have not brought is lost."""
        why = "their publisher has them no more" if answered else "nobody answered for them"
        for (device, name), key in self._keys.items():
            if (
                device == stream[0]
                and BY_NAME[name.partition("/")[0]].source == stream[1]
                and key.missing
            ):
                lost = key.give_up()
                if lost:
                    log.warning("%s/%s: %d messages are lost: %s", device, name, lost, why)

    def _release(self, stream: Stream) -> list[Arrival]:
        """Let go what is held, gaps and all."""
        out, held = [], list(stream.held)
        stream.held.clear()
        stream.held_bytes = 0
        stream.asking = False
        stream.waiting.clear()
        for arrival in held:
            header = header_of(arrival)
            key = self._keys.get((arrival.device, arrival.name))
            if header is not None and key is not None:
                if (header.run, header.sequence) <= (key.run, key.last):
                    continue
                key.lost += header.sequence - key.last - 1 if header.run == key.run else 0
                key.run, key.last = header.run, header.sequence
                key.missing.clear()
            out.append(arrival)
        return out

    def _known(self, payload: bytes) -> bool:
        mark = hash(payload)
        if mark in self._seen:
            return True
        self._seen.append(mark)
        return False
