"""A run as a message, and as sentences for the person at the table."""

import math

from messages.contract import gyrofree_pb2 as pb
from sessions.procedure.conductor import Conductor
from sessions.procedure.model import DEG, Step
from sessions.procedure.run import ABORTED, DONE, HELD, RUNNING, STOPPED
from sessions.procedure.watch import State, Watch

M = pb.ProcedureStatus
STATES = {
    RUNNING: M.STATE_RUNNING,
    HELD: M.STATE_HELD,
    DONE: M.STATE_DONE,
    ABORTED: M.STATE_ABORTED,
    STOPPED: M.STATE_STOPPED,
}
RECORDS = {
    "todo": M.Step.STATE_TODO,
    "done": M.Step.STATE_DONE,
    "failed": M.Step.STATE_FAILED,
    "skipped": M.Step.STATE_SKIPPED,
}
LOOKS = {
    State.WAITING: M.Step.STATE_WAITING,
    State.RAMP: M.Step.STATE_RAMP,
    State.SETTLED: M.Step.STATE_SETTLED,
    State.DWELL: M.Step.STATE_DWELL,
    State.FULL: M.Step.STATE_DWELL,
    State.SPOILT: M.Step.STATE_WAITING,
}
SILENT_S = 3.0


def status_of(conductor: Conductor) -> pb.ProcedureStatus:
    """Everything of a run; the header's sequence is the publisher's."""
    run, watch = conductor.run, conductor.watch
    plan = run.plan
    message = M(
        state=STATES[run.state],
        run=run.id,
        procedure=plan.name,
        title=plan.procedure.title,
        sha256=plan.sha256,
        toml=plan.toml,
        unit=run.unit,
        operator=run.operator,
        session=run.session,
        step=max(run.at, 0),
        instruction=_instruction(conductor),
        progress=watch.progress if run.state == RUNNING else 0.0,
        message=_message(conductor),
        table=conductor.drive.name,
        table_radps=conductor.drive.rate,
        alarm=conductor.drive.alarm,
        started_utc_ns=run.started_utc_ns,
        reference=sorted({step.reference for step in run.steps if step.reference}),
    )
    for k, (step, record) in enumerate(zip(plan.steps, run.steps, strict=True)):
        _add(message, step, record, watch if k == run.at and run.state == RUNNING else None, plan)
    now = plan.steps[max(run.at, 0)]
    if run.state == RUNNING and now.kind == "pose":
        message.up_b[:] = now.up_b
    head = message.header
    head.device = run.device
    if watch.epoch >= 0 and math.isfinite(watch.now):
        head.epoch = watch.epoch
        head.device_us, head.utc_ns = round(watch.now * 1e6), watch.utc_ns(watch.now)
    return message


def _add(message: M, step: Step, record, watch: Watch | None, plan) -> None:
    entry = message.steps.add(
        name=step.name,
        kind=step.kind,
        target_radps=step.target,
        dwell_s=step.dwell_s,
        state=RECORDS.get(record.state, M.Step.STATE_WAITING),
        reason=record.reason,
        attempts=record.attempts,
        spoilt=record.spoilt,
        confirmed_by=record.confirmed_by,
        trouble=record.trouble,
        **record.window,
    )
    figures = [(f["name"], f["value"], f["sigma"]) for f in record.figures]
    if watch is not None and record.state == "active":
        entry.state = LOOKS[watch.state]
        entry.reason = watch.reason or record.reason
        estimator = plan.procedure.estimator
        figures = [(f.name, f.value, f.sigma) for f in watch.live.figures(step, estimator)]
    limits = dict(step.limits)
    for name, value, sigma in figures:
        one = entry.figures.add(name=name, value=_number(value), sigma=_number(sigma))
        limit = limits.get(name)
        if limit is not None and limit.min is not None:
            one.min = limit.min
        if limit is not None and limit.max is not None:
            one.max = limit.max


def _number(value: float | None) -> float:
    return math.nan if value is None else value


def _message(conductor: Conductor) -> str:
    run, watch = conductor.run, conductor.watch
    if fault := conductor.journal.fault:
        return f"what happens cannot be saved: {fault}: make room on the disk"
    if run.state == RUNNING:
        if conductor.silent_s > SILENT_S:
            return f"no samples for {conductor.silent_s:.0f} s: does the board send?"
        return watch.reason or run.message
    return run.message


def _instruction(conductor: Conductor) -> str:
    """What is to be done now, in words."""
    run, watch = conductor.run, conductor.watch
    if run.state == HELD:
        return "Mend what is said below and repeat the step, leave it out, or abort"
    if run.over:
        words = {DONE: "The procedure has been run to its end", ABORTED: "Aborted"}
        text = words.get(run.state, "EMERGENCY STOP")
        return text if run.closed else f"{text}; the recording is being closed"
    if run.at < 0:
        return "Beginning"
    step = run.plan.steps[run.at]
    if step.kind == "open":
        return step.instruction + (f"; then give {step.ask}" if step.ask else "; then confirm")
    if watch.state is State.DWELL:
        left = step.dwell_s * (1.0 - watch.progress)
        return f"{_keep(step, bool(conductor.drive.name))}: {left:.0f} s to go"
    return asked(step, bool(conductor.drive.name))


def _keep(step: Step, driven: bool) -> str:
    if step.kind == "rate" and not driven:
        return "Keep turning like this"
    return "Measuring" if step.kind == "rate" else "Do not touch it"


def asked(step: Step, driven: bool) -> str:
    """What a step wants of the table, or of the person who turns it."""
    if step.kind == "pose":
        k = max(range(3), key=lambda k: abs(step.up_b[k]))
        return f"Set it down with {'+' if step.up_b[k] > 0 else '-'}{'xyz'[k]} up, and let go"
    if step.kind == "still":
        return "The table comes to rest" if driven else "Let the table stand still"
    dps = step.target / DEG
    way = "counter-clockwise" if dps > 0 else "clockwise"
    if driven:
        return f"The table goes to {dps:+.4g} °/s ({way} seen from above)"
    turn = 360.0 / abs(dps)
    return f"Turn the table {way} at {abs(dps):.4g} °/s: one turn in {turn:.3g} s"
