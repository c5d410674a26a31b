"""What a scenario is: the fault, what may be lost, what must be said, and how it is judged.

A scenario is recorded from before its fault until all is well again and a moment longer. Its
recordings are then counted sample by sample, and what is missing must be exactly what the
completeness certificate says, and no more than the scenario allows.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

from faults.account import Account, account
from faults.ground import Ground

BEFORE_S, AFTER_S = 0.7, 0.7  # that is recorded around it


class Unmet(AssertionError):
    """What a scenario wants and did not get."""


@dataclass(frozen=True)
class Run:
    """A scenario as it was carried out, for those who judge it."""

    bench: Ground
    log_from: int  # the character at which its part of the log begins
    account: Account


class Word(Protocol):
    """Something that is said: `text` for the table, `heard` in a run, or why not."""

    text: str

    def heard(self, run: Run) -> bool: ...


@dataclass(frozen=True)
class Line:
    """A line of the log; pattern: where it is not the text itself."""

    text: str
    pattern: str = ""

    def heard(self, run: Run) -> bool:
        return run.bench.said(self.pattern or self.text, run.log_from)


@dataclass(frozen=True)
class Brief:
    """The log stays readable, and its disk does not fill."""

    lines: int

    @property
    def text(self) -> str:
        return f"in at most {self.lines} lines"

    def heard(self, run: Run) -> bool:
        return run.bench.text().count("\n", run.log_from) <= self.lines


@dataclass(frozen=True)
class Alarmed:
    """An alarm that was there, and is gone."""

    id: str

    @property
    def text(self) -> str:
        return f"alarm `{self.id}`"

    def heard(self, run: Run) -> bool:
        watch = run.bench.watch
        if self.id in watch.alarms:
            run.bench.until(lambda: self.id not in watch.active, f"end of the alarm {self.id}")
        return self.id in watch.alarms


@dataclass(frozen=True)
class Status:
    """A field of a status that said so: of "links", "states" (the recorder's) or "filters"."""

    text: str
    of: str
    condition: Callable[[object], bool]

    def heard(self, run: Run) -> bool:
        return any(self.condition(one) for one in list(getattr(run.bench.watch, self.of)))


@dataclass(frozen=True)
class Certified:
    """What stands in the certificates."""

    text: str
    condition: Callable[[Account], bool]

    def heard(self, run: Run) -> bool:
        return self.condition(run.account)


@dataclass(frozen=True)
class Loss:
    """What may be lost."""

    text: str = "nothing"
    samples: tuple[int, int] = (0, 0)  # at least and at most
    complete: bool | None = True  # the certificates say so; None: as it comes
    unestimated: int = 0  # samples without an estimate at most
    boots: int = 1
    gone: int = 0  # recordings


NOTHING = Loss()


@dataclass(frozen=True)
class Scenario:
    """One row of the table."""

    name: str
    fault: str
    act: Callable[[Any], None]  # does it, and takes it away again
    lost: Loss = NOTHING
    said: tuple[Word, ...] = ()
    quick: bool = False  # is run by `make test`, too
    needs: Callable[[Any], str] = lambda bench: ""  # why it cannot be done here
    well: Callable[[Any], bool] = lambda bench: True  # beyond what every bench must be
    on: str = ""  # the kind of bench that it takes, of BENCHES in test_faults.py


@dataclass(frozen=True)
class Measured:
    """What came of one."""

    account: Account
    well_s: float  # from the fault's end until all was well
    unnamed: tuple[str, ...]  # alarms that were heard, too, which the scenario does not name


def run(bench: Ground, scenario: Scenario) -> Measured:
    """Do it and judge it; raises Unmet, NotWell."""
    watch = bench.watch
    bench.until(bench.well, f"bench before {scenario.name}")
    watch.begin()
    log_from = len(bench.text())
    watch.record(scenario.name)
    time.sleep(BEFORE_S)
    scenario.act(bench)
    began, since = time.monotonic(), time.monotonic_ns()
    bench.until(lambda: bench.well(since) and scenario.well(bench), "good end")
    well_s = time.monotonic() - began
    time.sleep(AFTER_S)
    bench.until(lambda: bench.well(0), "recording without a gap")
    watch.stop()
    bench.settle()
    counted = account(bench.sessions.path, list(watch.recording), watch.durable)
    heard = set(watch.alarms)
    judge(scenario, Run(bench, log_from, counted))
    named = {word.id for word in scenario.said if isinstance(word, Alarmed)}
    return Measured(counted, well_s, tuple(sorted(heard - named)))


def judge(scenario: Scenario, run: Run) -> None:
    """Raises Unmet with everything that is not as it should be."""
    counted, lost = run.account, scenario.lost
    least, most = lost.samples
    checks = {
        "samples that were recorded": counted.samples > 0,
        f"{least} to {most} samples missing": least <= counted.missing <= most,
        "as many missing as the certificate says": counted.missing == counted.said_missing,
        "every message once": counted.twice == 0,
        "all that was acknowledged": counted.acknowledged_lost == 0,
        # a busy machine: the estimator says so, and loses no sample by it
        "estimates of all samples": counted.unestimated <= lost.unestimated
        or run.bench.thinned(run.log_from),
        f"{lost.gone} recordings deleted": counted.gone == lost.gone,
        f"complete: {lost.complete}": lost.complete in (None, counted.complete),
        f"{lost.boots} boots of the board": counted.boots == lost.boots,
    }
    wrong = [what for what, good in checks.items() if not good]
    wrong += [f"said: {word.text}" for word in scenario.said if not word.heard(run)]
    if wrong:
        said = run.bench.text()[run.log_from :][-3000:]
        raise Unmet(f"{scenario.name}: wanted {'; '.join(wrong)}\n{counted}\n{said}")
