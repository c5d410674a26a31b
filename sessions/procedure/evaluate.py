"""What a run of a procedure came to, computed from its recording: the steps' figures with their
uncertainty, each against its limit. The same recording gives the same numbers.
"""

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from inertial.constants import GRAVITY, MILLI_G
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import PROCEDURE
from sessions.export.table import Selection, messages
from sessions.procedure.conductor import NAMED_S
from sessions.procedure.evidence import WINDOW, shaking
from sessions.procedure.library import ProcedureError, of_text
from sessions.procedure.model import DEG, Plan, Step
from sessions.procedure.seen import UNFIT
from sessions.procedure.watch import HOLE
from sessions.recording.manifest import Manifest, SessionError, read_manifest
from sessions.recording.mcap_damage import Damage
from sessions.report.analysis import Analysis
from sessions.report.data import Run
from sessions.report.metrics import Metric
from sessions.report.segments import Segment, reference
from sessions.report.table_test import FLOOR, Plateau
from sessions.report.verdict import Check

Array = NDArray[np.float64]
M = pb.ProcedureStatus
LEAST_SHARE = 0.95  # of a dwell that must be in the recording


@dataclass(frozen=True)
class Held:
    """A run as the recording holds it."""

    status: M
    plan: Plan

    @property
    def epoch(self) -> int | None:
        """Boot in which most of its steps were measured."""
        boots = Counter(s.epoch for s in self.status.steps if s.until_us > s.from_us)
        return max(sorted(boots), key=lambda boot: boots[boot]) if boots else None


@dataclass(frozen=True)
class StepResult:
    """One step, judged; SI."""

    step: Step
    record: pb.ProcedureStatus.Step
    segment: Segment | None  # None: not measured, or not in this recording
    plateau: Plateau | None
    vibration: float | None  # m/s^2
    checks: list[Check]


@dataclass(frozen=True)
class Outcome:
    """All that a report says of a run."""

    held: Held
    steps: list[StepResult]
    figures: list[Metric]  # of the whole, beyond those that every report has
    checks: list[Check]


def held_by(path: Path, manifest: Manifest | None, device: str = "") -> Held | None:
    """The last run that a recording holds, of a device (default: any); None: there is none.

    Raises OSError.
    """
    if manifest is not None and not any(k.endswith(f"/{PROCEDURE.name}") for k in manifest.keys):
        return None
    newest: M | None = None
    # What is damaged is told by the reading that takes the samples.
    for _, _, message in messages(path, Selection(frozenset([PROCEDURE.name])), Damage()):
        if not isinstance(message, M) or message.state == M.STATE_IDLE or not message.toml:
            continue
        mine = not device or message.header.device == device
        here = manifest is None or message.session in ("", manifest.id) or manifest.continues
        if mine and here:
            newest = message
    if newest is None:
        return None
    try:
        plan = of_text(newest.toml, newest.procedure)
    except ProcedureError:
        return None
    return Held(newest, plan) if len(plan.steps) == len(newest.steps) else None


def pieces(path: Path, manifest: Manifest | None, held: Held) -> dict[Path, Manifest]:
    """The files before this one that it goes on with, the first of the run first: its recorder was
    cut off, or a file was full.
    """
    found: dict[Path, Manifest] = {}
    while manifest is not None and manifest.continues:
        if manifest.start_utc_ns <= held.status.started_utc_ns:
            break
        folder = path.parent.parent / manifest.continues
        try:
            manifest = read_manifest(folder)
        except SessionError:
            break
        file = folder / manifest.file
        if manifest.state == "open" or file in found or not file.is_file():
            break
        found = {file: manifest} | found
    return found


def segments(held: Held, run: Run) -> list[Segment | str]:
    """Where each step lies in a run; or why it cannot be judged by what is recorded."""
    found: list[Segment | str] = []
    before = 0.0
    for step, record in zip(held.plan.steps, held.status.steps, strict=True):
        if run.start_board_s is not None:
            begin, end = (us * 1e-6 - run.start_board_s for us in (record.from_us, record.until_us))
        else:
            begin, end = (
                ns * 1e-9 - run.start_utc_s for ns in (record.from_utc_ns, record.until_utc_ns)
            )
        inside = min(end, run.seconds) - max(begin, 0.0)
        missing = ""
        if record.state != M.Step.STATE_DONE or end <= begin:
            missing = record.reason or "not measured"
        elif record.epoch != run.epoch:
            missing = f"measured in boot {record.epoch} of the board: reports are of one boot"
        elif inside < LEAST_SHARE * (end - begin):
            missing = "not in this recording"
        if missing:
            found.append(missing)
            continue
        begin, end = max(begin, 0.0), min(end, run.seconds)
        omega, scatter = step.target, 0.0
        if run.tacho is not None:
            values = reference(run.tacho, np.arange(begin, end, 0.01))
            omega, scatter = float(values.mean()), float(values.std())
        part = Segment(begin, end, omega, scatter, begin - before)
        found.append(contradiction(step, part, held.plan.procedure.estimator, run) or part)
        before = end
    return found


def contradiction(step: Step, part: Segment, estimator: str, run: Run) -> str:
    """What in the recording speaks against a dwell that was taken for good while it ran; or
    empty.
    """
    rates = [rate.t for rate in run.rates if rate.name == estimator]
    timed = {"samples": run.accel.t if run.accel is not None else None}
    timed["estimates"] = rates[0] if rates else None
    for what, t in timed.items():
        hole = _hole(t, part) if t is not None else 0.0
        if hole > HOLE:
            return f"{hole:.2f} s without {what} in the recording"
    for t, axis, state in run.states:
        unfit = UNFIT.get(pb.AxisHealth.State.Value(f"STATE_{state}"))
        if unfit and part.begin <= t <= part.end + NAMED_S:
            return f"axis {axis} {unfit}, named {t - part.begin:.1f} s after the dwell began"
    off = abs(abs(part.omega) - abs(step.target))  # a tachometer may not know the direction
    if step.kind in ("rate", "still") and run.tacho is not None and off > step.tolerance:
        told = f"{abs(part.omega) / DEG:.1f} °/s, wanted {abs(step.target) / DEG:.1f}"
        return f"the tachometer in the recording says {told}"
    return ""


def _hole(t: Array, part: Segment) -> float:
    """The longest time without one, s, within a part and at its ends."""
    at = np.concatenate([[part.begin], t[part.holds(t)], [part.end]])
    return float(np.diff(np.sort(at)).max())


def evaluate(held: Held, found: Analysis, figures: list[Metric]) -> Outcome:
    """Judge a run; `figures` are those of the whole that the report has."""
    steps = []
    for number, (step, record, part) in enumerate(
        zip(held.plan.steps, held.status.steps, segments(held, found.run), strict=True), 1
    ):
        steps.append(_step(number, step, record, part, held, found))
    more = [_hysteresis(steps)]
    values = {metric.name: metric for metric in [*figures, *more]}
    errors = sigmas(held.plan.procedure.estimator, found) | {
        "hysteresis_ppm": _hysteresis_sigma(steps)
    }
    checks = [check for one in steps for check in one.checks]
    for name, limit in held.plan.procedure.limits.items():
        metric = values.get(name)
        value, text = (metric.value, metric.text) if metric is not None else (None, "")
        checks.append(Check(name, value, limit.min, limit.max, text, errors.get(name)))
    if held.status.state != M.STATE_DONE:
        how = held.status.message or "it was not run to its end"
        checks.append(Check("run to its end", None, None, None, how))
    return Outcome(held, steps, more, checks)


def _step(
    number: int,
    step: Step,
    record: pb.ProcedureStatus.Step,
    part: Segment | str,
    held: Held,
    found: Analysis,
) -> StepResult:
    watched = step.kind in ("rate", "still", "pose")
    if isinstance(part, str):
        if not watched and record.state == M.Step.STATE_DONE:
            return StepResult(step, record, None, None, None, [])
        missing = Check(f"step {number}, {step.name}", None, None, None, part)
        return StepResult(step, record, None, None, None, [missing])
    rate = found.rate(held.plan.procedure.estimator)
    plateau = None
    if rate is not None and step.kind != "pose":
        plateau = next((p for p in rate.plateaus if p.segment == part), None)
    vibration = _vibration(found.run, part)
    values = _values(step, part, plateau, vibration, found)
    checks = []
    for name, limit in step.limits:
        value, sigma = values.get(name, (None, None))
        where = f"step {number}, {step.name}"
        checks.append(Check(f"{where}: {name}", value, limit.min, limit.max, "", sigma))
    return StepResult(step, record, part, plateau, vibration, checks)


def _values(
    step: Step, part: Segment, plateau: Plateau | None, vibration: float | None, found: Analysis
) -> dict[str, tuple[float | None, float | None]]:
    """Figure -> value and standard error."""
    values: dict[str, tuple[float | None, float | None]] = {}
    if vibration is not None:
        values["vibration_mg"] = (vibration / MILLI_G, None)
    if plateau is not None:
        error, sigma = plateau.error[2] / DEG, plateau.standard_error[2] / DEG
        values["rate_error_dps"] = (float(error), float(sigma))
        values["rate_scatter_dps"] = (float(plateau.scatter[2] / DEG), None)
        values["rate_rms_dps"] = (float(plateau.rms[2] / DEG), None)
    if step.kind == "pose" and found.cube is not None:
        p = found.cube.p_b[part.holds(found.cube.t)]
        if len(p) > 1:
            size = float(np.linalg.norm(p.mean(axis=0)))
            spread = float(p.std(axis=0, ddof=1).max() / np.sqrt(len(p)))
            values["force_error_mg"] = ((size - GRAVITY) / MILLI_G, spread / MILLI_G)
    return values


def _vibration(run: Run, part: Segment) -> float | None:
    """The largest of any WINDOW, m/s^2 RMS."""
    if run.accel is None:
        return None
    t, rows = run.accel.t, run.accel.f_axis
    found = []
    for begin in np.arange(part.begin, part.end - WINDOW + 1e-9, WINDOW):
        at = (t >= begin) & (t < begin + WINDOW)
        if at.sum() >= 10:
            found.append(shaking(t[at] - begin, rows[at], part.omega))
    return max(found) if found else None


def _pairs(steps: list[StepResult]) -> list[tuple[float, float]]:
    """Differences (rad/s) of the same rate measured again, with their standard errors."""
    first: dict[float, Plateau] = {}
    found = []
    for one in steps:
        if one.step.kind != "rate" or one.plateau is None:
            continue
        target = round(one.step.target / DEG, 6)
        before = first.setdefault(target, one.plateau)
        if before is not one.plateau:
            a, b = before, one.plateau
            sigma = float(np.hypot(a.standard_error[2], b.standard_error[2]))
            found.append((float(b.error[2] - a.error[2]), sigma))
    return found


def _full_scale(steps: list[StepResult]) -> float:
    return max((abs(one.step.target) for one in steps if one.plateau is not None), default=0.0)


def _hysteresis(steps: list[StepResult]) -> Metric:
    """The largest difference between two visits of one rate over full scale (R-5)."""
    pairs, full = _pairs(steps), _full_scale(steps)
    value = max(abs(d) for d, _ in pairs) / full * 1e6 if pairs and full else None
    return Metric("hysteresis_ppm", value, "largest difference between two visits of one rate")


def _hysteresis_sigma(steps: list[StepResult]) -> float | None:
    pairs, full = _pairs(steps), _full_scale(steps)
    if not pairs or not full:
        return None
    return max(pairs, key=lambda pair: abs(pair[0]))[1] / full * 1e6


def sigmas(estimator: str, found: Analysis) -> dict[str, float | None]:
    """Standard errors of figures of the whole, from those of the plateaus, where they are known."""
    rate = found.rate(estimator)
    fit = rate.fit if rate is not None else None
    if rate is None or fit is None:
        return {}
    known = {
        "scale_factor_error_ppm": fit.scale_factor_sigma * 1e6,
        "rate_bias_dps": float(fit.bias_sigma / DEG),
    }
    levels = np.array([p.segment.omega for p in rate.plateaus])
    errors = np.array([p.standard_error[2] for p in rate.plateaus])
    full = float(np.abs(levels).max())
    if np.isfinite(errors).all() and full > 0.0:
        known["linearity_ppm"] = float(errors.max() / full * 1e6)
        if fit.asymmetry_ppm is not None:
            weights = np.hypot(errors, FLOOR)
            design = np.column_stack([np.ones_like(levels), levels, np.abs(levels)])
            design /= weights[:, None]
            spread = np.sqrt(np.linalg.inv(design.T @ design)[2, 2])
            known["asymmetry_ppm"] = float(2.0 * spread / fit.scale_factor * 1e6)
    return known
