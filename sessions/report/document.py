"""The report as blocks of text and tables, which HTML and PDF show alike. Degrees, mg and ppm begin
here.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import UTC, datetime

from logs.figures.names import estimator_title
from logs.figures.numbers import with_half_width
from sessions.recording.manifest import Manifest
from sessions.report.analysis import Analysis
from sessions.report.figures import Picture
from sessions.report.grids import (
    HYPHEN,
    Grid,
    biases,
    completeness,
    consistency,
    deg,
    navigation,
    number,
    plateaus,
    positions,
    scale_factors,
    spelt,
    stability,
)
from sessions.report.verdict import Check, Spec, overall

UNITS = {
    "dps": "°/s",
    "deg": "°",
    "ppm": "ppm",
    "mg": "mg",
    "m": "m",
    "s": "s",
}  # by the end of a figure's name


@dataclass(frozen=True)
class Document:
    """A whole report."""

    title: str
    verdict: str  # pass, fail, incomplete
    facts: list[tuple[str, str]]
    checks: list[tuple[str, str, str, str]]  # figure, value, limits, result
    grids: list[Grid]
    pictures: list[Picture]
    provenance: list[tuple[str, str]] = field(default_factory=list)
    # what is to be signed, and who or when, as far as the recording says it
    signed: tuple[tuple[str, str], ...] = (("Tested by", ""), ("Approved by", ""), ("Date", ""))

    def texts(self) -> Iterator[str]:
        """All that it says beside numbers of its own."""
        for row in (*self.facts, *self.checks):
            yield from row
        for grid in self.grids:
            yield from (grid.title, *grid.head, grid.remark or "")
            for row in grid.rows:
                yield from row
        for picture in self.pictures:
            yield picture.caption


@dataclass(frozen=True)
class Extra:
    """What a procedure adds to the report of its session."""

    facts: list[tuple[str, str]] = field(default_factory=list)
    grids: list[Grid] = field(default_factory=list)
    provenance: list[tuple[str, str]] = field(default_factory=list)
    tested_by: str = ""


def compose(
    found: Analysis,
    manifest: Manifest | None,
    sha256: str,
    spec: Spec,
    checks: list[Check],
    drawn: list[Picture],
    extra: Extra = Extra(),
) -> Document:
    """Put the report together."""
    grids = [
        *extra.grids,
        plateaus(found),
        scale_factors(found),
        biases(found),
        positions(found),
        stability(found),
    ]
    grids += [consistency(found), navigation(found), completeness(manifest, found)]
    return Document(
        title=f"{'Rate table test' if found.segments else 'Session'} of {found.run.device}",
        verdict=overall(checks),
        facts=extra.facts + _facts(found, manifest, spec),
        checks=[_check(check) for check in checks],
        grids=[spelt(grid) for grid in grids if grid is not None and grid.rows],
        pictures=drawn,
        provenance=extra.provenance + _provenance(found, manifest, sha256),
        signed=(
            ("Tested by", extra.tested_by),
            ("Approved by", ""),
            ("Date", _date(found) if extra.tested_by else ""),
        ),
    )


def _date(found: Analysis) -> str:
    """Of the test, not of the report: the same recording gives the same bytes."""
    return datetime.fromtimestamp(found.run.start_utc_s, UTC).strftime("%Y-%m-%d")


def _facts(found: Analysis, manifest: Manifest | None, spec: Spec) -> list[tuple[str, str]]:
    run = found.run
    start = datetime.fromtimestamp(run.start_utc_s, UTC).strftime("%Y-%m-%d %H:%M:%S")
    boots = f"boot {run.epoch}" + (
        f" of {', '.join(map(str, run.boots))}" if len(run.boots) > 1 else ""
    )
    facts = [
        ("Session", manifest.id if manifest else "a file without session.json"),
        ("Device", f"{run.device}, {boots}"),
        ("Start (UTC)", start),
        ("Length", f"{run.seconds:.2f} s"),
        ("Source of the data", _sources(manifest)),
        ("Judged by", f"{spec.title}, estimator {estimator_title(spec.estimator)}"),
    ]
    if found.cube is not None and found.cube.tilt is not None:
        facts.append(("Tilt of the table's axis", f"{deg(found.cube.tilt, 2)}°"))
    facts += [("Recording", text) for text in run.said]
    if manifest and manifest.note:
        facts.append(("Note", manifest.note))
    return facts


def _sources(manifest: Manifest | None) -> str:
    known = (
        [source.lower() for source in manifest.sources if source != "UNKNOWN"] if manifest else []
    )
    return ", ".join(known) or "unknown"


def _check(check: Check) -> tuple[str, str, str, str]:
    low, high = check.minimum, check.maximum
    limits = f"{number(low)} to {number(high)}" if low is not None and high is not None else ""
    limits = limits or (f"≥ {number(low)}" if low is not None else f"≤ {number(high)}")
    limits = "measured" if low is None and high is None else limits
    value, unit = "–", UNITS.get(check.name.rpartition("_")[2], "")
    if check.value is not None and math.isfinite(check.value):
        half = math.nan if check.sigma is None else 2.0 * check.sigma
        value = f"{with_half_width(check.value, half, 4)} {unit}".rstrip()
    limits = HYPHEN.sub("−", limits)
    name = f"{check.text} ({check.name})" if check.text else check.name
    return (
        name,
        value,
        limits,
        {True: "pass", False: "fail", None: "not told"}[check.passed],
    )


def _provenance(found: Analysis, manifest: Manifest | None, sha256: str) -> list[tuple[str, str]]:
    cards = sorted({rate.calibration for rate in found.run.rates if rate.calibration})
    rows = [("SHA-256 of the recording", sha256), ("Calibration file", ", ".join(cards) or "none")]
    if manifest is not None:
        rows += [(f"Version of {name}", value) for name, value in sorted(manifest.versions.items())]
        rows.append(("State of the session", manifest.state))
    return rows
