"""A recording becomes a report: HTML, PDF and JSON. The same recording and specification give the
same bytes.
"""

import hashlib
import json
import math
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from inertial.whole_file import whole_files
from messages.contract import gyrofree_pb2 as pb
from sessions.export.table import Progress, silent
from sessions.library.alarmed import Episode
from sessions.procedure.evaluate import (
    Held,
    Outcome,
    StepResult,
    evaluate,
    held_by,
    pieces,
    segments,
)
from sessions.procedure.pages import facts, provenance, steps, troubles
from sessions.recording.manifest import Manifest, SessionError, read_manifest, whole
from sessions.report import alarms
from sessions.report.analysis import Analysis, analyse
from sessions.report.data import Run, load_run
from sessions.report.document import Extra, compose
from sessions.report.figures import Picture, pictures
from sessions.report.html import to_html
from sessions.report.metrics import Metric, metrics
from sessions.report.pdf import to_pdf
from sessions.report.photo import Photo
from sessions.report.photo import read as read_photo
from sessions.report.segments import Segment
from sessions.report.verdict import Check, Spec, judge, load_spec, overall


@dataclass(frozen=True)
class Report:
    """All three forms, and the verdict."""

    html: str
    pdf: bytes
    json: str
    verdict: str  # pass, fail, incomplete

    def write(self, out: Path, name: str = "report") -> list[Path]:
        """Into the folder `out`, made when absent; raises OSError."""
        with whole_files(out) as drafts:
            files = [drafts / f"{name}.{form}" for form in ("html", "pdf", "json")]
            files[0].write_text(self.html, encoding="utf-8")
            files[1].write_bytes(self.pdf)
            files[2].write_text(self.json, encoding="utf-8")
        return [out / file.name for file in files]


@dataclass(frozen=True)
class Judged:
    """A session, analysed and judged, before anything is drawn."""

    manifest: Manifest | None
    found: Analysis
    spec: Spec  # the one that was asked for, or the procedure's
    figures: list[Metric]
    checks: list[Check]
    held: Held | None
    outcome: Outcome | None
    before: dict[Path, Manifest] = field(default_factory=dict)  # files that this one goes on with
    episodes: list[Episode] = field(default_factory=list)  # alarms of its run


def judged(
    path: Path, spec: Spec, device: str = "", boot: int | None = None, progress: Progress = silent
) -> Judged:
    """The figures of an MCAP file against limits; raises as `build`."""
    manifest = _manifest(path)
    held = held_by(path, manifest, device)
    if held is not None:
        device, boot = held.status.header.device, held.epoch if boot is None else boot
        if spec == load_spec(None):  # nobody asked for other limits than the procedure's
            spec = Spec(title=held.plan.procedure.title, estimator=held.plan.procedure.estimator)
    before = pieces(path, manifest, held) if held is not None else {}
    run = load_run((*before, path), device, boot, progress)
    found = analyse(run, whole(manifest, *before.values()), _parts(held, run))
    figures = metrics(found, spec.estimator)
    checks, outcome = judge(spec, figures), None
    if held is not None:
        outcome = evaluate(held, found, figures)
        figures, checks = [*figures, *outcome.figures], outcome.checks + checks
    there = alarms.of_run(alarms.in_files({**before, path: manifest}), run)
    one = whole(manifest, *before.values())
    return Judged(one, found, spec, figures, checks, held, outcome, before, there)


def build(
    path: Path, spec: Spec, device: str = "", boot: int | None = None, progress: Progress = silent
) -> Report:
    """Report on an MCAP file; session.json beside it, where there is one, adds completeness and
    provenance.

    Raises ReportError when the recording has nothing to report on, SpecError for a limit on no
    figure, OSError.
    """
    one = judged(path, spec, device, boot, lambda done, what: progress(0.6 * done, what))
    extra = Extra()
    if one.outcome is not None:
        extra = Extra(
            facts(one.outcome),
            [steps(one.outcome), troubles(one.outcome)],
            provenance(one.outcome),
            one.outcome.held.status.operator,
        )
    grid = alarms.alarms(one.episodes, one.found.run)
    extra.grids.extend([grid] if grid is not None else [])
    extra.provenance.extend(
        (f"SHA-256 of {manifest.id}, which it goes on with", sha256_of(file))
        for file, manifest in one.before.items()
    )
    photo = read_photo(path.parent)
    if photo is not None:
        extra.provenance.append(("SHA-256 of the photo", photo.sha256))
    progress(0.65, "drawing")
    sha256, drawn = sha256_of(path), pictures(one.found)
    if photo is not None:
        drawn = [Picture("unit", "The unit under test.", photo.jpeg), *drawn]
    document = compose(one.found, one.manifest, sha256, one.spec, one.checks, drawn, extra)
    progress(0.85, "writing")
    report = Report(
        html=to_html(document),
        pdf=to_pdf(document),
        json=_json(one, sha256, photo),
        verdict=document.verdict,
    )
    progress(1.0, "done")
    return report


def _manifest(path: Path) -> Manifest | None:
    try:
        return read_manifest(path.parent)
    except SessionError:
        return None


def sha256_of(path: Path) -> str:
    """Hex digest of a file."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def _json(one: Judged, sha256: str, photo: Photo | None) -> str:
    manifest, found, spec, outcome = one.manifest, one.found, one.spec, one.outcome
    figures, checks = one.figures, one.checks
    content: dict[str, Any] = {
        "session": manifest.id if manifest else None,
        "device": found.run.device,
        "boot": found.run.epoch,
        "start_utc_s": found.run.start_utc_s,
        "seconds": found.run.seconds,
        "sha256": sha256,
        "photo_sha256": None if photo is None else photo.sha256,
        "verdict": overall(checks),
        "specification": spec.title,
        "estimator": spec.estimator,
        "checks": [asdict(check) | {"passed": check.passed} for check in checks],
        "figures": {metric.name: metric.value for metric in figures},
        "estimators": {rate.name: asdict(rate) for rate in found.rates},
        "segments": [asdict(part) for part in found.segments],
        "allan": [asdict(one) for one in found.allan_axes],
        "navigation": {nav.name: asdict(nav) for nav in found.navigation},
        "link": found.run.link,
        "damage": list(found.run.said),
        "alarms": alarms.as_json(one.episodes, found.run),
    }
    if outcome is not None:
        status = outcome.held.status
        content["procedure"] = {
            "name": outcome.held.plan.name,
            "title": outcome.held.plan.procedure.title,
            "sha256": outcome.held.plan.sha256,
            "run": status.run,
            "unit": status.unit,
            "operator": status.operator,
            "state": pb.ProcedureStatus.State.Name(status.state),
            "steps": [_step(one) for one in outcome.steps],
            "before": [manifest.id for manifest in one.before.values()],
        }
    return json.dumps(_plain(content), indent=1, sort_keys=True, ensure_ascii=False) + "\n"


def _parts(held: Held | None, run: Run) -> list[Segment] | None:
    """The steps of a procedure as standstills and plateaus; None where nobody said them."""
    if held is None:
        return None
    pairs = zip(held.plan.steps, segments(held, run), strict=True)
    found = [
        part for step, part in pairs if isinstance(part, Segment) and step.kind in ("rate", "still")
    ]
    return found or None


def _step(one: StepResult) -> dict[str, Any]:
    part = asdict(one.segment) if one.segment is not None else None
    plateau = one.plateau
    return {
        "name": one.step.name,
        "kind": one.step.kind,
        "target_radps": one.step.target,
        "state": pb.ProcedureStatus.Step.State.Name(one.record.state),
        "reason": one.record.reason,
        "attempts": one.record.attempts,
        "spoilt": one.record.spoilt,
        "trouble": list(one.record.trouble),
        "segment": part,
        "error_radps": None if plateau is None else plateau.error[2],
        "standard_error_radps": None if plateau is None else plateau.standard_error[2],
        "rms_radps": None if plateau is None else plateau.rms[2],
        "vibration_mps2": one.vibration,
    }


def _plain(value: Any) -> Any:
    """numpy as lists; what is no number as null, for JSON has no NaN."""
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, np.generic):
        return _plain(value.item())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value
