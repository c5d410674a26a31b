"""Goes from step to step: commands the table or tells the person, begins a watch, takes what comes
of it. One for each device; the service gives it data and orders on one thread, and `emergency` from
any.
"""

import logging
import math
import time
from collections.abc import Callable

from sessions.procedure.driven.description import TableError
from sessions.procedure.driven.drive import Drive
from sessions.procedure.driven.table import RateTable
from sessions.procedure.model import Step
from sessions.procedure.recorded import Recorded
from sessions.procedure.run import ABORTED, DONE, HELD, RUNNING, STOPPED, Journal
from sessions.procedure.seen import Samples, Seen, TableSays, Trouble
from sessions.procedure.watch import State, Watch

log = logging.getLogger(__name__)

SILENT_S = 5.0  # s without a sample: a driven table is stopped
UNRECORDED_S = 6.0  # s that nothing is recorded: the table is stopped
ENDING_S = 60.0  # s that the end waits for a recorder to come back
PATIENCE_S = 20.0  # s beyond the ramp that a driven table may need to get there

Say = Callable[[str, int, float], None]  # remark, its moment by the data's clock, its length in s


class Conductor:
    """Of one run. `journal` has its state; `record` begins (True) and ends a recording."""

    def __init__(
        self,
        journal: Journal,
        table: RateTable | None,
        say: Say,
        record: Callable[[bool], str],
        silence: Callable[[], str] = lambda: "",
    ) -> None:
        """record(on): begin or end the recording of this run; what could not be done, or empty.
        silence(): why no samples come, as far as it is known.
        """
        self.journal, self.run = journal, journal.run
        self.drive = Drive(table)
        self.recorded = Recorded()
        self._say, self._record, self._silence = say, record, silence
        first = self.run.plan.steps[0]
        self.watch = Watch(first, 0.0, self.run.plan.vibration_max)
        self._heard = time.monotonic()
        self._closing_since: float | None = None
        self._unrecorded_at = -math.inf  # while it is being ended

    # --- orders

    def begin(self) -> None:
        """Take the table and go to the first step, or on with the one that was being done."""
        problem = self.drive.take()
        if self.run.emergency and not self.run.over:
            self._end(STOPPED, "emergency stop, before the service was restarted")
        if self.run.over or self.run.state == HELD:
            return  # killed while it ended, or while a person was asked
        if problem:
            self._hold(problem)
            return
        if self.run.at < 0:
            self._go(0)
        elif self._watched and self.run.steps[self.run.at].state == "active":
            self._spoilt("the procedures service was cut off and started again")
        else:
            self._go(self.run.at)

    def next(self, by: str, text: str) -> str:
        """An open step is done, or a failed one is left out; empty, or why not."""
        step = self._step
        if self.run.over:
            return "the run has ended"
        if self.run.state == HELD:
            if problem := self.drive.take():
                return problem
            self.journal.add("skipped", k=self.run.at, by=by)
            self._go(self.run.at + 1)
            return ""
        if step is None or step.kind != "open":
            return "this step goes on by itself; repeat or abort are the orders for it"
        if step.ask and not text.strip():
            return f"what was read is not given: {step.ask}"
        said = f"{step.ask}: {text.strip()}" if step.ask else text.strip()
        self.journal.add("done", k=self.run.at, by=by, text=said)
        self._say(f"{step.name}: confirmed by {by or 'somebody'} {said}".rstrip(), 0, 0.0)
        self._go(self.run.at + 1)
        return ""

    def repeat(self, by: str) -> str:
        """Begin the present step anew; empty, or why not."""
        if self.run.over:
            return "the run has ended"
        if problem := self.drive.take() or self._record_again():
            return problem
        self._say(f"step {self.run.at + 1} is repeated by {by or 'somebody'}", 0, 0.0)
        self._go(max(self.run.at, 0))
        return ""

    def abort(self, by: str) -> str:
        """End the run; the table goes to rest by its ramp."""
        if self.run.over:
            return "the run has ended"
        self._end(ABORTED, f"aborted by {by or 'somebody'}")
        return ""

    def emergency(self) -> str:
        """Stop the table at once, from any thread, and never turn it again in this run, whatever
        dies; what went wrong, or empty.
        """
        problem = self.drive.stop()
        self.journal.add("emergency")
        return problem

    def abandon(self) -> None:
        """Another process runs this now: command nothing any more, not even to stand."""
        self.drive.abandon()

    def stopped(self, by: str) -> None:
        """After `emergency`: the run has ended."""
        if not self.run.over:
            self._end(STOPPED, f"emergency stop by {by or 'somebody'}")

    # --- data and time

    def take(self, seen: Seen) -> None:
        """Something was seen on the bus."""
        if isinstance(seen, Samples):
            self._heard = time.monotonic()
            if not self.run.started_utc_ns:
                self.journal.add("began", utc_ns=seen.utc_ns)
        self.watch.take(seen)
        if self.watch.over and self.run.state == RUNNING and self._watched:
            self._judge()

    def tick(self) -> None:
        """A few times a second: ask the table, notice silence, close what has ended."""
        now = time.monotonic()
        self.journal.save()
        if self.run.over:
            self._close(now)
            return
        if self.journal.fault and self.run.state == RUNNING:
            self._hold(f"what happens cannot be saved: {self.journal.fault}: make room")
        try:
            told = self.drive.ask(now)
            if told is not None:
                self.watch.take(TableSays(told))
        except TableError as error:
            if self.run.state == RUNNING:
                self._hold(str(error))
        if self._watched and self.run.state == RUNNING:
            self._look_around(now)

    def _look_around(self, now: float) -> None:
        """Samples that do not come, and a recording that does not go on, spoil what is measured;
        where that lasts, the table is stopped and a person asked.
        """
        self._follow_recording()
        why, since = self.recorded.trouble(self.run, now), self.recorded.since
        lasts = since is not None and now - since > UNRECORDED_S
        if self.silent_s > SILENT_S:
            why, lasts = f"no samples for {self.silent_s:.0f} s", self.drive.turns
            if known := self._silence():
                why += f": {known}"
        if not why:
            return
        self.watch.take(Trouble(why))
        if self.watch.over:
            self._spoilt(self.watch.reason, lasts)
        elif lasts:
            self._hold(why)

    @property
    def silent_s(self) -> float:
        """s since the last sample."""
        return time.monotonic() - self._heard

    @property
    def _step(self) -> Step | None:
        steps = self.run.plan.steps
        return steps[self.run.at] if 0 <= self.run.at < len(steps) else None

    @property
    def _watched(self) -> bool:
        step = self._step
        return step is not None and step.kind in ("still", "rate", "pose")

    # --- the way

    def _go(self, k: int) -> None:
        """Begin step k, or end after the last."""
        steps = self.run.plan.steps
        while k < len(steps) and steps[k].kind == "record":
            self.journal.add("step", k=k)
            self.journal.add("done", k=k, text=self._record(steps[k].on))
            k += 1
        if k >= len(steps):
            self._end(DONE, "")
            return
        step = steps[k]
        self.journal.add("step", k=k)
        procedure, plan = self.run.plan.procedure, self.run.plan
        patience = math.inf
        if self.drive.table is not None and step.kind in ("rate", "still"):
            patience = step.ramp_s + procedure.settle_s + PATIENCE_S
        before = self.watch
        self.watch = before.then(step, procedure.settle_s, plan.vibration_max, patience)
        target = step.target if step.kind == "rate" else 0.0
        try:
            self.drive.turn(target, step.ramp_s)
        except TableError as error:
            self._hold(str(error))

    def _judge(self) -> None:
        """What the watch came to."""
        watch, k, step = self.watch, self.run.at, self.watch.step
        if watch.state is State.FULL:
            estimator = self.run.plan.procedure.estimator
            figures = [
                {"name": f.name, "value": _known(f.value), "sigma": _known(f.sigma)}
                for f in watch.live.figures(step, estimator)
            ]
            begin, until = watch.utc_ns(watch.begin), watch.utc_ns(watch.until)
            window = {
                "epoch": watch.epoch,
                "from_us": round(watch.begin * 1e6),
                "until_us": round(watch.until * 1e6),
                "from_utc_ns": begin,
                "until_utc_ns": until,
            }
            source = watch.reference.source if watch.reference is not None else ""
            self.journal.add("done", k=k, window=window, figures=figures, reference=source)
            self._say(f"step {k + 1}, {step.name}: measured", begin, step.dwell_s)
            self._go(k + 1)
            return
        self._spoilt(watch.reason)

    def _spoilt(self, why: str, lasts: bool = False) -> None:
        """The attempt is void, and the step begins anew; a person is asked where what spoils it
        lasts, or comes too often.
        """
        k = self.run.at
        self.journal.add("spoilt", k=k, reason=why)
        self._say(f"step {k + 1}, {self.run.plan.steps[k].name}: spoilt: {why}", 0, 0.0)
        if lasts or self.run.steps[k].spoilt > self.run.plan.procedure.repeats:
            self._hold(why)
        else:
            self._go(k)

    def _hold(self, why: str) -> None:
        """A person is needed; the table stands meanwhile."""
        k = max(self.run.at, 0)
        if self.run.at < 0:
            self.journal.add("step", k=0)
        self.journal.add("failed", k=k, reason=why)
        self._say(f"step {k + 1} is held: {why}", 0, 0.0)
        self.drive.stand()

    def _end(self, state: str, message: str) -> None:
        self.journal.add("end", state=state, message=message)
        self._say(f"procedure {self.run.plan.name}: {state} {message}".rstrip(), 0, 0.0)
        self.drive.stand(2.0)

    def _close(self, now: float) -> None:
        """Once the table stands, let it go, then end the recording."""
        if self.run.closed:
            return
        if self._closing_since is None:
            self._closing_since = now
            return  # one more status goes out, and into the recording
        if now - self._closing_since < 1.0:
            return
        if not self.drive.let_go(now, self._closing_since) or self.journal.fault:
            return
        problem = self._end_recording(now)
        if problem and now - self._closing_since < ENDING_S:
            return
        if problem:
            log.error("%s", problem)
            problem = f"the end of the run is not in its recording: {problem}"
        self.journal.add("closed", problem=problem)

    def _end_recording(self, now: float) -> str:
        """What could not be done, or empty. A recorder that is away just now is waited for, until
        it has written how the run ended.
        """
        self._follow_recording()
        if trouble := self.recorded.trouble(self.run, now):
            self._unrecorded_at = now
            return trouble
        if now - self._unrecorded_at < 1.0:
            return "how it ended is being written"
        return self._record(False) if self.run.own_session else ""

    def _follow_recording(self) -> None:
        if session := self.recorded.goes_on_in(self.run):
            self._recorded_in(session, self.run.was_recording)

    def _recorded_in(self, session: str, was_recording: bool) -> None:
        self.journal.add("session", id=session, was_recording=was_recording)

    def _record_again(self) -> str:
        """Where nothing is recorded: a recording anew; what could not be done, or empty."""
        said = self.recorded
        self._follow_recording()
        trouble = said.trouble(self.run, time.monotonic())
        if said.since is None:
            return ""
        if not said.ended:
            return trouble
        if self.run.own_session:
            return self._record(True)
        if not said.session:
            return "nothing is recorded: begin a recording first"
        self._recorded_in(said.session, True)
        return ""


def _known(value: float) -> float | None:
    return value if value == value else None
