"""The pipeline on a thread: bus callbacks append, it takes all in order of publication.

Gaps of a device's inputs are filled from what its gateway kept (messages/history/mending.py) before
the pipeline sees what came after them. Orders of people are done between two samples.
"""

import logging
import queue
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from estimator.convert.samples import BadMessage
from estimator.output import Output
from estimator.pipeline import Pipeline
from estimator.stream import worth_a_line
from messages.bus import orders
from messages.bus.session import decode
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import PIPELINE_INPUTS
from messages.history.mending import Mender
from messages.history.mending_state import Arrival, Question

log = logging.getLogger(__name__)

# messages; more than a minute of a full-rate board, then the newest are dropped and asked for again
BACKLOG = 20_000
SAVE_S = 2.0


@dataclass(frozen=True)
class Order:
    """A person's order, and where the answer goes."""

    command: pb.EstimatorCommand
    answer: Callable[[pb.Reply], None]


class Worker:
    """Bus callbacks append, one thread steps the pipeline in order of publication and publishes."""

    def __init__(
        self,
        pipeline: Pipeline,
        put: Callable[[Output], None],
        ask: Callable[[Question], None] | None = None,
        save: Callable[["Worker"], None] | None = None,
    ) -> None:
        """`ask` puts a question to a gateway, its answer comes through `answered`; `save` keeps the
        state.
        """
        self.pipeline = pipeline
        self.mender = Mender(
            ask or (lambda question: self.answered(question, None)), topics=PIPELINE_INPUTS
        )
        self._put, self._save = put, save
        self._queue: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._bad = self._dropped = 0
        self._save_at = time.monotonic() + SAVE_S
        self.failure: BaseException | None = None

    def offer(self, arrival: Arrival) -> None:
        """Called on the bus's thread: append and return."""
        if self._queue.qsize() >= BACKLOG:
            self._dropped += 1
            if worth_a_line(self._dropped):
                log.error(
                    "%d messages waiting: too slow, %d dropped so far", BACKLOG, self._dropped
                )
            return
        self._queue.put(arrival)

    def answered(self, question: object, reply: pb.HistoryReply | None) -> None:
        """Called on the asker's thread: what a gateway kept."""
        self._queue.put((question, reply))

    def take_order(self, order: orders.Order[pb.EstimatorCommand, pb.Reply]) -> None:
        """Called on the bus's thread: an order for the device whose key was asked."""
        order.command.device = order.device
        self.order(order.command, order.answer)

    def order(self, command: pb.EstimatorCommand, answer: Callable[[pb.Reply], None]) -> None:
        """Called on any thread: what a person asks for, done between two samples."""
        self._queue.put(Order(command, answer))

    def finish(self) -> None:
        """Ask the worker to end after what is queued now."""
        self._queue.put(None)

    def work(self, stop: threading.Event) -> None:
        """The worker: until finish(). An unexpected error sets `stop`: run() raises it, the
        supervisor starts anew.
        """
        try:
            while (item := self._queue.get()) is not None:
                if isinstance(item, Order):
                    reply, outputs = self.pipeline.order(item.command)
                    for output in outputs:
                        self._put(output)
                    self._keep(
                        at_once=True
                    )  # before the answer: what was answered survives a crash
                    item.answer(reply)
                    continue
                ready = (
                    self.mender.take(item)
                    if isinstance(item, Arrival)
                    else self.mender.answer(*item)
                )
                for arrival in ready:
                    self._handle(arrival)
                self._keep()
        except BaseException as error:
            self.failure = error
            stop.set()

    def _keep(self, at_once: bool = False) -> None:
        """Save the state when it is time; while a gap is being filled that waits. An order stands
        in no input.
        """
        if at_once:
            self._save_at = 0.0
        if self._save is not None and time.monotonic() >= self._save_at and not self.mender.asking:
            self._save_at = time.monotonic() + SAVE_S
            self._save(self)

    def _handle(self, arrival: Arrival) -> None:
        message = decode(arrival.topic, arrival.payload)
        if message is None:
            return
        try:
            outputs = self.pipeline.on(arrival.topic, message)
        except BadMessage as error:
            self._bad += 1
            if worth_a_line(self._bad):
                log.warning("%s: ignored (%d so far)", error, self._bad)
            return
        for output in outputs:
            self._put(output)
