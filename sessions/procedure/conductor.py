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
from sessions.procedure.seen import Axes, Samples, Seen, TableSays, Trouble
from sessions.procedure.watch import State, Watch

log = logging.getLogger(__name__)

SILENT_S = 5.0  # s without a sample: a driven table is stopped
ENDING_S = 60.0  # s that the end waits for a recorder to come back
NAMED_S = 2.0  # s until an axis that goes wrong is named
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
        self.recorded = Recorded(journal, record)
        self._say, self._record, self._silence = say, record, silence
        first = self.run.plan.steps[0]
        self.watch = Watch(first, 0.0, self.run.plan.vibration_max)
        self._heard = time.monotonic()
        self._closing_since: float | None = None

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
        if problem := self.drive.take() or self.recorded.again():
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
        if isinstance(seen, Axes) and seen.unfit and self.run.state == RUNNING:
            self._doubt(seen)
        if isinstance(seen, Samples):
            self._heard = time.monotonic()
            if not self.run.started_utc_ns:
                self.journal.add("began", utc_ns=seen.utc_ns)
        self.watch.take(seen)
        if self.run.state != RUNNING or not self._watched:
            return
        if self.watch.over:
            self._judge()
        elif isinstance(seen, Samples) and self._other_boot():
            self._spoilt("the board has restarted")

    def _doubt(self, seen: Axes) -> None:
        """An axis is called unfit soon after a dwell: it may have been so within it."""
        k = self.run.at - 1
        window = self.run.steps[k].window if k >= 0 else {}
        if not window or window["epoch"] != seen.epoch:
            return
        if seen.t - window["until_us"] * 1e-6 <= NAMED_S:
            self._spoilt("; ".join(text for _, text in seen.unfit), k=k)

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
        why, lasts = self.recorded.trouble(now), self.recorded.lasts(now)
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
        """Begin step k, or end after the last; all of it anew where the board has begun anew."""
        steps = self.run.plan.steps
        if why := self._other_boot():
            k = 0
            self.journal.add("anew", reason=why)
            self._say(f"begun anew: {why}", 0, 0.0)
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

    def _other_boot(self) -> str:
        """Why what was measured cannot be judged with what comes: a report is of one boot of a
        board; empty where it can.
        """
        boots = {one.window["epoch"] for one in self.run.steps if one.window}
        if self.watch.epoch < 0 or not boots - {self.watch.epoch}:
            return ""
        return "measured before the board restarted: a report is of one boot"

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

    def _spoilt(self, why: str, lasts: bool = False, k: int | None = None) -> None:
        """The last attempt at step k (the present one) is void, and it begins anew; a person is
        asked where what spoils it lasts, or comes too often.
        """
        k = self.run.at if k is None else k
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
        problem = self.recorded.end(now)
        if problem and now - self._closing_since < ENDING_S:
            return
        if problem:
            log.error("%s", problem)
            problem = f"the end of the run is not in its recording: {problem}"
        self.journal.add("closed", problem=problem)


def _known(value: float) -> float | None:
    return value if value == value else None
