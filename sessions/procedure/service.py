"""`gyrofree procedures`: runs procedures, one at a time for each device. Orders, data and status go
over the bus; what happens is kept in [procedures] root, so that a killed service goes on.
"""

import logging
import math
import threading
import time
from collections import deque

import zenoh

from messages.bus import orders
from messages.bus.claiming import Claim
from messages.bus.command.keeper import Keeper
from messages.bus.session import BusSettings, subscribe
from messages.bus.turning import Loop
from messages.bus.turns import in_turn, sessions
from messages.clock import elapsed_ns
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import (
    ACCEL,
    AXES,
    IMU,
    LINK,
    NOTE,
    PROCEDURE,
    PROCEDURES,
    RATE,
    TACHO,
)
from messages.history.keeping import KeptPublishers
from sessions.procedure import library, seen
from sessions.procedure.around import Around
from sessions.procedure.conductor import Conductor
from sessions.procedure.desk import ProcedureDesk, if_lost, late, offer
from sessions.procedure.driven.description import TableError, described
from sessions.procedure.driven.table import RateTable, TextTable
from sessions.procedure.run import Journal, unfinished
from sessions.procedure.settings import ProcedureSettings
from sessions.procedure.status import status_of

log = logging.getLogger(__name__)

TICK_S = 0.05
STATUS_S = 0.25
STOPPED_NS = 2_000_000_000  # between two steps: this process did not run
IDLE_S = 2.0
ORDER_S = (
    30.0  # that an order may take, and a step that orders: the recorder's answer is waited for
)
RESUME_S = 120.0  # that going on after a crash may take
DATA = (ACCEL, IMU, TACHO, RATE, AXES, LINK)
WAITING = 20_000  # messages of a device; more are dropped, which the watch takes for lost data
COMMAND = pb.ProcedureCommand
DONE = {
    COMMAND.ACTION_START: "started",
    COMMAND.ACTION_NEXT: "goes on",
    COMMAND.ACTION_REPEAT: "the step begins anew",
    COMMAND.ACTION_ABORT: "aborted",
}


class Tables(dict[str, RateTable]):
    """By device, of the settings; a description that cannot be read is said at once."""

    def __init__(self, settings: ProcedureSettings) -> None:
        """Raises TableError."""
        super().__init__()
        for one in settings.tables:
            self[one.device] = TextTable(described(one.description), one.port)


class Service:
    """All conductors. Zenoh's threads only put things into queues, and stop tables."""

    def __init__(
        self, settings: ProcedureSettings, session: zenoh.Session, prefix: str, number: int = 0
    ) -> None:
        """number: of the claim. Raises TableError."""
        self._settings, self._session, self._prefix = settings, session, prefix
        self.loop = Loop("procedures")
        self._tables = Tables(settings)
        kept = settings.root / ".published"
        self._publishers = KeptPublishers(session, prefix, PROCEDURES, kept, number)
        self._devices: dict[str, float] = {}  # heard, and when its idle status is due
        self._conductors: dict[str, Conductor] = {}
        self._ended: dict[str, Conductor] = {}
        self._queues: dict[str, deque] = {}
        self._listening: dict[str, list[zenoh.Subscriber]] = {}
        self._orders: deque[orders.Order[COMMAND, pb.Reply]] = deque()
        self._due: dict[str, float] = {}
        self._around = Around(session, prefix, lambda name: self._devices.setdefault(name, 0.0))
        self._keeper = Keeper(session, prefix, settings.root, number)
        self._taking = orders.take(session, prefix, orders.PROCEDURES, self._on_order, "*")

    # --- on Zenoh's threads

    def _on_order(self, order: orders.Order[COMMAND, pb.Reply]) -> None:
        conductor = self._conductors.get(order.device)
        if order.command.action == COMMAND.ACTION_STOP and conductor is not None:
            problem = conductor.emergency()
            order.answer(pb.Reply(ok=not problem, message=problem or "stopped"))
        elif order.command.action == COMMAND.ACTION_STOP and order.device in self._tables:
            order.answer(self._stop_alone(order.device))
            return
        elif len(self._orders) > 100:
            order.refuse("too many orders wait")
            return
        self._orders.append(order)

    def _stop_alone(self, device: str) -> pb.Reply:
        """An emergency stop while nothing runs: whoever drives the table, it shall stand."""
        try:
            self._tables[device].stop()
        except TableError as error:
            log.error("emergency stop: %s", error)
            text = f"THE TABLE DID NOT TAKE THE STOP, switch it off: {error}"
            return pb.Reply(ok=False, message=text)
        return pb.Reply(ok=True, message="the table was told to stop; no procedure runs")

    def _on_data(self, device: str, message: object) -> None:
        queue = self._queues.get(device)
        if queue is not None and len(queue) < WAITING:
            queue.append(message)

    # --- on the service's own thread

    def resume(self) -> None:
        """Go on with what a crash cut off; first of all the tables that it left turning stand."""
        left = unfinished(self._settings.root)
        for device in left.keys() & self._tables.keys():
            reply = self._stop_alone(device)
            log.warning("%s: its procedure was cut off; %s", device, reply.message)
        for device, journal in left.items():
            if journal is None:
                continue
            log.info("%s: going on with %s", device, journal.run.id)
            self._start(journal)

    def step(self) -> None:
        """Orders, data, status; call it every TICK_S."""
        self._keeper.step()
        while self._orders:
            with self.loop.during("an order", ORDER_S):
                self._obey(self._orders.popleft())
        while self._around.recorder:
            status = self._around.recorder.popleft()
            for conductor in self._conductors.values():
                conductor.recorded.take(status)
        now = time.monotonic()
        for device, conductor in list(self._conductors.items()):
            queue = self._queues[device]
            for _ in range(len(queue)):
                one = seen.of(queue.popleft())
                if one is not None:
                    conductor.take(one)
            conductor.tick()
            if now >= self._due.get(device, 0.0):
                self._due[device] = now + STATUS_S
                self._publish(device, status_of(conductor))
            if conductor.run.closed:
                self._finish(device, conductor, now)
        for device, due in list(self._devices.items()):
            if device not in self._conductors and now >= due:
                self._idle(device, now)

    def close(self) -> None:
        """Stop listening; runs go on with the next life. Driven tables stand meanwhile."""
        self._taking.undeclare()
        self._keeper.close()
        self._around.close()
        for device, conductor in self._conductors.items():
            self._silence(device)
            conductor.drive.stop()
        self._publishers.close()

    def abandon(self) -> None:
        """Another process has taken over: say nothing more, least of all to its tables."""
        self._taking.undeclare()
        self._keeper.close()
        self._around.close()
        for device, conductor in self._conductors.items():
            self._silence(device)
            conductor.abandon()
        self._publishers.close()

    def _obey(self, order: orders.Order[COMMAND, pb.Reply]) -> None:
        command, device = order.command, order.device
        conductor = self._conductors.get(device)
        if command.action == COMMAND.ACTION_STOP and conductor is not None:
            conductor.stopped(command.user)  # the table was stopped, and the order answered
            return
        try:
            problem = self._do(command, device, conductor)
        except (library.ProcedureError, TableError, orders.OrderError, OSError) as error:
            problem = str(error)
        log.info("%s: order %d of %s: %s", device, command.action, command.user, problem or "done")
        order.answer(pb.Reply(ok=not problem, message=problem or DONE[command.action]))

    def _do(self, command: COMMAND, device: str, conductor: Conductor | None) -> str:
        if command.action == COMMAND.ACTION_START:
            if conductor is not None:
                return f"{conductor.run.plan.name} runs on {device}: end or abort it first"
            limit = self._tables[device].limit if device in self._tables else math.inf
            journal = self._desk(device).begin(command, limit)
            self._start(journal)
            return ""
        if conductor is None:
            return f"no procedure runs on {device}"
        if command.action in (COMMAND.ACTION_NEXT, COMMAND.ACTION_REPEAT):
            if problem := late(conductor, command):
                return problem
        match command.action:
            case COMMAND.ACTION_NEXT:
                return conductor.next(command.user, command.text)
            case COMMAND.ACTION_REPEAT:
                return conductor.repeat(command.user)
            case COMMAND.ACTION_ABORT:
                return conductor.abort(command.user)
        return "no such order"

    def _desk(self, device: str) -> ProcedureDesk:
        return ProcedureDesk(self._session, self._prefix, self._settings, device)

    def _start(self, journal: Journal) -> None:
        device, desk = journal.run.device, self._desk(journal.run.device)

        def say(text: str, at_utc_ns: int, seconds: float) -> None:
            note = pb.Note(text=text[:500], author="procedure", kind=pb.Note.KIND_EVENT)
            note.at_utc_ns, note.seconds = at_utc_ns, seconds
            note.header.device, note.header.run = device, self._publishers.run
            note.header.utc_ns = at_utc_ns or time.time_ns()
            self._publishers.put(NOTE, device, note)

        def record(on: bool) -> object:
            with self.loop.during("an order to the recorder", ORDER_S):
                return desk.record(on, journal)

        silence = lambda: self._around.silence(device)  # noqa: E731
        conductor = Conductor(journal, self._tables.get(device), say, record, silence)
        self._ended.pop(device, None)
        self._queues[device] = deque()
        self._conductors[device] = conductor
        self._listening[device] = [
            subscribe(
                self._session,
                topic,
                self._prefix,
                lambda _, message: self._on_data(device, message),
                device,
                self._around.fence,
            )
            for topic in DATA
        ]
        conductor.begin()

    def _finish(self, device: str, conductor: Conductor, now: float) -> None:
        self._publish(device, status_of(conductor))
        self._silence(device)
        del self._conductors[device], self._queues[device]
        self._ended[device] = conductor
        self._devices[device] = now + STATUS_S

    def _silence(self, device: str) -> None:
        for subscriber in self._listening.pop(device, []):
            subscriber.undeclare()

    def _idle(self, device: str, now: float) -> None:
        """What may be started, and how the last run of this life ended."""
        self._devices[device] = now + IDLE_S
        message = pb.ProcedureStatus(state=pb.ProcedureStatus.STATE_IDLE)
        if device in self._ended:
            message = status_of(self._ended[device])
        table = self._tables.get(device)
        message.table = table.name if table is not None else ""
        offer(message, self._settings.folder)
        self._publish(device, message)

    def _publish(self, device: str, message: pb.ProcedureStatus) -> None:
        message.if_lost = if_lost(self._tables.get(device))
        message.header.device, message.header.run = device, self._publishers.run
        message.header.utc_ns = message.header.utc_ns or time.time_ns()
        self._publishers.put(PROCEDURE, device, message)


def run(settings: ProcedureSettings, bus: BusSettings, stop: threading.Event) -> None:
    """Run procedures until `stop` is set; wait while another process does. Raises TableError for a
    table's description.
    """
    Tables(settings)
    with sessions(bus, stop) as mine:
        if mine is not None:
            in_turn(
                mine,
                bus.prefix,
                PROCEDURES,
                stop,
                lambda claimed: _serve(settings, bus, mine.session, claimed, stop),
                "procedures service",
            )


def _serve(
    settings: ProcedureSettings,
    bus: BusSettings,
    session: zenoh.Session,
    claimed: Claim,
    stop: threading.Event,
) -> None:
    """Until `stop`, or until another has taken over: after a moment in which this process did not
    run, nothing is commanded before it is known that none has.
    """
    service = Service(settings, session, bus.prefix, claimed.number)
    try:
        with service.loop:
            with service.loop.during("going on after a crash", RESUME_S):
                service.resume()
            last_ns = elapsed_ns()
            while not (claimed.lost.is_set() or stop.wait(TICK_S)):
                service.loop.turn()
                if elapsed_ns() - last_ns > STOPPED_NS and not claimed.look():
                    continue
                service.step()
                last_ns = elapsed_ns()
    finally:
        if claimed.lost.is_set():
            service.abandon()
        else:
            service.close()
