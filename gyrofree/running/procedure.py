"""A procedure in the terminal: starts it at the service, shows how it goes, gives orders."""

import getpass
import signal
import sys
import threading
from dataclasses import dataclass
from queue import Empty, SimpleQueue

from rich.console import Console
from rich.text import Text

from logs.figures.numbers import with_half_width
from messages.bus import orders
from messages.bus.faults import BusUnavailable
from messages.bus.session import BusSettings, open_client, subscribe
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import PROCEDURE
from messages.text import plain

ROUTER_S = 5.0
SILENT_S = 15.0
M = pb.ProcedureStatus
OVER = (M.STATE_DONE, M.STATE_ABORTED, M.STATE_STOPPED)
MARKS = {
    M.Step.STATE_DONE: ("✓", "green"),
    M.Step.STATE_FAILED: ("✗", "bold red"),
    M.Step.STATE_SKIPPED: ("–", "yellow"),
}


class RunError(RuntimeError):
    """A run that cannot be begun or followed; the text says why."""


@dataclass(frozen=True)
class Wanted:
    """What is to be run."""

    procedure: str
    device: str
    unit: str
    operator: str
    own_session: bool


def user() -> str:
    """Name of who is at the terminal."""
    try:
        return getpass.getuser()[:64]
    except (KeyError, OSError):
        return ""


def order(bus: BusSettings, action: str, device: str, text: str = "") -> str:
    """Give one order; the answer. Raises RunError."""
    number = pb.ProcedureCommand.Action.Value(f"ACTION_{action}")
    command = _command(action=number, device=device, user=user(), text=text)
    try:
        with open_client(bus, timeout_s=ROUTER_S) as session:
            return _give(session, bus, command)
    except BusUnavailable as error:
        raise RunError(str(error)) from None


def _command(**fields) -> pb.ProcedureCommand:
    try:
        return pb.ProcedureCommand(**fields)
    except ValueError:  # a terminal of another encoding
        raise RunError("the order holds what is no text in UTF-8") from None


def _give(session, bus: BusSettings, command: pb.ProcedureCommand) -> str:
    try:
        reply = orders.give(session, bus.prefix, orders.PROCEDURES, command, command.device)
    except (orders.OrderError, ValueError) as error:
        raise RunError(str(error)) from None
    if not reply.ok:
        raise RunError(reply.message)
    return reply.message


def run(bus: BusSettings, wanted: Wanted) -> pb.ProcedureStatus:
    """Start it and follow it to its end; Ctrl-C is an emergency stop. Raises RunError."""
    command = _command(
        action=pb.ProcedureCommand.ACTION_START,
        device=wanted.device,
        procedure=wanted.procedure,
        unit=wanted.unit,
        user=wanted.operator,
        own_session=wanted.own_session,
    )
    said: SimpleQueue[M] = SimpleQueue()
    stop = threading.Event()
    before = signal.signal(signal.SIGINT, lambda *_: stop.set())
    try:
        with open_client(bus, timeout_s=ROUTER_S) as session:
            listening = subscribe(
                session, PROCEDURE, bus.prefix, lambda _, m: said.put(m), wanted.device
            )
            try:
                _give(session, bus, command)
                return _follow(said, stop, session, bus, wanted)
            finally:
                listening.undeclare()
    except BusUnavailable as error:
        raise RunError(str(error)) from None
    finally:
        signal.signal(signal.SIGINT, before)


def _follow(said: SimpleQueue, stop: threading.Event, session, bus, wanted: Wanted) -> M:
    view, silent, mine = View(), 0.0, ""
    while True:
        if stop.is_set():
            stop.clear()
            command = pb.ProcedureCommand(
                action=pb.ProcedureCommand.ACTION_STOP, device=wanted.device, user=wanted.operator
            )
            _give(session, bus, command)
        try:
            status = said.get(timeout=0.5)
        except Empty:
            silent += 0.5
            if silent > SILENT_S:
                raise RunError(
                    f"the procedures have said nothing for {silent:.0f} s; the run goes on when"
                    " `gyrofree procedures` runs again"
                ) from None
            continue
        if status.state == M.STATE_IDLE or (mine and status.run != mine):
            continue  # of before
        if status.state in OVER and not mine:
            continue
        mine, silent = status.run, 0.0
        view.show(status)
        if status.state in OVER and not status.instruction.endswith("being closed"):
            view.end()
            return status


class View:
    """Progress on a terminal: finished steps stay as lines, the present one is drawn over."""

    def __init__(self) -> None:
        self._console = Console(file=sys.stderr, highlight=False)
        self._told: set[tuple[int, int]] = set()  # step, spoilt attempts
        self._head, self._last, self._open = False, "", False

    def show(self, m: M) -> None:
        """One status."""
        if not self._head:
            self._head = True
            by = f"table: {m.table}" if m.table else "the table is turned by hand"
            self._line(f"{m.title}; unit {m.unit or 'without serial number'}; {by}", "bold")
        for k, step in enumerate(m.steps):
            done = step.state in MARKS
            if step.spoilt and (k, step.spoilt) not in self._told:
                self._told.add((k, step.spoilt))
                why = f"{step.name}: spoilt: {step.reason}" if step.reason else m.message
                self._line(f"  ! {why}", "yellow")
            if done and (k, 0) not in self._told:
                self._told.add((k, 0))
                mark, style = MARKS[step.state]
                self._line(f"  {mark} {step.name}  {figures(step)}{step.reason}", style)
        bar = "█" * round(20 * m.progress) + "░" * (20 - round(20 * m.progress))
        self._over(f"  {bar} {m.instruction}" + (f"  ({m.message})" if m.message else ""))

    def end(self) -> None:
        """Leave the cursor on a line of its own."""
        if self._open:
            self._console.print()

    def _line(self, text: str, style: str) -> None:
        if self._open:
            self._console.file.write("\r\x1b[K")
            self._open = False
        self._console.print(Text(plain(text), style=style))

    def _over(self, text: str) -> None:
        text = plain(text)
        if self._console.is_terminal:
            self._console.file.write("\r\x1b[K" + text[: self._console.width - 1])
            self._console.file.flush()
            self._open = True
        elif (short := text.split("  (")[0].rstrip("0123456789. sto")[23:]) != self._last:
            self._last = short
            self._console.print(Text(text, style="dim"))


def figures(step: pb.ProcedureStatus.Step) -> str:
    """The numbers of a step, with two standard errors where they are known."""
    parts = []
    for one in step.figures:
        name, _, unit = one.name.rpartition("_")
        known = one.value == one.value
        value = with_half_width(one.value, 2.0 * one.sigma) if known else "not told"
        unit = {"dps": "deg/s"}.get(unit, unit) if known else ""
        parts.append(f"{name.replace('_', ' ')} {value} {unit}".rstrip())
    return ", ".join(parts) + (" " if parts else "")
