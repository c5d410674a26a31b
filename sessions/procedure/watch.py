"""Is a step done well? A state machine on the live data, in the board's time; no time of day.

    WAITING -> RAMP -> SETTLED -> DWELL -> FULL
                                     '---> SPOILT, with the reason

It looks every TICK of the board's clock, LAG behind the newest sample, so that pulses and estimates
of that moment have come. The same data give the same states, however they are cut into messages.
The rate is judged by the tachometer where there is one; the estimators are what is tested.
"""

from dataclasses import dataclass, field
from enum import Enum

import numpy as np

from inertial.constants import GRAVITY, MILLI_G
from sessions.procedure.evidence import Evidence, Reference
from sessions.procedure.live import Live
from sessions.procedure.model import DEG, Step
from sessions.procedure.seen import (
    Axes,
    Line,
    Pulse,
    Samples,
    Seen,
    TableSays,
    Trouble,
    Turned,
)

TICK = 0.05  # s, of the board's clock
LAG = 0.15  # s, pulses wait for company and estimates are computed
HOLE = 0.25  # s without samples that spoil a dwell
FACE = 20.0 * DEG  # rad, between a face and the vertical
# the same in a dwell: of a table that stops at once the last pulse is earlier than the last turn,
# and of what comes in one rush, after this process was held up, the pulses may be the last
AGAINST_DWELL_S = 0.4
AGAINST_S = 1.5  # s that others may contradict it: its first pulse is late, a table's word is old
GRAVITY_OFF = 0.15  # of 1, of the specific force of a body at rest


class State(Enum):
    """Where a step stands."""

    WAITING = "waiting"
    RAMP = "ramp"
    SETTLED = "settled"
    DWELL = "dwell"
    FULL = "full"
    SPOILT = "spoilt"


@dataclass
class Watch:
    """One attempt at one step. take() tells it what was seen; the fields say where it stands."""

    step: Step
    settle_s: float
    vibration_max: float  # m/s^2 RMS
    patience_s: float = float("inf")  # to get there; of a driven table
    state: State = State.WAITING
    reason: str = ""  # why it waits or was spoilt
    begin: float = 0.0  # s, of the dwell, board's clock
    epoch: int = -1
    live: Live = field(default_factory=Live)
    reference: Reference | None = None
    evidence: Evidence = field(default_factory=Evidence)
    now: float = -np.inf  # s, the newest sample
    _tick: float = np.nan  # the next look
    _first: float = np.nan  # the first look of this attempt
    _since: float = 0.0  # s, settled
    _against: float = np.nan  # s, since then the tachometer is contradicted
    _utc: tuple[float, int] = (0.0, 0)  # a moment on both clocks

    def then(
        self, step: Step, settle_s: float, vibration_max: float, patience_s: float = float("inf")
    ) -> "Watch":
        """The watch of the next attempt, which goes on with the same data."""
        after = Watch(step, settle_s, vibration_max, patience_s, epoch=self.epoch)
        after.evidence, after.reference, after.now = self.evidence, self.reference, self.now
        after._tick, after._first, after._utc = self._tick, self._tick, self._utc
        return after

    @property
    def until(self) -> float:
        """End of the dwell, s, board's clock."""
        return self.begin + self.step.dwell_s

    @property
    def over(self) -> bool:
        """Full or spoilt: nothing changes any more."""
        return self.state in (State.FULL, State.SPOILT)

    @property
    def progress(self) -> float:
        """0 to 1 of the dwell."""
        if self.state is State.FULL:
            return 1.0
        if self.state is not State.DWELL or not self.step.dwell_s:
            return 0.0
        return float(np.clip((self._tick - TICK - self.begin) / self.step.dwell_s, 0.0, 1.0))

    def utc_ns(self, t: float) -> int:
        """A moment of the board's clock by the data's clock."""
        at, utc_ns = self._utc
        return utc_ns + round((t - at) * 1e9)

    def take(self, seen: Seen) -> None:
        """Something was seen."""
        if self.over:
            return
        match seen:
            case Samples():
                self._take_samples(seen)
            case Pulse() if seen.epoch == self.epoch:
                self.evidence.add_pulse(seen)
            case Turned() if seen.epoch == self.epoch:
                self.evidence.add_estimates(seen)
            case Axes() if seen.epoch == self.epoch:
                self.evidence.health.append(seen)
            case TableSays() if np.isfinite(self.now):
                self.evidence.table_says(self.now, seen.omega)
            case Line() if not seen.connected:
                self._broken(f"the line to the board is down: {seen.text}".rstrip(": "))
            case Trouble():
                self._broken(seen.text)

    def _take_samples(self, seen: Samples) -> None:
        first = float(seen.t[0])
        if self.epoch >= 0 and seen.epoch != self.epoch:
            self._broken("the board has restarted")
            self.evidence.forget()
            self.epoch, self.now, self._tick = seen.epoch, -np.inf, np.nan
        elif first > self.now + HOLE and np.isfinite(self.now):
            self._broken(f"data lost: {first - self.now:.2f} s without samples")
            self.evidence.samples.clear()
            self._tick = first
        if self.over:
            return
        fresh = seen.t[seen.t > self.now]  # what is filled in late is for the report
        if not len(fresh):
            return
        self.epoch = seen.epoch
        self.evidence.add_samples(fresh, seen)
        self._utc = (first, seen.utc_ns)
        if not np.isfinite(self._tick):
            self._tick = self._first = float(fresh[0])
        self.now = float(fresh[-1])
        while not self.over and self._tick + LAG <= self.now:
            self._look(self._tick)
            self._tick += TICK
        self.evidence.trim(self._tick)

    def _broken(self, why: str) -> None:
        """What was begun cannot go on; before that it is only said."""
        if self.state is State.DWELL:
            self.state = State.SPOILT
        elif self.state is not State.SPOILT:
            self.state = State.WAITING
        self.reason = why

    def _look(self, t: float) -> None:
        """The state at a moment that all data have come for."""
        self.reference = self.evidence.reference(t)
        shaking = self.evidence.vibration(t, self.reference)
        fault = self._fault(t, shaking)
        if self.state is State.DWELL:
            self._dwell(t, fault, shaking)
        elif fault:
            self._not_there(t, fault)
        else:
            if self.state is not State.SETTLED:
                self.state, self._since, self.reason = State.SETTLED, t, ""
            if t - self._since >= self.settle_s - 1e-9:
                self.state, self.begin, self.live = State.DWELL, t, Live()

    def _dwell(self, t: float, fault: str, shaking: float | None) -> None:
        if fault:
            self._broken(fault)
            return
        newest, force = self.evidence.newest(t), self.evidence.force(t)
        self.live.add(t - self.begin, self.reference, shaking, newest, force)
        if t - self.begin >= self.step.dwell_s - 1e-9:
            self.state, self.reason = State.FULL, ""

    def _not_there(self, t: float, fault: str) -> None:
        turning = self.reference is not None and abs(self.reference.omega) > 1.0 * DEG
        ramp = self.step.kind == "rate" and turning
        self.state, self.reason = (State.RAMP if ramp else State.WAITING), fault
        if t - self._first > self.patience_s:
            self.state = State.SPOILT
            self.reason = f"not there within {self.patience_s:.0f} s: {fault}"

    def _fault(self, t: float, shaking: float | None) -> str:
        """Why the step cannot be measured at this moment; empty: it can."""
        axes = self.evidence.axes(t)
        if axes is not None and axes.unfit:
            return "; ".join(text for _, text in axes.unfit)
        wrong = self._not_posed(t) if self.step.kind == "pose" else self._not_turning_so(t)
        if wrong:
            return wrong
        if shaking is None:
            return "waiting for samples"
        if shaking > self.vibration_max:
            found, most = shaking / MILLI_G, self.vibration_max / MILLI_G
            return f"too much vibration: {found:.0f} mg RMS, at most {most:.0f}"
        return ""

    def _not_turning_so(self, t: float) -> str:
        found, want = self.reference, self.step.target
        if found is None:
            return "the rate is not known: no tachometer has pulsed and no estimator is sure"
        if contradicted := self._contradicted(t, found):
            self._against = t if np.isnan(self._against) else self._against
            in_dwell = self.state is State.DWELL
            if t - self._against > (AGAINST_DWELL_S if in_dwell else AGAINST_S):
                return contradicted
            if in_dwell:
                return ""  # not yet; at its end the recording is asked again
        else:
            self._against = np.nan
        omega, target = found.omega, want
        if not found.signed:
            omega, target = abs(omega), abs(want)
        if abs(omega - target) <= self.step.tolerance:
            return ""
        said = f"it turns at {omega / DEG:+.1f} °/s, wanted"
        if self.step.kind == "still":
            return f"{said} standstill"
        wanted = f"{said} {target / DEG:+.1f} ± {self.step.tolerance / DEG:g}"
        other_way = abs(omega + target) <= self.step.tolerance and found.signed
        return wanted + (": the other way round" if other_way else self._table_differs(found))

    def _table_differs(self, found: Reference) -> str:
        """A table that takes itself for right: its unit or sign may be described wrongly."""
        said = self.evidence.steady(self.now)
        if found.source == "table" or said is None:
            return ""
        if abs(said - self.step.target) > self.step.tolerance:
            return ""
        return f"; the table says {said / DEG:+.1f}: look at unit and sign in its description"

    def _contradicted(self, t: float, found: Reference) -> str:
        """Who else says something that the tachometer cannot be right with; or empty."""
        if found.source != "tachometer":
            return ""
        allowed = max(self.step.tolerance, 0.1 * abs(found.omega), 2.0 * DEG)

        def off(omega: float) -> float:
            return abs(omega - found.omega) if found.signed else abs(abs(omega) - abs(found.omega))

        votes, table = self.evidence.votes(t), self.evidence.steady(self.now)
        if any(off(0.0 if v.still else v.omega) <= allowed + 5.0 * v.sigma for v in votes):
            return ""
        if table is not None and off(table) > allowed:
            other, omega = "the table", table
        elif table is None and votes and self.evidence.overdue(t):
            other, omega = votes[0].estimator, votes[0].omega
        else:
            return ""
        if self.evidence.overdue(t):
            return (
                f"the tachometer is silent, {other} says {omega / DEG:+.1f} °/s: see to its cable"
            )
        return (
            f"the tachometer says {found.omega / DEG:+.1f} °/s, {other} {omega / DEG:+.1f}: look at"
            " its pulses per revolution, and at unit and sign in the table's description"
        )

    def _not_posed(self, t: float) -> str:
        if self.reference is not None and abs(self.reference.omega) > 2.0 * DEG:
            return f"it turns at {self.reference.omega / DEG:+.1f} °/s: let it rest"
        force = self.evidence.force(t)
        if force is None:
            return "the direction of gravity is not known yet"
        size = float(np.linalg.norm(force))
        if abs(size / GRAVITY - 1.0) > GRAVITY_OFF:
            return f"it moves, or is scaled wrongly: it feels {size / GRAVITY:.2f} g"
        up = np.asarray(self.step.up_b, dtype=float)
        off = float(np.arccos(np.clip(force @ up / size, -1.0, 1.0)))
        return "" if off <= FACE else f"another face is up: {off / DEG:.0f} deg off"
