"""The simulated table under orders: a text protocol on a line of its own, and a hand that does what
a page says.

Until somebody takes it over, the table runs its profile. SYST:REM takes it, or a procedure that
waits for a person, or a guided calibration; SYST:LOC gives it back, and the board boots anew with
the profile.
"""

import logging
import threading
import time
from collections.abc import Iterator

import numpy as np

from gateway.virtual.board_link import PtyLink, TcpLink
from gateway.virtual.virtual_board import BoardAccel, BoardPulse, Item
from inertial.simulation.driven import DrivenTable
from inertial.simulation.faults import Faults
from inertial.simulation.person import Person
from inertial.simulation.profiles import DEGREE
from messages.bus.session import BusSettings, LateSession, subscribe
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import CALIBRATION, PROCEDURE

log = logging.getLogger(__name__)

STEP = 5  # samples at once: orders are obeyed within 50 ms at 100 Hz
PATIENCE_S = 0.02  # between two looks at the line
GONE_S = 4.0  # s without a word: nobody guides any more
IDENTITY = "gyrofree,simulated rate table,1,1"
FACES = {
    f"{'+' if sign > 0 else '-'}{'XYZ'[k]}": sign * np.eye(3)[k]
    for k in range(3)
    for sign in (1.0, -1.0)
}
TAKING = (
    pb.CalibrationStatus.STATE_WAITING,
    pb.CalibrationStatus.STATE_TAKING,
    pb.CalibrationStatus.STATE_TURNING,
)
ACTIVE = (pb.ProcedureStatus.STATE_RUNNING, pb.ProcedureStatus.STATE_HELD)


class TableDesk:
    """Takes orders for the table of one simulated board; `remote` while somebody drives it."""

    def __init__(
        self,
        link: PtyLink | TcpLink | None,
        bus: BusSettings,
        device: str,
        person: Person,
    ) -> None:
        """person: who turns the table where it is not driven."""
        self._link, self._said, self._person = link, "", person
        self._by_line, self._wanted_up = False, None
        self._hand_rate: float | None = None
        self._heard_at = -np.inf
        self._line_at, self._patience_s = -np.inf, np.inf
        self._table: DrivenTable | None = None
        self._order: tuple[float, float | None] = (0.0, None)
        self.driving = self.given_back = False  # in this run
        self._stop = threading.Event()
        self._session = LateSession(bus, lambda session: self._attach(session, bus.prefix, device))
        self._thread = threading.Thread(target=self._serve, name="table", daemon=True)
        self._thread.start()

    def _attach(self, session, prefix: str, device: str) -> object:
        return (
            subscribe(session, CALIBRATION, prefix, self._calibration, device),
            subscribe(session, PROCEDURE, prefix, self._procedure, device),
        )

    def close(self) -> None:
        """Leave line and bus."""
        self._stop.set()
        self._thread.join(2.0)
        self._session.close()
        if self._link is not None:
            self._link.close()

    @property
    def remote(self) -> bool:
        """Somebody drives it, by the line or by hand."""
        return self._by_line or time.monotonic() - self._heard_at < GONE_S

    def begin(self) -> None:
        """A new run of the profile."""
        self.driving = self.given_back = False

    # --- a hand, as pages guide it

    def _calibration(self, _: str, m: pb.CalibrationStatus) -> None:
        if m.state in TAKING and len(m.next_up_b) == 3:
            self._heard_at, self._hand_rate = time.monotonic(), None
            self._wanted_up = np.array(m.next_up_b)

    def _procedure(self, _: str, m: pb.ProcedureStatus) -> None:
        if m.state not in ACTIVE or m.step >= len(m.steps):
            self._hand_rate = None
            return
        self._heard_at = time.monotonic()
        step = m.steps[m.step]
        if step.kind == "pose" and len(m.up_b) == 3:
            self._wanted_up, self._hand_rate = np.array(m.up_b), None
        elif not m.table and step.kind in ("rate", "still"):
            self._wanted_up, self._hand_rate = np.array([0.0, 0.0, 1.0]), step.target_radps

    # --- the line

    def _serve(self) -> None:
        while not self._stop.wait(PATIENCE_S):
            if self._link is None or not self._link.connected:
                self._said = ""
                self._watch()
                continue
            self._said = (self._said + self._link.read().decode(errors="replace"))[-4096:]
            self._watch()
            while "\n" in self._said:
                self._line_at = time.monotonic()
                line, self._said = self._said.split("\n", 1)
                if line.strip():
                    self._link.write(self._obey(line.strip()).encode() + b"\n")

    def _watch(self) -> None:
        """The table's own watchdog: whoever drives it must say something now and then."""
        silent_s = time.monotonic() - self._line_at
        if self._by_line and self._order[0] != 0.0 and silent_s > self._patience_s:
            log.warning("nothing heard for %.1f s: the table stops by itself", silent_s)
            self._order = (0.0, None)

    def _obey(self, line: str) -> str:
        """The answer to one command."""
        word, _, value = line.upper().partition(" ")
        try:
            match word:
                case "*IDN?":
                    return IDENTITY
                case "SYST:REM":
                    self._by_line, self._order = True, (0.0, None)
                    self._patience_s = np.inf
                case "SYST:LOC":
                    self._by_line, self._patience_s = False, np.inf
                case "SYST:WATC":
                    self._patience_s = _watchdog(float(value))
                case "SENS:RATE?":
                    return f"{(self._table.rate() if self._table else 0.0) / DEGREE:.4f}"
                case "SOUR:RATE?":
                    return f"{self._order[0] / DEGREE:.4f}"
                case "SOUR:ACC":
                    self._command(self._order[0], float(value) * DEGREE)
                case "SOUR:RATE":
                    self._command(float(value) * DEGREE, self._order[1])
                case "OUTP:STOP":  # also of a profile: whoever drives it, it shall stand
                    self._by_line, self._order = True, (0.0, None)
                case "OUTP:POS":
                    self._wanted_up = FACES[value]
                case _:
                    return f"ERR unknown command {word[:40]}"
        except (ValueError, KeyError) as error:
            return f"ERR {error}"
        return "OK"

    def _command(self, omega: float, acceleration: float | None) -> None:
        if not self._by_line:
            raise ValueError("in local mode; send SYST:REM first")
        if not abs(omega) < 720.5 * DEGREE:
            raise ValueError(f"{omega / DEGREE:g} °/s: at most 720")
        if acceleration is not None and not 0.0 < acceleration < 200.5 * DEGREE:
            raise ValueError(f"{acceleration / DEGREE:g} °/s^2: want 0 to 200")
        self._order = (omega, acceleration)

    # --- the motion

    def items(self, table: DrivenTable, truths, faults: Faults) -> Iterator[Item]:
        """Samples and pulses while somebody drives, and until the table stands after that."""
        self._table, self.driving = table, True
        log.info("the table is driven, from %.1f deg/s on", table.rate() / DEGREE)
        pending: list[BoardPulse] = []
        while self.remote or not table.standing:
            self._steer(table)
            block, pulses = table.step(STEP)
            block = faults.into(block)
            pending += [BoardPulse(pulse.t_s, pulse.direction) for pulse in pulses]
            for row in range(len(block.t_s)):
                t = float(block.t_s[row])
                while pending and pending[0].t_s <= t:
                    yield pending.pop(0)
                truths.put(block.index + row, t, block.truth(row))
                yield BoardAccel(t, tuple(block.counts[row].tolist()))
        self._table, self.driving, self.given_back = None, False, True
        log.info("the table is left to its profile")

    def _steer(self, table: DrivenTable) -> None:
        omega, acceleration = self._order
        if not self._by_line:
            seconds = STEP * table.period_s
            omega = self._person.step(self._hand_rate or 0.0, seconds)
            even = abs(omega - table.rate()) / seconds
            acceleration = float(np.clip(even, 1e-3, table.acceleration))
        table.set_rate(np.clip(omega, -table.limit, table.limit), acceleration)
        if self._wanted_up is not None and table.standing:
            if table.turn_over(self._wanted_up):
                self._wanted_up = None


def _watchdog(seconds: float) -> float:
    """Patience of the table's watchdog, s; 0 is none. Raises ValueError."""
    if seconds == 0.0:
        return np.inf
    if not 0.5 <= seconds <= 60.0:
        raise ValueError(f"{seconds:g} s: want 0 (none), or 0.5 to 60")
    return seconds


def until_it_ends(items: Iterator[Item], seconds: float, desk: TableDesk) -> Iterator[Item]:
    """The items of a run: the profile's length, or for as long as somebody drives the table."""
    for item in items:
        if (item.t_s >= seconds and not desk.driving) or desk.given_back:
            return
        yield item
