"""What begins a run and keeps its recording: checks of an order to start, and orders to the
recorder.
"""

import logging
import re
import time
from pathlib import Path

import zenoh

from messages import text
from messages.bus import orders
from messages.contract import gyrofree_pb2 as pb
from sessions.procedure import library
from sessions.procedure.conductor import Conductor
from sessions.procedure.driven.table import RateTable
from sessions.procedure.model import DEG
from sessions.procedure.run import Journal
from sessions.procedure.settings import ProcedureSettings

log = logging.getLogger(__name__)

ACTION = pb.RecorderCommand
SELF = pb.OrderBy(seat=pb.Seat(id="procedures", user="procedures", service=True))


class ProcedureDesk:
    """For one device."""

    def __init__(
        self, session: zenoh.Session, prefix: str, settings: ProcedureSettings, device: str
    ) -> None:
        self._session, self._prefix = session, prefix
        self._settings, self._device = settings, device

    def begin(self, command: pb.ProcedureCommand, limit: float) -> Journal:
        """A new run with its recording, on a table that can turn at `limit`, rad/s; raises
        ProcedureError, OrderError, OSError.
        """
        for what, value in (("serial number", command.unit), ("operator", command.user)):
            if fault := text.check(value):
                raise library.ProcedureError(f"{what}: {fault}")
        if not command.user.strip():
            raise library.ProcedureError("operator: it is not said who runs the test: sign in")
        plan = library.find(command.procedure, self._settings.folder)
        fastest = max(plan.steps, key=lambda step: abs(step.target))
        if abs(fastest.target) > limit:
            raise library.ProcedureError(
                f"{fastest.name}: the table can {limit / DEG:.4g} °/s: change the procedure"
            )
        stamp = time.strftime("%Y%m%dT%H%M%S", time.gmtime())
        start = {
            "run": f"{stamp}-{time.time_ns() // 1000 % 1_000_000:06d}",
            "procedure": plan.name,
            "toml": plan.toml,
            "device": self._device,
            "unit": command.unit.strip(),
            "operator": command.user,
            "own_session": command.own_session,
        }
        own = command.own_session and all(step.kind != "record" for step in plan.steps)
        before = self._give(ACTION.ACTION_STATUS) if own or not command.own_session else None
        journal = Journal.begin(self._settings.root, start)
        if own:
            problem = self._open(journal, before)
            if problem:
                journal.add("end", state="aborted", message=problem)
                journal.add("closed")
                raise library.ProcedureError(problem)
        elif before is not None and before.recording:
            journal.add("session", id=before.session, was_recording=True)
        return journal

    def record(self, on: bool, journal: Journal) -> str:
        """Begin or end the recording of a run, as its procedure says; what could not be done, or
        empty.
        """
        run = journal.run
        if not run.own_session:
            return "recorded in the session that runs"
        try:
            if on:
                return self._open(journal, self._give(ACTION.ACTION_STATUS))
            now = self._give(ACTION.ACTION_STATUS)
            if now.recording and now.session.startswith(run.session) and run.session:
                self._give(ACTION.ACTION_STOP)
                if run.was_recording:
                    self._give(ACTION.ACTION_START)
        except orders.OrderError as error:
            return str(error)
        return ""

    def _open(self, journal: Journal, before: pb.RecorderStatus) -> str:
        """A session of its own for the run; what is wrong, or empty."""
        run = journal.run
        if before.recording:
            self._give(ACTION.ACTION_STOP)
        name = re.sub(r"[^A-Za-z0-9_-]+", "-", f"{run.plan.name}-{run.unit}").strip("-")
        said = [run.plan.procedure.title, f"unit {run.unit}" if run.unit else ""]
        note = "; ".join(part for part in said if part)
        after = self._give(ACTION.ACTION_START, name=name[:64], note=note, user=run.operator)
        if not after.recording:
            return f"the recorder does not record: {after.message}"
        was = before.recording or run.was_recording
        journal.add("session", id=after.session, was_recording=was)
        return ""

    def _give(self, action: int, **more: str) -> pb.RecorderStatus:
        """Raises OrderError."""
        command = ACTION(action=action, **more)
        return orders.give(self._session, self._prefix, orders.RECORDER, command, by=SELF)


def if_lost(table: RateTable | None) -> str:
    """What a person is told before he starts a test: what becomes of it when his page is gone."""
    goes_on = (
        "When this page or the link to the lab is lost, the test goes on there by itself to its end"
    )
    if table is None:
        return f"{goes_on}; steps that want a person wait. You turn the table by hand."
    return f"{goes_on}, and the table turns with it. In the lab: {table.if_lost}."


def offer(message: pb.ProcedureStatus, folder: Path | None) -> None:
    """Write into the message what may be started, and what is known of it."""
    for one in library.offers(folder):
        message.offered.append(one.name)
        known = message.offers.add(name=one.name, title=one.title, steps=one.steps)
        known.top_radps, known.seconds, known.fault = one.top, one.seconds, one.fault


def late(conductor: Conductor, command: pb.ProcedureCommand) -> str:
    """Why an order comes too late: it was meant for what another has answered already."""
    run = conductor.run
    if command.run and command.run != run.id:
        return "another test runs now: look at it first"
    if command.step and command.step != run.at + 1:
        return f"step {command.step} has been answered already; this is step {run.at + 1}"
    return ""
