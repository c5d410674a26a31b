"""A run of a procedure in the report: facts, and a table of its steps."""

from inertial.constants import MILLI_G
from logs.figures.names import estimator_title
from logs.figures.numbers import with_half_width
from messages.contract import gyrofree_pb2 as pb
from sessions.procedure.evaluate import Outcome, StepResult
from sessions.procedure.model import DEG
from sessions.procedure.run import TROUBLE
from sessions.report.grids import Grid, deg, number

M = pb.ProcedureStatus
WORDS = {
    M.STATE_DONE: "run to its end",
    M.STATE_ABORTED: "aborted",
    M.STATE_STOPPED: "emergency stop",
}
STEPS = {M.Step.STATE_DONE: "", M.Step.STATE_FAILED: "failed", M.Step.STATE_SKIPPED: "left out"}


def facts(outcome: Outcome) -> list[tuple[str, str]]:
    """Who, which unit, which procedure, how it ended."""
    status, procedure = outcome.held.status, outcome.held.plan.procedure
    ended = WORDS.get(status.state, "not ended in this recording")
    rows = [
        ("Procedure", f"{procedure.title} ({outcome.held.plan.name})"),
        ("After", procedure.standard),
        ("Unit under test", procedure.unit),
        ("Serial number", status.unit or "not given"),
        ("Operator", status.operator or "not given"),
        ("Table", status.table or "turned by hand"),
        ("Rate judged by", ", ".join(status.reference)),
        ("The run was", ended + (f": {status.message}" if status.message else "")),
    ]
    rows += [
        (step.name, f"{step.reason} ({step.confirmed_by or 'unnamed'})")
        for step in status.steps
        if step.kind == "open" and step.state == M.Step.STATE_DONE
    ]
    return [(name, text) for name, text in rows if text]


def provenance(outcome: Outcome) -> list[tuple[str, str]]:
    """What the procedure was, to the byte."""
    return [
        ("SHA-256 of the procedure", outcome.held.plan.sha256),
        ("Run", outcome.held.status.run),
    ]


def steps(outcome: Outcome) -> Grid:
    """Every step with what was measured."""
    rows = [_row(k, one) for k, one in enumerate(outcome.steps, 1)]
    head = (
        "step",
        "name",
        "wanted",
        "reference",
        "error ± 2 std. errors",
        "RMS",
        "vibration, mg",
        "attempts",
        "result",
    )
    remark = (
        f"Rates of {estimator_title(outcome.held.plan.procedure.estimator)} about z in °/s, over"
        " the dwell that counts. Attempts: all, and of them spoilt."
    )
    return Grid("Steps of the procedure", head, rows, remark)


def troubles(outcome: Outcome) -> Grid:
    """Why attempts were spoilt or held, step by step; no rows where nothing was."""
    rows = [
        (str(k), one.step.name, why)
        for k, one in enumerate(outcome.steps, 1)
        for why in one.record.trouble
    ]
    remark = f"In the order they came; of each step the last {TROUBLE} that differ."
    return Grid("What spoilt or held attempts", ("step", "name", "reason"), rows, remark)


def _row(k: int, one: StepResult) -> tuple[str, ...]:
    step, plateau = one.step, one.plateau
    wanted = f"{step.target / DEG:+.4g} °/s for {step.dwell_s:g} s" if step.kind == "rate" else ""
    wanted = wanted or (f"{step.kind}, {step.dwell_s:g} s" if step.dwell_s else step.kind)
    error = "–"
    if plateau is not None:
        error = with_half_width(plateau.error[2] / DEG, 2.0 * plateau.standard_error[2] / DEG)
    shaken = number(one.vibration / MILLI_G) if one.vibration is not None else "–"
    turned = one.segment is not None and step.kind != "pose"
    spoilt = f", {one.record.spoilt} spoilt" if one.record.spoilt else ""
    return (
        str(k),
        step.name,
        wanted,
        deg(one.segment.omega, 2) if turned and one.segment is not None else "–",
        error,
        deg(plateau.rms[2]) if plateau is not None else "–",
        shaken,
        f"{one.record.attempts}{spoilt}",
        _result(one),
    )


def _result(one: StepResult) -> str:
    passed = [check.passed for check in one.checks]
    if any(value is False for value in passed):
        return "fail"
    if any(value is None for value in passed):
        return STEPS.get(one.record.state) or "not told"
    return "pass" if passed else "measured" if one.segment is not None else "done"
