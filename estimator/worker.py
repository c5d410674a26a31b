"""The pipeline on a thread: bus callbacks append, it takes all in order of publication.

Gaps of a device's inputs are filled from what its gateway kept (messages/history/mending.py) before
the pipeline sees what came after them. Orders of people are done between two samples.
"""

import logging
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

from estimator.convert.samples import BadMessage
from estimator.inbox import Inbox
from estimator.output import Output
from estimator.overload import Overload
from estimator.pipeline import Pipeline
from estimator.stream import worth_a_line
from messages.bus import orders
from messages.bus.turning import Loop
from messages.clock import elapsed_ns
from messages.contract import gyrofree_pb2 as pb
from messages.contract.checks import Refusal
from messages.contract.door import Door
from messages.contract.topics import ACCEL, ADC, ESTIMATOR, IMU, PIPELINE_INPUTS, Address
from messages.history.mending import Mender
from messages.history.mending_state import Arrival, Question

log = logging.getLogger(__name__)

# messages; more than a minute of a full-rate board, then the newest are dropped and asked for again
BACKLOG = 20_000
BACKLOG_BYTES = 256 << 20
FAILURES_SHOWN = 20  # faults of ours that stand in the log with all that is known of them
SAVE_S, SAVE_SHARE = 2.0, 0.05  # so often, and at most this share of the time: many boards are much
KEEP_S, ORDER_S = (
    15.0,
    120.0,
)  # that keeping the state, and an order, may take: a calibration is long
SAMPLES = (ACCEL, IMU, ADC)  # inputs that may be passed over when there is no time for all


@dataclass(frozen=True)
class Order:
    """A person's order, and where the answer goes."""

    command: pb.EstimatorCommand
    answer: Callable[[pb.Reply], None]


class Ready(NamedTuple):
    """A message that its turn has come for: nothing before it is missing any more."""

    arrival: Arrival


class Gone(NamedTuple):
    """A device that has been silent for long and makes room for another."""

    device: str


class Worker:
    """Bus callbacks append, one thread steps the pipeline in order of publication and publishes.

    What comes in is looked at here (`door`): the contract, the number of devices. Messages of a
    device are in order, devices take turns.
    """

    def __init__(
        self,
        pipeline: Pipeline,
        put: Callable[[Output], None],
        ask: Callable[[Question], None] | None = None,
        save: Callable[["Worker"], None] | None = None,
        door: Door | None = None,
        trouble: Callable[[], str] = lambda: "",
        now_ns: Callable[[], int] = elapsed_ns,
    ) -> None:
        """`ask` puts a question to a gateway, its answer comes through `answered`; `save` keeps the
        state; `trouble()` says what this process cannot do now; `now_ns` is CLOCK_BOOTTIME.
        """
        self.pipeline = pipeline
        self.door = door or Door("estimator")
        self.mender = Mender(
            ask or (lambda question: self.answered(question, None)),
            topics=PIPELINE_INPUTS,
            refuse=self.door.refuse,
        )
        self._put, self._save, self._trouble, self._now_ns = put, save, trouble, now_ns
        self.overload = Overload()
        self._loop = Loop("estimator")
        self.inbox = Inbox(BACKLOG, BACKLOG_BYTES, self._loop.turn)
        self._ready = 0  # messages that the mender has given on and the pipeline has not taken
        self._bad = 0
        self._save_at = time.monotonic() + SAVE_S
        self.failure: BaseException | None = None

    def offer(self, arrival: Arrival) -> None:
        """Called on the bus's thread: append and return."""
        if not self.inbox.offer(arrival.device, arrival) and worth_a_line(self.inbox.dropped):
            log.error(
                "%d messages waiting: too slow, %d dropped so far",
                len(self.inbox),
                self.inbox.dropped,
            )

    def forget(self, device: str) -> None:
        """Called on the bus's thread: the device is gone."""
        self.inbox.put(device, Gone(device))

    def answered(self, question: Question, reply: pb.HistoryReply | None) -> None:
        """Called on the asker's thread: what a gateway kept."""
        self.inbox.put(question.stream[0], (question, reply))

    def take_order(self, order: orders.Order[pb.EstimatorCommand, pb.Reply]) -> None:
        """Called on the bus's thread: an order for the device whose key was asked."""
        order.command.device = order.device
        self.order(order.command, order.answer)

    def order(self, command: pb.EstimatorCommand, answer: Callable[[pb.Reply], None]) -> None:
        """Called on any thread: what a person asks for, done between two samples."""
        self.inbox.put(command.device, Order(command, answer))

    def finish(self) -> None:
        """Ask the worker to end after what is queued now."""
        self.inbox.end()

    def work(self, stop: threading.Event) -> None:
        """The worker: until finish(). An unexpected error outside of a device's estimators sets
        `stop`: run() raises it, the supervisor starts anew.
        """
        try:
            with self._loop:
                while (turn := self.inbox.get()) is not None:
                    self._loop.turn()
                    self._do(*turn)
                    self._keep()
        except BaseException as error:
            self.failure = error
            stop.set()

    def _do(self, device: str, item: Any) -> None:
        """One item of the inbox."""
        if isinstance(item, Order):
            with self._loop.during("an order", ORDER_S):
                self._obey(item)
        elif isinstance(item, Gone):
            self.pipeline.forget(item.device)
            self.mender.forget(item.device)
            self.overload.forget(item.device)
        elif isinstance(item, Ready):
            self._ready -= 1
            self._handle(item.arrival)
        else:
            self._mend(device, item)

    def _mend(self, device: str, item: Any) -> None:
        """A message, or the answer to a question: what is in order now is handled, one at a
        turn.
        """
        ready = self.mender.take(item) if isinstance(item, Arrival) else self.mender.answer(*item)
        if len(ready) == 1:
            self._handle(ready[0])
        elif ready:
            self._ready += len(ready)
            self.inbox.put_first(device, [Ready(arrival) for arrival in ready])

    def _obey(self, order: Order) -> None:
        try:
            reply, outputs = self.pipeline.order(order.command)
            for output in outputs:
                self._tell(output)
        except Exception as error:
            self._fail(order.command.device, "order", error)
            reply = pb.Reply(ok=False, message=f"not done: {type(error).__name__}: see the log")
        self._keep(at_once=True)  # before the answer: what was answered survives a crash
        order.answer(reply)

    def _keep(self, at_once: bool = False) -> None:
        """Save the state when it is time; while a gap is being filled that waits. An order stands
        in no input.
        """
        if at_once:
            self._save_at = 0.0
        if self._save is None or self._ready or self.mender.asking:
            return
        began = time.monotonic()
        if began >= self._save_at:
            with self._loop.during("keeping the state", KEEP_S):
                self._save(self)
            took = time.monotonic() - began
            self._save_at = began + max(SAVE_S, took / SAVE_SHARE)

    def _handle(self, arrival: Arrival) -> None:
        """One message in its place: through the door, and into its device's estimators."""
        if not self._has_time(arrival):
            return
        address = Address("", arrival.device, arrival.topic, arrival.estimator)
        message = self.door.message(address, arrival.payload)
        if message is None:
            return
        message.header.device = arrival.device
        try:
            for output in self.pipeline.on(arrival.topic, message):
                self._tell(output)
        except BadMessage as error:
            self._bad += 1
            if worth_a_line(self._bad):
                log.warning("%s: ignored (%d so far)", error, self._bad)
        except Exception as error:
            self._fail(arrival.device, arrival.topic.name, error)

    def _has_time(self, arrival: Arrival) -> bool:
        """False for samples that are passed over because their device is too late."""
        if arrival.topic not in SAMPLES or not arrival.at_ns:
            return True
        device = arrival.device
        if arrival.late:
            return self.overload.take_filled(device)
        taken = self.overload.take(device, arrival.at_ns, self._now_ns())
        self.pipeline.limit(device, self.overload.of(device).limit_hz)
        return taken

    def _tell(self, output: Output) -> None:
        if output.topic is ESTIMATOR:
            status, lateness = output.message, self.overload.of(output.device)
            status.refused.update(self.door.of(output.device))
            status.behind_s, status.skipped_s = lateness.late_s, lateness.skipped_s
            status.limit_hz, status.trouble = lateness.limit_hz, self._trouble()
            status.waiting = len(self.inbox)
        self._put(output)

    def _fail(self, device: str, what: str, error: Exception) -> None:
        """A fault of ours in the estimators of one device: they begin anew, the others go on."""
        failure = Refusal("failure", what, type(error).__name__, "to be understood")
        self.door.refuse(f"{device}/{what}", failure, device)
        if self.door.refused["failure"] <= FAILURES_SHOWN:
            log.error("%s: its estimators begin anew", device, exc_info=error)
        self.pipeline.forget(device)
