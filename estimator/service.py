"""The estimator process: samples in, motion out. A shell; the thinking is in the modules beside it.

Pipeline is the whole service without the bus: what it returns is a function of the messages given to it, in their
order, and of nothing else, so that a recording sent through it again gives the same bytes. Only EstimatorStatus
carries a measured duration and is left out of such a comparison.
"""

import logging
import queue
import threading
import time
from collections.abc import Callable
from importlib import metadata
from typing import Any, NamedTuple

from google.protobuf.message import Message

from estimator import convert
from estimator.rate_board import RateBoard
from estimator.settings import EstimatorSettings, LayoutSettings
from estimator.stream import Stream, every
from messages import gyrofree_pb2 as pb
from messages.bus import BusSettings, BusUnavailable, Publishers, open_client, subscribe
from messages.topics import ACCEL, ESTIMATOR, POSE, RATE, Topic

log = logging.getLogger(__name__)

POSE_HZ = 20.0
INPUTS = (ACCEL,)
BACKLOG = 20_000  # messages; more than a minute of a full-rate board, then the newest are dropped and counted
NO_TRANSLATION = (0.0, 0.0, 0.0)  # a cube on its table turns and stays


class Output(NamedTuple):
    """One message to publish."""

    topic: Topic
    device: str
    estimator: str
    message: Message


class Pipeline:
    """All estimators of all devices."""

    def __init__(self, settings: EstimatorSettings, clock: Callable[[], int] = time.perf_counter_ns) -> None:
        """`clock` (ns) measures the cost per sample for EstimatorStatus and touches nothing else."""
        self._settings = settings
        self._clock = clock
        self._boards: dict[str, RateBoard] = {}
        self._cost = _Cost()
        self._second: dict[tuple[str, str], int] = {}

    def on(self, topic: Topic, message: Message) -> list[Output]:
        """Take one message of any topic; raises convert.BadMessage for one that cannot be used."""
        if topic is ACCEL:
            return self.on_accel(message)
        return []

    def on_accel(self, batch: pb.AccelBatch) -> list[Output]:
        """Rate estimates, poses and, once per second of data, the health of each estimator."""
        samples = convert.accel_samples(batch)
        device = batch.header.device
        board = self._boards.get(device)
        if board is None:
            layout = make_layout(self._settings.layout_of(device))
            board = RateBoard(device, layout, self._settings.rate, self._settings.rate_limit_hz)
            self._boards[device] = board
        started = self._clock()
        states = board.feed(batch.header.epoch, batch.first_index, batch.period_s, samples.t_s, samples.values)
        self._cost.add(device, self._clock() - started, len(samples.t_s))
        pose_step = every(batch.period_s, POSE_HZ)
        out = []
        for row, index, name, state in ((o.row, o.index, o.estimator, o.state) for o in states):
            header = convert.sample_header(batch.header, row * batch.period_s)
            out.append(Output(RATE, device, name, convert.rate_message(header, batch, index, name, state)))
            if index % pose_step == pose_step - 1:
                pose = convert.pose_message(header, name, NO_TRANSLATION, state.q_nb)
                out.append(Output(POSE, device, name, pose))
        if self._new_second(device, "accel", samples.t_s[-1]):
            header = convert.sample_header(batch.header, (len(samples.t_s) - 1) * batch.period_s)
            for name in self._settings.rate:
                out.append(Output(ESTIMATOR, device, name, self._rate_status(header, board, name)))
        return out

    def _new_second(self, device: str, what: str, t_s: float) -> bool:
        second = int(t_s)
        changed = self._second.get((device, what)) != second
        self._second[device, what] = second
        return changed

    def _rate_status(self, header: pb.Header, board: RateBoard, name: str) -> pb.EstimatorStatus:
        status = self._status(header, board.stream, name)
        state = board.last[name]
        status.state = "standing still" if state.still else "turning"
        status.layout = board.layout.name
        bias = convert.as_list(state.bias)
        if len(bias) >= 6:
            status.bias_f_b_mps2[:] = bias[:3]
            status.bias_alpha_radps2[:] = bias[3:6]
        return status

    def _status(self, header: pb.Header, stream: Stream, name: str) -> pb.EstimatorStatus:
        return pb.EstimatorStatus(
            header=header,
            estimator=name,
            samples=stream.samples,
            gaps=stream.gaps,
            missing_samples=stream.missing,
            us_per_sample=self._cost.take(header.device, name),
            version=metadata.version("gyrofree"),
        )


class _Cost:
    """Measured time per sample, by device, since it was last asked for."""

    def __init__(self) -> None:
        self._ns: dict[str, int] = {}
        self._samples: dict[str, int] = {}
        self._asked: dict[tuple[str, str], tuple[int, int]] = {}

    def add(self, device: str, ns: int, samples: int) -> None:
        self._ns[device] = self._ns.get(device, 0) + ns
        self._samples[device] = self._samples.get(device, 0) + samples

    def take(self, device: str, estimator: str) -> float:
        """us per sample of all estimators of this device together."""
        now = (self._ns.get(device, 0), self._samples.get(device, 0))
        before = self._asked.get((device, estimator), (0, 0))
        self._asked[device, estimator] = now
        return (now[0] - before[0]) / max(1, now[1] - before[1]) / 1000.0


def make_layout(settings: LayoutSettings) -> Any:
    """Accelerometer layout from its settings."""
    from estimator.layout import CUBE

    return CUBE(settings.half_side_m)


class Service:
    """Bus callbacks append, one worker steps the pipeline in order of arrival and publishes."""

    def __init__(self, pipeline: Pipeline, put: Callable[[Output], None]) -> None:
        self._pipeline = pipeline
        self._put = put
        self._queue: queue.SimpleQueue[tuple[Topic, Message] | None] = queue.SimpleQueue()
        self._bad = 0
        self._dropped = 0
        self.failure: BaseException | None = None

    def offer(self, topic: Topic, message: Message) -> None:
        """Called on the bus's thread: append and return."""
        if self._queue.qsize() >= BACKLOG:
            self._dropped += 1
            if self._dropped % 1000 == 1:
                log.error("%d messages waiting: too slow, %d dropped so far", BACKLOG, self._dropped)
            return
        self._queue.put((topic, message))

    def finish(self) -> None:
        """Ask the worker to end after what is queued now."""
        self._queue.put(None)

    def work(self, stop: threading.Event) -> None:
        """The worker: until finish(). An unexpected error sets `stop`: run() raises it, the supervisor starts anew."""
        try:
            while (item := self._queue.get()) is not None:
                self._handle(*item)
        except BaseException as error:
            self.failure = error
            stop.set()

    def _handle(self, topic: Topic, message: Message) -> None:
        try:
            outputs = self._pipeline.on(topic, message)
        except convert.BadMessage as error:
            self._bad += 1
            if self._bad & (self._bad - 1) == 0:  # 1st, 2nd, 4th, 8th ...: a flood of them stays readable
                log.warning("%s: ignored (%d so far)", error, self._bad)
            return
        for output in outputs:
            self._put(output)


def run(settings: EstimatorSettings, bus: BusSettings, stop: threading.Event) -> None:
    """Estimate until `stop` is set; sets it itself and raises when the worker fails."""
    try:
        session = open_client(bus, stop)
    except BusUnavailable:
        if stop.is_set():
            return
        raise
    with session:
        publishers = Publishers(session, bus.prefix)
        service = Service(Pipeline(settings), lambda o: publishers.put(o.topic, o.device, o.message, o.estimator))
        worker = threading.Thread(target=service.work, args=(stop,), name="estimator", daemon=True)
        worker.start()
        subscribers = [subscribe(session, topic, bus.prefix, _on(service, topic)) for topic in INPUTS]
        log.info("estimating: rate %s; navigation %s", ", ".join(settings.rate), ", ".join(settings.navigators))
        stop.wait()
        for subscriber in subscribers:
            subscriber.undeclare()
        service.finish()
        worker.join(timeout=3.0)
    if service.failure is not None:
        raise service.failure


def _on(service: Service, topic: Topic) -> Callable[[str, Message], None]:
    return lambda _key, message: service.offer(topic, message)
