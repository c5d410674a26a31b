"""The recorder: everything recorded that crosses the bus, byte for byte, and nothing lost that the
disk has taken.

Zenoh's thread only appends to a deque; one thread writes, the store's own thread syncs. Orders come
over the bus (messages/bus/orders.py): a RecorderCommand in, a RecorderStatus out.
"""

import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable

import zenoh

from messages import text
from messages.bus import orders
from messages.bus.fencing import Fence
from messages.bus.session import BusSettings
from messages.bus.turning import Loop
from messages.contract import gyrofree_pb2 as pb
from messages.contract.checks import MESSAGE_BYTES, Refusal
from messages.contract.door import Door, device_of
from messages.contract.topics import RECORDER
from messages.history.mending_state import Question
from messages.text import plain
from sessions.library.annotations import give_title
from sessions.recording.intake import Entry, Intake
from sessions.recording.keys import largest
from sessions.recording.manifest import Manifest, SessionError, name_fault, slug
from sessions.recording.session_clock import SessionClock
from sessions.recording.settings import RecorderSettings
from sessions.recording.store import SessionStore, start

log = logging.getLogger(__name__)

DRAIN_S = 0.1  # a message waits at most this long before it is in the running chunk
REPAIR_S = 2.0  # the end of a session waits so long for gaps that are being filled
BEGIN_S, END_S = 15.0, 60.0  # that beginning and closing a session may take on a slow disk
RETRY_S = 5.0  # an automatic start that the disk refused is tried again after this

Order = orders.Order[pb.RecorderCommand, pb.RecorderStatus]


class Recorder:
    """The recorder without its loop: `on_sample` and `on_order` are for Zenoh's threads, the rest
    for one thread.
    """

    def __init__(
        self,
        settings: RecorderSettings,
        bus: BusSettings,
        configuration: dict[str, object] | None = None,
        ask: Callable[[Question], None] | None = None,
    ) -> None:
        """`ask` puts a question to a publisher; its answer comes back through `on_answer`. None:
        gaps stay.
        """
        self.settings = settings
        self.bus = bus
        self.wake, self.loop = threading.Event(), Loop("recorder")
        self._configuration = configuration
        self._inbox: deque[tuple[int, str, bytes]] = deque()
        self._orders: deque[Order] = deque()
        self._ask = ask
        self._fresh, self._life = True, time.time_ns()
        self._clock = SessionClock()
        self._bytes_in = self._bytes_out = 0  # of the inbox: counted each by one thread
        self._door = Door("recorder", most_devices=self.settings.max_devices)
        self.fence = Fence(lambda *refusal: self._door.refuse(*refusal))
        self._intake = Intake(bus.prefix, None, 0, self._door)
        self._overflow = 0
        self._store: SessionStore | None = None
        self._recording = False  # read by Zenoh's thread
        self._last_flush = 0.0
        self._message = ""  # of the last start or stop that did not work
        self._retry_at: float | None = 0.0 if settings.auto_start else None
        self._last = pb.RecorderStatus()  # of the last session, for the time after it

    @property
    def recording(self) -> bool:
        """Is there a session?"""
        return self._store is not None

    def on_sample(self, sample: zenoh.Sample) -> None:
        """Zenoh's thread: note the receive time and leave."""
        key = str(sample.key_expr)
        if not self.fence.admit(key, sample.attachment) or not self._recording:
            return
        size, waiting = len(sample.payload), self._bytes_in - self._bytes_out
        if size > MESSAGE_BYTES:
            self._door.too_large(key, size)
            return
        room = self.settings.max_inbox_bytes - waiting
        if len(self._inbox) >= self.settings.max_inbox or size > room:
            self._overflow += 1
            return
        self._bytes_in += size
        self._inbox.append((self._clock.now_ns(), key, sample.payload.to_bytes()))

    def on_order(self, order: Order) -> None:
        """Zenoh's thread: keep the order for the loop."""
        self._orders.append(order)
        self.wake.set()

    def on_answer(self, question: object, reply: pb.HistoryReply | None) -> None:
        """The asker's thread: what a publisher kept."""
        self._intake.answered(question, reply)
        self.wake.set()

    def listen(self) -> None:
        """Keep what comes from now on for the session that begins in a moment."""
        self._recording = True

    def resume(self, manifest: Manifest) -> None:
        """Begin a session where the one of `manifest` was cut off; what came since is asked of the
        publishers.
        """
        log.info("going on where %s was cut off", manifest.id)
        if self._begin(
            name=manifest.id[16:48], note=manifest.note, user=manifest.user, continues=manifest.id
        ):
            self._intake.resume(manifest)

    def take_over(self, session: str) -> None:
        """Begin a session where another recorder, which is gone, was recording that one."""
        log.info("going on where %s ended: its recorder is gone", plain(session))
        self._begin(name=slug(session[16:48]), continues=plain(session))

    def step(self) -> None:
        """Write what came in, answer orders, close a chunk when it is time."""
        self.wake.clear()
        self._clock.look(self._store.manifest if self._store is not None else None)
        self._auto_start()
        self._drain()
        while self._orders:
            self._answer(self._orders.popleft())
        store, now = self._store, time.monotonic()
        if store is not None and now - self._last_flush >= self.settings.flush_s:
            self._last_flush = now
            store.flush()
            if store.astray or store.size >= self.settings.max_file_bytes:
                self._rotate(store)
                self._message = self._message or store.astray

    def _drain(self) -> None:
        store, inbox = self._store, self._inbox
        if store is None:
            return
        intake = self._intake
        self._add(store, "an answer", intake.answers())
        for _ in range(len(inbox)):  # what comes in meanwhile waits for the next step
            received_ns, key, payload = inbox.popleft()
            self._bytes_out += len(payload)
            self._add(store, key, intake.take(received_ns, key, payload))
        store.manifest.refused = self._door.by_device()
        store.manifest.unknown = self._door.refused["key"]
        if self._overflow:
            said = "%s: %d messages came faster than they can be written"
            log.error(said, store.manifest.id, self._overflow)
            store.manifest.overflow += self._overflow
            self._overflow = 0

    def _add(self, store: SessionStore, key: str, entries: Iterable[Entry]) -> None:
        """Write what is ready. A fault of ours costs a message and is counted, not the session."""
        try:
            for entry in entries:
                store.add(*entry)
        except Exception as error:
            log.exception("%s: a message could not be recorded", plain(key))
            failure = Refusal("failure", "message", type(error).__name__, "to be recorded")
            self._door.refuse(key, failure, device_of(key))

    def _auto_start(self) -> None:
        due = self._retry_at is not None and time.monotonic() >= self._retry_at
        if self._store is None and due:
            self._begin(name=self.settings.name)

    def _begin(
        self, *, name: str = "", note: str = "", user: str = "", continues: str = ""
    ) -> bool:
        """Start a session; on refusal say why in the status and, with auto_start, try again
        later.
        """
        if self._fresh and not self._inbox:
            self._clock.begin()
        try:
            with self.loop.during("beginning a session", BEGIN_S):
                store = start(
                    self.settings,
                    self._clock.now_ns(),
                    name=name,
                    note=note,
                    user=user,
                    continues=continues,
                    configuration=self._configuration,
                )
        except OSError as error:
            text = (
                f"{self.settings.root}: cannot record: {error.strerror}; "
                "want a folder with room that this user may write ([recorder] root)"
            )
            if text != self._message:
                log.error("%s", text)
            self._message = text
            self._retry_at = time.monotonic() + RETRY_S if self.settings.auto_start else None
            return False
        self._message, self._retry_at = "", None
        if self._fresh:  # a file that only goes on keeps what is known of the streams
            self._door = Door("recorder", most_devices=self.settings.max_devices)
            self._intake = Intake(
                self.bus.prefix,
                self._ask,
                store.manifest.start_utc_ns,
                self._door,
                self._clock.now_ns,
            )
        self._fresh = True
        self._store, self._recording = store, True
        self._last_flush = time.monotonic()
        log.info("recording %s", store.folder)
        return True

    def _rotate(self, store: SessionStore) -> None:
        was = store.manifest
        log.info("%s: %d bytes: continuing in a new session", was.id, store.size)
        self._end(keep_listening=True)
        self._fresh = False
        if not self._begin(name=was.id[16:48], note=was.note, user=was.user, continues=was.id):
            self._retry_at = time.monotonic() + RETRY_S

    def _end(self, *, keep_listening: bool = False) -> None:
        store = self._store
        if store is None:
            return
        self._recording = keep_listening
        self._drain()
        with self.loop.during("closing a session", END_S):
            if not keep_listening:
                self._finish_repairs(store)
            closed = store.close()
        self._last = self._describe(store)
        self._store = None
        self._message = "" if closed else store.error
        how = "closed" if closed else "left open"
        log.info("%s: %s, %d messages", store.manifest.id, how, store.messages)

    def _finish_repairs(self, store: SessionStore) -> None:
        """Wait a little for answers that are under way; then what is held is written with its
        gaps.
        """
        end = time.monotonic() + REPAIR_S
        while self._intake.asking and time.monotonic() < end:
            time.sleep(0.01)
            self._drain()
        for entry in self._intake.release():
            store.add(*entry)

    def close(self) -> None:
        """End the running session and refuse orders that still wait."""
        self._end()
        while self._orders:
            self._orders.popleft().refuse("it is stopping")

    def _answer(self, order: Order) -> None:
        refusal = self._obey(order.command)
        status = self.status()
        if refusal:
            status.message = refusal
        order.answer(status)

    def _obey(self, command: pb.RecorderCommand) -> str:
        """Do what a command says; the reason when it is refused, else nothing."""
        if command.action == pb.RecorderCommand.ACTION_START:
            if self._store is not None:
                return f"already recording {self._store.manifest.id}: stop it first"
            if fault := name_fault(command.name):
                return fault
            if fault := text.check(command.note, lines=True) or text.check(command.user):
                return f"note or user: {fault}"
            log.info("start ordered by %s", command.user or "an unnamed user")
            if not self._begin(name=slug(command.name), note=command.note, user=command.user):
                return self._message
            self._keep_title(command.name)
            return ""
        if command.action == pb.RecorderCommand.ACTION_STOP:
            if self._store is None:
                return "not recording: nothing to stop"
            log.info("stop ordered by %s", command.user or "an unnamed user")
            self._retry_at = None
            self._end()
            return self._message
        return ""

    def _keep_title(self, name: str) -> None:
        if self._store is not None:
            try:
                give_title(self._store.folder, name)
            except (SessionError, OSError) as error:
                log.warning("%s: its title is not kept: %s", self._store.folder, error)

    def status(self) -> pb.RecorderStatus:
        """The state of now."""
        status = pb.RecorderStatus()
        status.CopyFrom(self._describe(self._store) if self._store else self._last)
        status.recording = self.recording
        status.header.device, status.header.run = RECORDER, self._life
        status.header.utc_ns = self._clock.now_ns()
        status.message = (self._store.error if self._store else "") or self._message
        if self._store is not None:
            steps = self._store.manifest.clock_steps
            status.clock_steps, status.clock_offset_s = len(steps), sum(s.step_s for s in steps)
        return status

    def _describe(self, store: SessionStore) -> pb.RecorderStatus:
        return pb.RecorderStatus(
            session=store.manifest.id,
            continues=store.manifest.continues,
            seconds=store.seconds,
            messages=store.messages,
            bytes=store.size,
            durable_messages=store.durable_messages,
            lost=largest(store.lost()),
            repaired=largest(store.repaired()),
            repairing=self._intake.held,
            refused=self._door.counts(),
        )
