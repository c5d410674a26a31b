"""From the bus into the store: Zenoh's threads only append, one thread of ours takes the messages in."""

import logging
import threading
import time
from collections import deque

import zenoh

from dashboard.scene.store import Store
from messages import bus as busmod
from messages import gyrofree_pb2 as pb
from messages import topics as tp

log = logging.getLogger(__name__)

# POSE and LOCATION repeat what RATE, NAV and GNSS say, for other viewers.
TOPICS = tuple(topic for topic in tp.TOPICS if topic not in (tp.POSE, tp.LOCATION))
QUEUE = 20000  # messages; about 20 s of a busy bench
BUSY_S, IDLE_S = 0.02, 0.1  # pause between rounds with and without a browser


class Feed:
    """One Zenoh session of the dashboard; `watched` is set while a browser looks. stop() ends it."""

    def __init__(self, settings: busmod.BusSettings, store: Store, watched: threading.Event) -> None:
        self._settings, self._store, self.watched = settings, store, watched
        self._queue: deque = deque(maxlen=QUEUE)
        self._stop = threading.Event()
        self._session: zenoh.Session | None = None
        self._received = self._taken = 0
        self._thread = threading.Thread(target=self._run, name="dashboard-feed", daemon=True)
        self._thread.start()

    @property
    def connected(self) -> bool:
        """True while there is a router."""
        return self._session is not None and busmod.connected(self._session)

    def recorder(self, command: pb.RecorderCommand, timeout_s: float = 5.0) -> pb.RecorderStatus:
        """Give the recorder an order and return its answer; raises ConnectionError when it does not come."""
        if self._session is None:
            raise ConnectionError("no connection to the router yet")
        replies = self._session.get(
            tp.recorder_control_key(self._settings.prefix), payload=command.SerializeToString(), timeout=timeout_s
        )
        for reply in replies:
            if reply.ok is not None:
                return pb.RecorderStatus.FromString(reply.ok.payload.to_bytes())
        raise ConnectionError("the recorder does not answer: is `gyrofree record` running?")

    def stop(self) -> None:
        """Close the session and wait for the thread."""
        self._stop.set()
        self._thread.join(timeout=5.0)

    def _run(self) -> None:
        try:
            self._session = busmod.open_client(self._settings, self._stop)
        except busmod.BusUnavailable:
            return  # stopped while waiting
        subscribers = [busmod.subscribe(self._session, t, self._settings.prefix, self._handler(t)) for t in TOPICS]
        log.info("showing %s/* from %s", self._settings.prefix, self._settings.router)
        while not self._stop.wait(BUSY_S if self.watched.is_set() else IDLE_S):
            self._drain()
        del subscribers
        self._session.close()

    def _handler(self, topic: tp.Topic):
        append = self._queue.append

        def on_message(key: str, message) -> None:
            self._received += 1
            append((topic, key, message, time.monotonic()))

        return on_message

    def _drain(self) -> None:
        for _ in range(len(self._queue)):
            topic, key, message, arrived = self._queue.popleft()
            self._taken += 1
            try:
                address = tp.parse(key)
                self._store.put(topic, address.device, address.estimator, message, arrived)
            except Exception as error:  # a foreign message must not stop the picture
                log.warning("%s: not shown (%s: %s)", key, type(error).__name__, error)
        self._store.dropped = max(0, self._received - self._taken - len(self._queue))
