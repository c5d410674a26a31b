"""Figures of a step while it runs: the estimator against the reference, vibration, gravity.

They are provisional; the report computes its own from the recording.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from inertial.constants import GRAVITY, MILLI_G
from sessions.procedure.evidence import Estimate, Reference
from sessions.procedure.model import DEG, Step
from sessions.report.limits import Limit

Array = NDArray[np.float64]
BATCH = 0.5  # s, errors of an estimate are correlated in time
SURE = 0.9  # share of the looks at which an estimator must know what it says


@dataclass(frozen=True)
class Figure:
    """A number beside its limit."""

    name: str
    value: float  # NaN: not told
    sigma: float  # NaN: not known
    limit: Limit | None


@dataclass
class Live:
    """What the looks of a dwell came to."""

    looks: int = 0
    errors: dict[str, list[tuple[float, float]]] = field(default_factory=dict)  # (s, rad/s)
    shaking: list[float] = field(default_factory=list)
    force: list[Array] = field(default_factory=list)

    def add(
        self,
        t: float,
        reference: Reference | None,
        shaking: float | None,
        newest: Iterable[Estimate],
        force: Array | None,
    ) -> None:
        """One look, t s into the dwell."""
        self.looks += 1
        if shaking is not None:
            self.shaking.append(shaking)
        if force is not None:
            self.force.append(force)
        for one in newest:
            scored = reference is not None and reference.source != one.estimator and not one.aided
            if scored and (one.valid or one.still):
                omega = one.omega if reference.signed else abs(one.omega)
                self.errors.setdefault(one.estimator, []).append((t, omega - reference.omega))

    def figures(self, step: Step, estimator: str) -> list[Figure]:
        """By name, each beside the limit that the procedure sets."""
        limits = dict(step.limits)
        found = [(*row, limits.get(row[0])) for row in self._rows(step, estimator)]
        return [Figure(*row) for row in found]

    def _rows(self, step: Step, estimator: str) -> list[tuple[str, float, float]]:
        nan = float("nan")
        rows = []
        if step.kind in ("rate", "still"):
            errors = np.array(self.errors.get(estimator, [])).reshape(-1, 2)
            if not self.looks or len(errors) < SURE * self.looks:
                rows = [(name, nan, nan) for name in ("rate_error_dps", "rate_scatter_dps")]
            else:
                e = errors[:, 1] / DEG
                sigma = batch_sigma(errors[:, 0], e)
                rows = [("rate_error_dps", float(e.mean()), sigma)]
                rows.append(("rate_scatter_dps", float(e.std()), nan))
        if step.kind == "pose" and self.force:
            size = float(np.linalg.norm(np.mean(self.force, axis=0)))
            rows.append(("force_error_mg", (size - GRAVITY) / MILLI_G, nan))
        if self.shaking:
            rows.append(("vibration_mg", max(self.shaking) / MILLI_G, nan))
        return rows


def batch_sigma(t: Array, values: Array) -> float:
    """Standard error of the mean of correlated values, from means of BATCH long pieces."""
    piece = ((t - t[0]) / BATCH + 1e-9).astype(int)
    means = np.array([values[piece == k].mean() for k in np.unique(piece)])
    return float(means.std(ddof=1) / np.sqrt(len(means))) if len(means) >= 3 else float("nan")
