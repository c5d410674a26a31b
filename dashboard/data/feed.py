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

import zenoh

from dashboard.data.store import Store
from messages.bus import session as busmod
from messages.bus.fencing import Fence
from messages.contract import gyrofree_pb2 as pb
from messages.contract import topics as tp
from messages.contract.door import Door
from messages.history.answers import Asker
from messages.history.mending import Mender
from messages.history.mending_state import Arrival, Question

log = logging.getLogger(__name__)

# POSE and LOCATION repeat what RATE, NAV and GNSS say, for other viewers.
TOPICS = {topic.name: topic for topic in tp.TOPICS if topic not in (tp.POSE, tp.LOCATION)}
QUEUE = 20000  # messages; about 20 s of a busy bench
PAST_S = 600.0  # a device's history is asked for so far back ...
PAST_EVERY_S = 1.0  # ... with one message of each topic in this time, s
FULL_S = 60.0  # ... and in full for the last s of it
BUSY_S, IDLE_S = 0.02, 0.1  # pause between rounds with and without a browser


class Feed:
    """Subscriptions of the dashboard's session; `watched` is set while a browser looks. stop() ends
    them.
    """

    def __init__(
        self, session: zenoh.Session, prefix: str, store: Store, watched: threading.Event
    ) -> None:
        self._session, self._prefix = session, prefix
        self._store, self._watched = store, watched
        self._queue: deque = deque(maxlen=QUEUE)
        self._stop = threading.Event()
        self._received = 0
        self.taken = 0  # messages that went into the store
        self._mender = Mender(self._ask, hold=False)
        self._fence = Fence(Door("dashboard").refuse)
        self._answers: deque = deque()
        self._known: set[str] = set()  # devices whose past was asked for
        self._asker = Asker(session, prefix, lambda *answer: self._answers.append(answer))
        self._thread = threading.Thread(target=self._run, name="dashboard-feed", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Wait for the thread; the session stays open."""
        self._stop.set()
        self._thread.join(timeout=5.0)

    def _run(self) -> None:
        subscriber = self._session.declare_subscriber(f"{self._prefix}/**", self._on_sample)
        answering = self._fence.declare(self._session, self._prefix)
        log.info("showing %s/*", self._prefix)
        while not self._stop.wait(BUSY_S if self._watched.is_set() else IDLE_S):
            self._drain()
        subscriber.undeclare()
        answering.undeclare()
        self._asker.close()

    def _on_sample(self, sample: zenoh.Sample) -> None:
        """Zenoh's thread."""
        key = str(sample.key_expr)
        if not self._fence.admit(key, sample.attachment):
            return
        self._received += 1
        self._queue.append((key, sample.payload.to_bytes(), time.monotonic()))

    def _drain(self) -> None:
        while self._answers:
            self._take_answer(*self._answers.popleft())
        for _ in range(len(self._queue)):
            key, payload, arrived = self._queue.popleft()
            self.taken += 1
            try:
                address = tp.parse(key)
                if address.topic.name in TOPICS:
                    self._take(
                        Arrival(address.topic, address.device, address.estimator, payload, 0),
                        arrived,
                    )
            except Exception as error:  # a foreign message must not stop the picture
                log.warning("%s: not shown (%s: %s)", key, type(error).__name__, error)
        self._store.dropped = max(0, self._received - self.taken - len(self._queue))

    def _take(self, arrival: Arrival, arrived: float) -> None:
        for ready in self._mender.take(arrival):
            message = busmod.decode(ready.topic, ready.payload)
            if message is None:
                continue
            self._store.put(ready.topic, ready.device, ready.estimator, message, arrived)
            if ready.device not in self._known and ready.topic.source in (tp.GATEWAY, tp.ESTIMATES):
                self._known.add(ready.device)
                if not ready.device.endswith(tp.REPLAY_SUFFIX):
                    self._ask_past(ready.device, message.header.utc_ns)

    def _ask_past(self, device: str, now_ns: int) -> None:
        """The overview first, for it is quick; then the newest in full."""
        overview = pb.HistoryQuery(from_utc_ns=now_ns - int(PAST_S * 1e9), every_s=PAST_EVERY_S)
        full = pb.HistoryQuery(
            from_utc_ns=now_ns - int(FULL_S * 1e9), until_utc_ns=now_ns, max_bytes=1 << 20
        )
        for query in (overview, full):
            for source in (tp.GATEWAY, tp.ESTIMATES):
                self._asker.ask((device, source, query), device, source, query)

    def _take_answer(self, token: tuple, reply: pb.HistoryReply | None) -> None:
        if isinstance(token, Question):
            late = self._mender.answer(token, reply)
            device, repaired = token.stream[0], True
        else:
            device, source, query = token
            repaired, late = False, []
            for item in reply.items if reply is not None else ():
                name, _, estimator = item.topic.partition("/")
                topic = TOPICS.get(name)
                if topic is not None:
                    late.append(
                        Arrival(
                            topic, device, estimator, item.payload, item.published_ns, late=True
                        )
                    )
            if reply is not None and reply.next:
                query.position = reply.next
                self._asker.ask(token, device, source, query)
        decoded = [
            (a.topic, a.estimator, busmod.decode(a.topic, a.payload))
            for a in late
            if a.topic.name in TOPICS
        ]
        self._store.put_late(device, [row for row in decoded if row[2] is not None], repaired)

    def _ask(self, question: Question) -> None:
        self._asker.ask(question, *question.stream, question.query)
