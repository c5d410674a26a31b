"""The pipeline on the bus: every sample in its order, also those that the bus lost, and on after a
crash as before it.

Gaps of a device's inputs are filled from what its gateway kept (messages/history/mending.py) before
the pipeline sees what came after them. With a journal folder, what is published is kept too, and
the pipeline's whole state is saved every
SAVE_S: after a crash it goes on from there, the gateway gives again what came since, and, because
the pipeline is deterministic, what had been published already comes out again under the same
numbers and is not published twice.
"""

import hashlib
import logging
import os
import pickle
import queue
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import inertial
from estimator import convert
from estimator.service import Output, Pipeline
from estimator.settings import EstimatorSettings
from estimator.stream import worth_a_line
from estimator.warm import warm
from messages.bus import orders
from messages.bus.session import BusSettings, BusUnavailable, Publishers, decode, open_client
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import ESTIMATES, PIPELINE_INPUTS, REPLAY_SUFFIX, TopicError, parse
from messages.history.answers import Asker, declare
from messages.history.journal import JournalBusy
from messages.history.mending import Arrival, Mender, Question
from messages.history.spool import Spool

log = logging.getLogger(__name__)

# messages; more than a minute of a full-rate board, then the newest are dropped and asked for again
BACKLOG = 20_000
SAVE_S = 2.0
RESUME_S = 600.0  # an older state is of another measurement
END_S = 3.0  # for what is queued when the service is to end
STATE = "state.pickle"


Order = orders.Order[pb.EstimatorCommand, pb.Reply]


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

    def take_order(self, order: Order) -> None:
        """Called on the bus's thread: what a person asks for, done between two samples."""
        order.command.device = order.device
        self._queue.put(order)

    def finish(self) -> None:
        """Ask the worker to end after what is queued now."""
        self._queue.put(None)

    def work(self, stop: threading.Event) -> None:
        """The worker: until finish(). An unexpected error sets `stop`: run() raises it, the
        supervisor starts anew.
        """
        try:
            while (item := self._queue.get()) is not None:
                if isinstance(item, orders.Order):
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
        except convert.BadMessage as error:
            self._bad += 1
            if worth_a_line(self._bad):
                log.warning("%s: ignored (%d so far)", error, self._bad)
            return
        for output in outputs:
            self._put(output)


class SavedState:
    """The pipeline between two inputs, with what it had taken and published by then, as one
    file.
    """

    def __init__(self, folder: Path, settings: EstimatorSettings, version: str) -> None:
        self._path = folder / STATE
        self._mark = hashlib.sha256(
            f"{version} {settings!r}".encode()
        ).hexdigest()  # of another setup it is of no use
        self._broken = False

    def save(self, worker: Worker, publishers: Publishers) -> None:
        """Replace the file; a state that cannot be saved is said once, and costs the resumption
        only.
        """
        if self._broken or worker.mender.asking:
            return
        try:
            data = pickle.dumps(
                (self._mark, worker.pipeline, worker.mender.taken(), publishers.sequences())
            )
            new = self._path.with_suffix(".new")
            new.write_bytes(data)
            os.replace(new, self._path)
        except Exception as error:  # whatever stands in an estimator's state: estimating goes on
            self._broken = True
            log.warning(
                "%s: the state cannot be saved (%s): after a crash estimates begin anew",
                self._path,
                error,
            )

    def load(self) -> tuple[Pipeline, dict, dict] | None:
        """What was saved last; None when there is nothing that can be gone on with."""
        try:
            if time.time() - self._path.stat().st_mtime > RESUME_S:
                return None
            mark, pipeline, taken, sequences = pickle.loads(self._path.read_bytes())
        except FileNotFoundError:
            return None
        except Exception as error:  # cut by a power failure, or of another version
            log.warning("%s: cannot be read (%s): estimates begin anew", self._path, error)
            return None
        return (pipeline, taken, sequences) if mark == self._mark else None

    def forget(self) -> None:
        """After an orderly end there is nothing to go on with."""
        self._path.unlink(missing_ok=True)


def run(settings: EstimatorSettings, bus: BusSettings, stop: threading.Event) -> None:
    """Estimate until `stop` is set; sets it itself and raises when the worker fails."""
    pipeline = Pipeline(settings)
    warm()
    spool = _open_spool(settings)
    try:
        session = open_client(bus, stop)
    except BusUnavailable:
        if stop.is_set():
            return
        raise
    with session:
        publishers = Publishers(session, bus.prefix, spool)
        asker = Asker(session, bus.prefix, lambda question, reply: worker.answered(question, reply))
        saved = SavedState(settings.journal, settings, _version()) if spool is not None else None
        worker = _worker(pipeline, publishers, asker, saved)
        thread = threading.Thread(target=worker.work, args=(stop,), name="estimator", daemon=True)
        thread.start()
        answering = (
            [declare(session, bus.prefix, "*", ESTIMATES, spool)] if spool is not None else []
        )
        # One subscriber for all topics: each has a thread of its own, and a fix must not overtake
        # its samples.
        subscriber = session.declare_subscriber(f"{bus.prefix}/*/*", _on(worker))
        control = orders.take(session, bus.prefix, orders.ESTIMATOR, worker.take_order, "*")
        log.info(
            "estimating: rate %s; navigation %s",
            ", ".join(settings.rate),
            ", ".join(settings.navigators),
        )
        stop.wait()
        subscriber.undeclare()
        control.undeclare()
        worker.finish()
        thread.join(timeout=END_S)
        behind = (
            thread.is_alive()
        )  # the next start goes on from the saved state, and this one's words go nowhere
        for queryable in answering:
            queryable.undeclare()
        asker.close()
    if spool is not None:
        spool.close()
    if behind:
        log.warning(
            "ended while samples waited%s",
            ": the next start takes them up" if saved is not None else "",
        )
        return
    if worker.failure is not None:
        raise worker.failure
    if saved is not None:
        saved.forget()


def _worker(
    pipeline: Pipeline, publishers: Publishers, asker: Asker, saved: SavedState | None
) -> Worker:
    """A worker that goes on from the saved state when there is one."""
    found = saved.load() if saved is not None else None
    publishers.resume()
    if found is not None:
        pipeline = found[0]
        publishers.repeat(found[2])

    def put(output: Output) -> None:
        publishers.put(output.topic, output.device, output.message, output.estimator)

    worker = Worker(
        pipeline,
        put,
        lambda question: asker.ask(question, *question.stream, question.query),
        None if saved is None else lambda worker: saved.save(worker, publishers),
    )
    if found is not None:
        for (device, name), (run_, last) in found[1].items():
            worker.mender.seed(device, name, run_, last)
        log.info("going on from the state of before: %d inputs known", len(found[1]))
    return worker


def _open_spool(settings: EstimatorSettings) -> Spool | None:
    if settings.journal is None:
        return None
    try:
        return Spool(settings.journal, settings.journal_bytes, settings.journal_age_s)
    except JournalBusy as busy:
        log.error("%s; estimates are published, but not kept for who misses some", busy)
        return None


def _version() -> str:
    """Of everything a saved state depends on: the package's sources, so that a changed one begins
    anew.
    """
    digest = hashlib.sha256()
    rooms = (Path(__file__).parent, Path(inertial.__file__).parent)
    for path in sorted(p for room in rooms for p in room.rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def _on(worker: Worker) -> Callable[[Any], None]:
    def on_sample(sample: Any) -> None:
        try:
            address = parse(str(sample.key_expr))
        except TopicError:
            return
        # a replay makes its own estimates
        if address.topic in PIPELINE_INPUTS and not address.device.endswith(REPLAY_SUFFIX):
            payload = sample.payload.to_bytes()
            worker.offer(
                Arrival(address.topic, address.device, address.estimator, payload, time.time_ns())
            )

    return on_sample
