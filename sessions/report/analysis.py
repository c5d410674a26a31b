"""Everything a report says, computed once; figures, tables and verdict only show it."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from inertial.constants import GRAVITY
from sessions.recording.manifest import Manifest
from sessions.report.data import Rate, Run
from sessions.report.paper import CubeTest, PositionError, cube_test, local_gravity, position_error
from sessions.report.segments import Segment, grid, measured, reference, segment
from sessions.report.stability import Allan, Consistency, allan_axes, consistency, longest_rest
from sessions.report.table_test import Plateau, ScaleFactor, plateaus, scale_factor

Array = NDArray[np.float64]


@dataclass(frozen=True)
class RateResult:
    """One estimator against the tachometer."""

    name: str
    plateaus: list[Plateau]
    fit: ScaleFactor | None
    rms: Array | None  # (3,) rad/s where the reference is measured; None without one
    angle_error: float | None  # rad, at the end
    nis: Consistency | None
    position: PositionError | None


@dataclass(frozen=True)
class NavigationResult:
    """One navigation filter against its own fixes."""

    name: str
    fixes: int
    nis_mean: float | None
    nis: Consistency | None
    rejected: float  # share
    distance_m: float  # length of the track
    sigma_end_m: float  # horizontal, one sigma


@dataclass(frozen=True)
class Analysis:
    """All results of one run."""

    run: Run
    segments: list[Segment]
    rates: list[RateResult]
    cube: CubeTest | None
    rest: Segment | None
    allan_axes: list[Allan] = field(default_factory=list)
    navigation: list[NavigationResult] = field(default_factory=list)
    gravity: float = GRAVITY  # m/s^2
    completeness: float | None = None  # 0 to 1; None where the recording itself is damaged

    def rate(self, name: str) -> RateResult | None:
        """The result of an estimator."""
        return next((one for one in self.rates if one.name == name), None)


def analyse(run: Run, manifest: Manifest | None, parts: list[Segment] | None = None) -> Analysis:
    """All results of a run; what the session cannot tell stays None. `parts`: the standstills and
    plateaus, where a procedure has said them; else they are looked for.
    """
    if parts is None:
        parts = segment(run.tacho, run.seconds) if run.tacho is not None else []
    rest = longest_rest(parts) if parts else _all_still(run)
    cube = cube_test(run.accel, _side(manifest), parts, run) if run.accel is not None else None
    g = local_gravity(run)
    bias = cube.bias_b if cube is not None else None
    return Analysis(
        run=run,
        segments=parts,
        rates=[_rate_result(rate, run, parts, bias, g) for rate in run.rates],
        cube=cube,
        rest=rest,
        allan_axes=allan_axes(run.accel, rest)
        if run.accel is not None and rest is not None
        else [],
        navigation=_navigation(run),
        gravity=g,
        completeness=_completeness(manifest, run.device) if run.whole else None,
    )


def _side(manifest: Manifest | None) -> float:
    """Length of the cube's side, m, from the configuration that the session was recorded with."""
    section = (manifest.configuration if manifest else {}).get("estimator")
    layout = section.get("layout") if isinstance(section, dict) else None
    half = layout.get("half_side_m") if isinstance(layout, dict) else None
    return 2.0 * float(half) if isinstance(half, int | float) else 0.1


def _completeness(manifest: Manifest | None, device: str) -> float | None:
    if manifest is None:
        return None
    counts = [count for key, count in manifest.keys.items() if f"/{device}/" in key]
    got, lost = sum(count.messages for count in counts), sum(count.lost for count in counts)
    return got / (got + lost) if got else None


def _all_still(run: Run) -> Segment | None:
    """Without a tachometer: the longest time that an estimator called a standstill."""
    for rate in run.rates:
        edges = np.flatnonzero(np.diff(np.concatenate([[0], rate.still.astype(int), [0]])))
        spans = [(rate.t[a], rate.t[b - 1]) for a, b in zip(edges[::2], edges[1::2], strict=True)]
        if spans:
            begin, end = max(spans, key=lambda span: span[1] - span[0])
            return Segment(float(begin), float(end), 0.0, 0.0, 0.0) if end - begin > 1.0 else None
    return None


def _rate_result(
    rate: Rate, run: Run, parts: list[Segment], bias: Array | None, g: float
) -> RateResult:
    found = plateaus(rate, parts, run.tacho) if run.tacho is not None else []
    rms = angle = None
    if run.tacho is not None:
        omega_z = reference(run.tacho, rate.t)
        error = rate.omega_b - np.column_stack([np.zeros((len(omega_z), 2)), omega_z])
        known = measured(run.tacho, rate.t)
        rms = np.sqrt((error[known] ** 2).mean(axis=0)) if known.any() else None
        t, step = grid(run.tacho, float(rate.t[0]), float(rate.t[-1]))
        turned = float(reference(run.tacho, t).sum() * step)
        angle = float(rate.angle_z[-1] - rate.angle_z[0]) - turned
    start = next((part.end for part in parts if part.still), 0.0)
    return RateResult(
        name=rate.name,
        plateaus=found,
        fit=scale_factor(found),
        rms=rms,
        angle_error=angle,
        nis=consistency(rate.name, rate.nis, rate.nis_dof),
        position=position_error(rate, bias, start, g),
    )


def _navigation(run: Run) -> list[NavigationResult]:
    found = []
    for nav in run.navigation:
        if len(nav.t) < 2:
            continue
        mine = next((one for one in run.corrections if one.name == nav.name), None)
        nis = consistency(nav.name, mine.nis, mine.dof) if mine is not None else None
        steps = np.linalg.norm(np.diff(nav.p_ned[:, :2], axis=0), axis=1)
        found.append(
            NavigationResult(
                name=nav.name,
                fixes=len(mine.t) if mine is not None else 0,
                nis_mean=nis.mean if nis is not None else None,
                nis=nis,
                rejected=float(1.0 - mine.accepted.mean())
                if mine is not None and len(mine.t)
                else 0.0,
                distance_m=float(steps.sum()),
                sigma_end_m=float(np.hypot(nav.sigma[-1, 6], nav.sigma[-1, 7]))
                if nav.sigma.shape[1] > 7
                else 0.0,
            )
        )
    return found
