"""One run of a procedure, as the list of what happened: an append-only file, from which a process
that was killed goes on.

Every line is a JSON object with `e`, its kind. A line that a crash cut off is left out.
"""

import json
import logging
import os
import threading
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from inertial.whole_file import sync_folder
from sessions.procedure.library import ProcedureError, of_text
from sessions.procedure.model import Plan

log = logging.getLogger(__name__)

RUNNING, HELD, DONE, ABORTED, STOPPED = "running", "held", "done", "aborted", "stopped"
OVER = (DONE, ABORTED, STOPPED)
TROUBLE = 16  # reasons that are kept of a step


@dataclass
class StepRecord:
    """What is known of one step."""

    attempts: int = 0
    spoilt: int = 0
    state: str = "todo"  # todo, active, done, failed, skipped
    reason: str = ""
    trouble: list[str] = field(default_factory=list)  # why attempts were spoilt or held
    confirmed_by: str = ""
    window: dict[str, int] = field(default_factory=dict)  # epoch, from_us, until_us, *_utc_ns
    figures: list[dict[str, Any]] = field(default_factory=list)
    reference: str = ""

    def went_wrong(self, why: str) -> None:
        """Keep it, once where it is said again."""
        if self.trouble[-1:] != [why]:
            self.trouble = [*self.trouble, why][-TROUBLE:]


@dataclass
class Run:
    """Its state, made of events alone: the same events give the same state."""

    id: str
    device: str
    plan: Plan
    unit: str
    operator: str
    own_session: bool
    session: str = ""
    was_recording: bool = False
    recorded: bool = False  # it should be, now
    state: str = RUNNING
    at: int = -1  # present step
    started_utc_ns: int = 0
    closed: bool = False
    emergency: bool = False  # the table was stopped: it is not turned again
    message: str = ""
    steps: list[StepRecord] = field(default_factory=list)

    @property
    def over(self) -> bool:
        """It has ended, one way or another."""
        return self.state in OVER

    def apply(self, event: dict[str, Any]) -> None:
        """One thing that happened."""
        kind, k = event["e"], event.get("k", self.at)
        step = self.steps[k] if 0 <= k < len(self.steps) else StepRecord()
        match kind:
            case "session":
                self.session, self.was_recording = event["id"], event["was_recording"]
                self.recorded = True
            case "began":
                self.started_utc_ns = event["utc_ns"]
            case "step":
                self.at, self.state = k, RUNNING
                step.state, step.attempts, step.reason = "active", step.attempts + 1, ""
                step.window, step.figures = {}, []  # of an attempt that does not count any more
            case "spoilt":
                step.spoilt, step.reason = step.spoilt + 1, event["reason"]
                step.went_wrong(event["reason"])
                self.message = f"{self.plan.steps[k].name}: spoilt: {event['reason']}"
            case "anew":
                for one in self.steps:
                    if one.window:
                        one.state, one.window, one.figures = "todo", {}, []
                        one.spoilt, one.reference = one.spoilt + 1, ""
                        one.went_wrong(event["reason"])
            case "failed":
                step.state, step.reason, self.state = "failed", event["reason"], HELD
                step.went_wrong(event["reason"])
                self.message = f"{self.plan.steps[k].name}: {event['reason']}"
            case "done":
                step.state, step.reason = "done", event.get("text", "")
                step.window, step.figures = event.get("window", {}), event.get("figures", [])
                step.confirmed_by = event.get("by", "")
                step.reference, self.message = event.get("reference", ""), ""
                if self.plan.steps[k].kind == "record" and not self.plan.steps[k].on:
                    self.recorded = False
            case "skipped":
                step.state, step.confirmed_by = "skipped", event["by"]
                self.state = RUNNING
            case "end":
                self.state, self.message = event["state"], event.get("message", "")
                if step.state == "active":
                    step.state, step.reason = "failed", self.message
            case "emergency":
                self.emergency = True
            case "closed":
                self.closed, self.message = True, event.get("problem") or self.message


class Journal:
    """The file of one run; `run` is what its events come to.

    What a full disk does not take is kept, in order, and tried again by `save`; `fault` says why.
    """

    def __init__(self, path: Path, run: Run) -> None:
        self.path, self.run, self.fault = path, run, ""
        self._lock = threading.RLock()
        self._unsaved = b""

    @classmethod
    def begin(cls, root: Path, start: dict[str, Any]) -> "Journal":
        """A new run; raises OSError, ProcedureError."""
        folder = root / start["device"]
        folder.mkdir(parents=True, exist_ok=True)
        journal = cls(folder / f"{start['run']}.jsonl", _run_of(start))
        try:
            journal._write(_line({"e": "start"} | start))
            sync_folder(folder)
        except OSError:
            journal.path.unlink(missing_ok=True)  # half a run would be taken for a damaged one
            raise
        return journal

    @classmethod
    def read(cls, path: Path) -> "Journal":
        """A run that was begun before; raises ProcedureError for a file that is none, OSError."""
        whole, _, rest = path.read_bytes().rpartition(b"\n")
        events = []
        for line in whole.split(b"\n"):
            try:
                event = json.loads(line)
            except ValueError:
                event = None
            if not isinstance(event, dict) or "e" not in event:
                log.warning("%s: a damaged line is left out", path)
                continue
            events.append(event)
        if not events or events[0]["e"] != "start":
            raise ProcedureError(f"{path}: no beginning of a run")
        try:
            run = _run_of(events[0])
            for event in events[1:]:
                run.apply(event)
        except (KeyError, TypeError, ValueError) as error:
            raise ProcedureError(f"{path}: damaged ({type(error).__name__}: {error})") from None
        if rest:  # what a crash cut off must not become the beginning of the next line
            with path.open("r+b") as file:
                file.truncate(len(whole) + 1)
        return cls(path, run)

    def add(self, kind: str, **more: Any) -> None:
        """Something happened: on the disk first, then in the state. From any thread."""
        event = {"e": kind} | more
        with self._lock:
            self._unsaved += _line(event)
            self.save()
            self.run.apply(event)

    def save(self) -> None:
        """What the disk did not take, once more."""
        with self._lock:
            if not self._unsaved:
                return
            try:
                self._write(self._unsaved)
            except OSError as error:
                if not self.fault:
                    log.error("%s: %s", self.path, error.strerror)
                self.fault = error.strerror or str(error)
            else:
                self.fault, self._unsaved = "", b""

    def _write(self, lines: bytes) -> None:
        """All or nothing; raises OSError."""
        with self.path.open("ab", buffering=0) as file:
            before = os.fstat(file.fileno()).st_size
            try:
                while lines:
                    lines = lines[file.write(lines) :]
                os.fsync(file.fileno())
            except OSError:
                file.truncate(before)
                raise


def _line(event: dict[str, Any]) -> bytes:
    return json.dumps(event, ensure_ascii=False, separators=(",", ":")).encode() + b"\n"


def _run_of(start: dict[str, Any]) -> Run:
    plan = of_text(start["toml"], start["procedure"])
    fields = {name: start[name] for name in ("device", "unit", "operator", "own_session")}
    run = Run(id=start["run"], plan=plan, **fields)
    run.steps = [StepRecord() for _ in plan.steps]
    return run


def unfinished(root: Path) -> dict[str, Journal | None]:
    """Of each device the newest run, where it is not closed; None where its file is damaged, which
    is named.
    """
    found: dict[str, Journal | None] = {}
    for folder in sorted(root.glob("*")) if root.is_dir() else []:
        paths = sorted(folder.glob("*.jsonl"))
        if not paths:
            continue
        try:
            journal = Journal.read(paths[-1])
        except (ProcedureError, OSError) as error:
            log.error("%s", error)
            found[folder.name] = None
            continue
        if not journal.run.closed:
            found[folder.name] = journal
    return found
