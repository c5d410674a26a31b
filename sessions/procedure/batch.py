"""A batch of units on one sheet: the figures that tell units apart, with their uncertainty, and who
is unlike the others.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from inertial.constants import MILLI_G
from sessions.procedure.evaluate import sigmas
from sessions.report.build import Judged, judged
from sessions.report.verdict import Spec, overall

FEWEST = 4  # units, to say that one is unlike the others
FAR = 3.5  # robust standard deviations, and
SURE = 3.0  # standard errors of its own
ROBUST = 1.4826  # of a normal distribution: standard deviation over median absolute deviation
COLUMNS = (
    ("scale_factor_error_ppm", "scale factor error", "ppm"),
    ("rate_bias_dps", "rate bias", "°/s"),
    ("asymmetry_ppm", "asymmetry", "ppm"),
    ("linearity_ppm", "linearity", "ppm"),
    ("hysteresis_ppm", "hysteresis", "ppm"),
    ("rate_rms_z_dps", "rate RMS", "°/s"),
    ("noise_mg", "vibration at rest", "mg"),
    ("random_walk_mps_sqrt_s", "velocity random walk", "m/s/√s"),
)


@dataclass(frozen=True)
class Cell:
    """A figure of a unit."""

    value: float | None
    sigma: float | None  # standard error, where it is known
    outlier: bool = False


@dataclass(frozen=True)
class Unit:
    """One row."""

    unit: str  # serial number
    session: str
    procedure: str
    verdict: str
    cells: dict[str, Cell]


def unit_of(path: Path, spec: Spec, name: str) -> Unit:
    """The row of a session; raises as sessions.report.build.build."""
    one = judged(path, spec)
    values = {metric.name: metric.value for metric in one.figures}
    errors = {check.name: check.sigma for check in one.checks}
    errors |= sigmas(one.spec.estimator, one.found)
    values |= {"noise_mg": _noise(one), "random_walk_mps_sqrt_s": _random_walk(one)}
    cells = {key: Cell(values.get(key), errors.get(key)) for key, *_ in COLUMNS}
    held = one.held
    return Unit(
        unit=held.status.unit if held is not None else "",
        session=name,
        procedure=held.plan.name if held is not None else "",
        verdict=overall(one.checks),
        cells=cells,
    )


def _noise(one: Judged) -> float | None:
    """Median over the standstills of a procedure, mg."""
    if one.outcome is None:
        return None
    still = [s.vibration for s in one.outcome.steps if s.step.kind == "still"]
    known = [value / MILLI_G for value in still if value is not None]
    return float(np.median(known)) if known else None


def _random_walk(one: Judged) -> float | None:
    """Median over the axes."""
    found = [axis.random_walk for axis in one.found.allan_axes]
    return float(np.median(found)) if found else None


def marked(units: Sequence[Unit]) -> list[Unit]:
    """The same rows, with what is unlike the others marked: far from their median by the others'
    scatter, and by more than its own uncertainty.
    """
    outliers: dict[tuple[int, str], bool] = {}
    for key, *_ in COLUMNS:
        known = [(k, u.cells[key]) for k, u in enumerate(units) if u.cells[key].value is not None]
        if len(known) < FEWEST:
            continue
        values = np.array([cell.value for _, cell in known])
        off = np.abs(values - np.median(values))
        scatter = ROBUST * float(np.median(off))
        for (k, cell), distance in zip(known, off, strict=True):
            own = SURE * cell.sigma if cell.sigma is not None and np.isfinite(cell.sigma) else 0.0
            outliers[k, key] = bool(distance > max(FAR * scatter, own) and distance > 0.0)
    return [
        Unit(
            unit.unit,
            unit.session,
            unit.procedure,
            unit.verdict,
            {
                key: Cell(cell.value, cell.sigma, outliers.get((k, key), False))
                for key, cell in unit.cells.items()
            },
        )
        for k, unit in enumerate(units)
    ]


def remarks(units: Sequence[Unit]) -> list[str]:
    """What a reader must know: outliers by name, different procedures, too few units."""
    found = []
    names = {key: title for key, title, _ in COLUMNS}
    for unit in units:
        unlike = [names[key] for key, cell in unit.cells.items() if cell.outlier]
        if unlike:
            who = unit.unit or unit.session
            found.append(f"{who} is unlike the others in {', '.join(unlike)}")
    procedures = sorted({unit.procedure or "none" for unit in units})
    if len(procedures) > 1:
        found.append(f"not the same procedure: {', '.join(procedures)}; compare with care")
    if len(units) < FEWEST:
        found.append(f"{len(units)} units: it takes {FEWEST} to say which is unlike the others")
    return found
