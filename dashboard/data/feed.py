"""From the bus into the store: Zenoh's thread only appends, one thread of ours takes the messages
in.

Pictures want the newest, so nothing waits for a gap; what was missed is asked for and comes in
late, marked. A device that is heard for the first time is asked for its last ten minutes: at once
as an overview, then the newest in full.
"""

import logging
import threading
import time
from collections import deque
from typing import NamedTuple

import zenoh
from google.protobuf.message import Message

from dashboard.data.far import Far, Live
from dashboard.data.overview import Overviews
from dashboard.data.store import Store
from messages.bus.fencing import Fence
from messages.bus.presence import Watching
from messages.bus.session import connected
from messages.bus.turning import Loop
from messages.contract import gyrofree_pb2 as pb
from messages.contract import topics as tp
from messages.contract.checks import Refusal
from messages.history.answers import Asker
from messages.history.mending import Mender
from messages.history.mending_state import Arrival, Question, wrong_item
from messages.previews.frames import RATES, device_and_rate, unpacked
from messages.text import plain

log = logging.getLogger(__name__)

# POSE and LOCATION repeat what RATE, NAV and GNSS say, for other viewers.
UNSHOWN = (tp.POSE, tp.LOCATION, tp.HOLDER, tp.ORDER)  # the last two are heard by the desk
TOPICS = {topic.name: topic for topic in tp.TOPICS if topic not in UNSHOWN}
QUEUE = 20000  # messages; about 20 s of a busy bench
QUEUE_BYTES = 64 << 20
MESSAGE_BYTES = 128 << 10  # of one message; what waits and what is newest has to stay in memory
PAST_S = 600.0  # a device's history is asked for so far back ...
PAST_EVERY_S = 1.0  # ... with one message of each topic in this time, s
FULL_S = 60.0  # ... and in full for the last s of it
FAILURES_SHOWN = 20  # faults of ours that stand in the log with all that is known of them
BUSY_S, IDLE_S = 0.02, 0.1  # pause between rounds with and without a browser
LOOK_S = 0.1  # between two looks at who is there


class Past(NamedTuple):
    """A question about the time before we listened."""

    question: Question


class Coarse(NamedTuple):
    """An overview of what was, over a slow link."""

    device: str
    every_s: float  # between two rows
    refusal: Refusal | None


class Feed:
    """Subscriptions of the dashboard's session; `watched` is set while a browser looks. stop() ends
    them.
    """

    def __init__(
        self,
        session: zenoh.Session,
        prefix: str,
        store: Store,
        watched: threading.Event,
        past: bool = True,
        live: Live = "full",
        highest: int = RATES[0],
    ) -> None:
        """past: ask for what was before a device was heard. live, highest: see far.py."""
        self._session, self._prefix = session, prefix
        self._store, self._watched, self._past_too = store, watched, past
        self._queue: deque = deque()
        self._bytes_in = self._bytes_out = 0  # of the queue: counted each by one thread
        self._door = store.door
        self._stop = threading.Event()
        self._received = self._refused = 0
        self._next_look = 0.0
        self.taken = 0  # messages that went into the store
        self._mender = Mender(self._ask, hold=False, refuse=self._door.refuse)
        self._fence = Fence(self._door.refuse)
        self._answers: deque = deque()
        self._known: set[str] = set()  # devices whose past was asked for
        self._live: tuple[Live, int] = live, highest
        self._asker = Asker(
            session, prefix, lambda *answer: self._answers.append(answer), self._fence
        )
        self._thread = threading.Thread(target=self._run, name="dashboard-feed", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Wait for the thread; the session stays open."""
        self._stop.set()
        self._thread.join(timeout=5.0)

    def _run(self) -> None:
        self._far = Far(self._session, self._prefix, *self._live, self._on_sample)
        self._store.preview_hz = self._far.rate
        self._overviews = Overviews(self._session, self._prefix, self._on_overview)
        answering = self._fence.declare(self._session, self._prefix)
        watching = Watching(self._session, self._prefix, self._store.presence)
        log.info("showing %s/*", self._prefix)
        with Loop("feed") as loop:
            while not self._stop.wait(BUSY_S if self._watched.is_set() else IDLE_S):
                loop.turn()
                self._drain()
                self._look()
        self._far.close()
        self._overviews.close()
        watching.undeclare()
        answering.undeclare()
        self._asker.close()

    def _look(self) -> None:
        """At who is there, a few times a second, after what waited was taken in."""
        now = time.monotonic()
        if now >= self._next_look:
            self._next_look = now + LOOK_S
            self._store.presence.look(now, connected(self._session))
            before = self._far.preview
            if self._far.step(now):
                self._store.preview_hz = self._far.rate
                if before != self._far.preview:  # no gap lies between the one and the other
                    self._mender = Mender(self._ask, hold=False, refuse=self._door.refuse)

    def _on_sample(self, sample: zenoh.Sample) -> None:
        """Zenoh's thread."""
        key = str(sample.key_expr)
        if not self._fence.admit(key, sample.attachment):
            return
        self._received += 1
        size = len(sample.payload)
        if size > MESSAGE_BYTES:
            self._door.too_large(key, size, MESSAGE_BYTES)
            self._refused += 1
        elif len(self._queue) < QUEUE and self._bytes_in - self._bytes_out < QUEUE_BYTES:
            self._bytes_in += size
            self._queue.append((key, sample.payload.to_bytes(), time.monotonic()))

    def _drain(self) -> None:
        while self._answers:
            token, reply = self._answers.popleft()
            try:
                self._take_answer(token, reply)
            except Exception as error:
                self._fail("an answer", tp.RECORDER, error)
        for _ in range(len(self._queue)):
            key, payload, arrived = self._queue.popleft()
            self._bytes_out += len(payload)
            self.taken += 1
            if (framed := device_and_rate(key)) is not None:
                self._take_frame(framed[0], payload, arrived)
                continue
            address = self._door.address(key)
            if address is None or address.topic.name not in TOPICS:
                continue
            try:
                self._take(address, payload, arrived)
            except Exception as error:  # a foreign message must not stop the picture
                self._fail(key, address.device, error)
        left = self._received - self._refused - self.taken - len(self._queue)
        self._store.dropped = max(0, left)

    def _fail(self, key: str, device: str, error: Exception) -> None:
        failure = Refusal("failure", "message", type(error).__name__, "to be shown")
        self._door.refuse(key, failure, device)
        if self._door.refused["failure"] <= FAILURES_SHOWN:
            log.error("%s: not shown", plain(key), exc_info=error)

    def _take(self, address: tp.Address, payload: bytes, arrived: float) -> None:
        topic, device, estimator = address.topic, address.device, address.estimator
        if topic is tp.BEAT:
            beat = self._door.message(address, payload)
            if beat is not None:
                self._store.presence.beat(device, estimator, beat)
            return
        gone = self._store.admit(topic, device, estimator, arrived)
        if gone is None or not self._door.header(address, payload, f"{device}/{topic.name}"):
            return
        if gone:
            self._mender.forget(gone)
            self._known.discard(gone)
        for ready in self._mender.take(
            Arrival(topic, device, estimator, payload, int(arrived * 1e9))
        ):
            message = self._message(ready)
            if message is None:
                continue
            self._store.put(ready.topic, ready.device, ready.estimator, message, arrived)
            if ready.device not in self._known and ready.topic.source in (tp.GATEWAY, tp.ESTIMATES):
                self._known.add(ready.device)
                if self._past_too and not ready.device.endswith(tp.REPLAY_SUFFIX):
                    self._ask_past(ready.device, message.header.utc_ns)

    # --- over a slow link

    def _take_frame(self, device: str, payload: bytes, arrived: float) -> None:
        """Rows of a preview: they are no gap of what lies between, and nothing is asked for."""
        items, refusal = unpacked(payload, device)
        if refusal is not None:
            self._door.refuse(f"preview of {device}", refusal, device)
        if not items or not self._far.preview:
            return
        at_ns = items[0].published_ns
        self._far.came(at_ns, arrived)
        for item in items:
            name, _, estimator = item.topic.partition("/")
            topic = tp.BY_NAME[name]
            message = self._message(Arrival(topic, device, estimator, item.payload, 0))
            if message is None or self._store.admit(topic, device, estimator, arrived) is None:
                continue
            try:
                self._store.put(topic, device, estimator, message, arrived)
            except Exception as error:  # a foreign message must not stop the picture
                self._fail(f"preview of {device}", device, error)
        since_ns = self._far.cut(device, at_ns)
        if device not in self._known and self._past_too:
            since_ns = at_ns - int(PAST_S * 1e9)
        self._known.add(device)
        if since_ns:
            self._overviews.ask(device, max(since_ns, at_ns - int(PAST_S * 1e9)), at_ns)

    def _on_overview(
        self, device: str, every_s: float, items: list[pb.HistoryItem], refusal: Refusal | None
    ) -> None:
        """The overviews' thread."""
        self._answers.append((Coarse(device, every_s, refusal), pb.HistoryReply(items=items)))

    def _ask_past(self, device: str, now_ns: int) -> None:
        """The overview first, for it is quick; then the newest in full."""
        overview = pb.HistoryQuery(from_utc_ns=now_ns - int(PAST_S * 1e9), every_s=PAST_EVERY_S)
        full = pb.HistoryQuery(
            from_utc_ns=now_ns - int(FULL_S * 1e9), until_utc_ns=now_ns, max_bytes=1 << 20
        )
        for query in (overview, full):
            for source in (tp.GATEWAY, tp.ESTIMATES):
                self._ask_on(Past(Question((device, source), query)))

    def _ask_on(self, past: "Past") -> None:
        self._asker.ask(past, *past.question.stream, past.question.query)

    def _message(self, arrival: Arrival) -> Message | None:
        address = tp.Address("", arrival.device, arrival.topic, arrival.estimator)
        return self._door.message(address, arrival.payload)

    def _take_answer(
        self, token: "Question | Past | Coarse", reply: pb.HistoryReply | None
    ) -> None:
        every_s = 0.0
        if isinstance(token, Coarse):
            every_s = token.every_s
            device, repaired = token.device, False
            if token.refusal is not None:
                self._door.refuse(f"overview of {device}", token.refusal, device)
            late = [
                Arrival(tp.BY_NAME[name], device, estimator, item.payload, 0, late=True)
                for item in (reply.items if reply is not None else ())
                for name, _, estimator in [item.topic.partition("/")]
            ]
        elif isinstance(token, Question):
            late = self._mender.answer(token, reply)
            device, repaired = token.stream[0], True
        else:
            device, repaired = token.question.stream[0], False
            late = self._past(token, reply or pb.HistoryReply())
        decoded = [(a.topic, a.estimator, self._message(a)) for a in late if a.topic.name in TOPICS]
        rows = [row for row in decoded if row[2] is not None]
        self._store.put_late(device, rows, repaired, every_s)

    def _past(self, past: "Past", reply: pb.HistoryReply) -> list[Arrival]:
        """What an answer brings of the time before we listened."""
        device, found = past.question.stream[0], []
        for item in reply.items:
            refusal = wrong_item(device, item)
            if refusal is not None:
                self._door.refuse(f"answer about {device}", refusal, device)
                continue
            name, _, estimator = item.topic.partition("/")
            topic = tp.BY_NAME[name]
            found.append(
                Arrival(topic, device, estimator, item.payload, item.published_ns, late=True)
            )
        if reply.next:
            refusal = past.question.goes_on(reply)
            if refusal is None:
                self._ask_on(Past(past.question.more(reply.next, bool(found))))
            else:
                self._door.refuse(f"answer about {device}", refusal, device)
        return found

    def _ask(self, question: Question) -> None:
        self._asker.ask(question, *question.stream, question.query)
