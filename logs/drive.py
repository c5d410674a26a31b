"""`gyrofree run` on a drive: navigation filters side by side, scored on what they did not see.

Three metrics, never to be mixed up: the error against fixes that were withheld, or against the
truth; the prediction error, fed fix minus what the filter expected of it a moment before; and the
residual, fed fix minus the solution after it was used. The last one says nothing about accuracy:
any filter with a high gain makes it small.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inertial.earth import ned_between
from inertial.navigation.batch import run_filters
from inertial.navigation.filters import DEFAULT, FILTERS, UnknownFilter
from inertial.navigation.fix import Fix
from inertial.navigation.navigation import NavigatorConfig
from inertial.navigation.results import place_of
from inertial.navigation.smoother import SMOOTHERS, smooth_drive
from inertial.navigation.solution import WHEELS
from inertial.navigation.standstill import AlignmentSettings
from inertial.rotation import rotation_vector, to_matrix
from logs.drive_log import DriveLog, DriveTruth, read_drive_log
from logs.drive_result import SETTLED, Result, of_filter, of_smoother
from logs.quantities import said_of
from logs.tables.series import check_form, of_drive, write

Array = NDArray[np.float64]
Progress = Callable[[float, str], None]

USUAL = (
    "kf",
    "kf-still",
    "kf-nhc",
    "huber",
    "huber-nhc",
    "fpe-p0-n1",
    "fpe-p0-n10",
    "fpe-fuzzy",
    "mhe-robust",
    "smoother",
)
COURSE_SPEED = 4.0  # m/s, above it the course is taken as the heading


def run_drive(
    folder: Path,
    *,
    imu: str = "imu.csv",
    gnss: str = "gnss.csv",
    every: int = 1,
    outages: Sequence[tuple[float, float]] = (),
    filters: Sequence[str] | None = None,
    truth: Path | None = None,
    units_as_named: bool = False,
    alignment: AlignmentSettings = AlignmentSettings(),
    plot: Path | None = None,
    out: Path | None = None,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Run filters over a drive and score them; gives {"filters": {NAME: scores}, "default": NAME}.

    One fix in `every` is given; outages (start, length in s from the first fix) are a second run
    each filter makes. Lengths in m, speeds in m/s, angles in rad; None where nothing is known.
    out: CSV or Parquet file of what every filter said at every epoch.
    Raises LogError for files that cannot be used, UnknownFilter for a name, OSError.
    """
    names = list(filters) if filters else list(USUAL)
    for name in names:
        if name not in FILTERS and name not in SMOOTHERS:
            raise UnknownFilter(
                f"no navigation filter {name!r}; want one of {', '.join([*FILTERS, *SMOOTHERS])}"
            )
    check_form(out)
    tell = progress or (lambda done, what: None)
    tell(0.0, "reading")
    log = read_drive_log(folder, imu, gnss, truth, units_as_named)
    fed = [replace(fix, withheld=k % every != 0) for k, fix in enumerate(log.fixes)]
    config = NavigatorConfig(lever_arm_b=log.lever_arm_b, alignment=alignment)
    said: list[str] = []
    results = run_all(
        log, fed, names, config, lambda done, what: tell(0.05 + 0.6 * done, what), said.append
    )
    ends: dict[str, list[float | None]] = {name: [] for name in names}
    if outages:
        muted, windows = mute(fed, outages)
        without = run_all(
            log,
            muted,
            names,
            config,
            lambda done, what: tell(0.65 + 0.3 * done, f"{what}, outages"),
        )
        ends = {name: outage_ends(without[name], windows) for name in names}
    scores = {
        name: score(results[name], log.truth, ends[name])
        for name in names
        if results[name] is not None
    }
    missing = [name for name in names if results[name] is None]
    scores |= {name: dict.fromkeys(_EMPTY) | {"outage_end_m": []} for name in missing}
    if plot is not None:
        from logs.figures.drive import draw  # matplotlib is slow to load

        tell(0.97, "drawing")
        draw(plot, log, {name: r for name, r in results.items() if r is not None}, scores)
    result = {
        "filters": {name: scores[name] for name in names},
        "default": DEFAULT,
        "notes": [*log.notes, *said_of(folder / imu, log.timing, False), *said],
    }
    if out is not None:
        parts = {name: of_drive(one) for name, one in results.items() if one is not None}
        result["written"] = write(out, parts, "filter")
    tell(1.0, "")
    return result


def run_all(
    log: DriveLog,
    fixes: list[Fix],
    names: Sequence[str],
    config: NavigatorConfig,
    tell: Progress,
    say: Callable[[str], None] = lambda note: None,
) -> dict[str, Result | None]:
    """Every filter and smoother over the log; None for one that never came to navigate. `say` hears
    why, how the others were aligned, and when they believed a car's wheels.
    """
    forward = [name for name in names if name in FILTERS]
    out: dict[str, Result | None] = {}
    aligned_by = forward or [DEFAULT]  # smoothers start as the filters do
    runs = run_filters(log.imu, fixes, aligned_by, config, progress=tell)
    first = runs[aligned_by[0]]
    if math.isfinite(first.began):
        say(f"aligned at {first.began:.1f} s: {first.text}")
    else:
        say(f"not aligned, so nothing navigates: {first.text}{_usable(fixes, config)}")
    for name in forward:
        for t, wheels in runs[name].wheels:
            say(f"{name}: from {t:.1f} s {WHEELS[wheels]}")
    for name in names:
        if name in forward:
            out[name] = of_filter(runs[name]) if math.isfinite(runs[name].began) else None
        else:
            tell(len(forward) / len(names), name)
            smoothed = smooth_drive(log.imu, fixes, name, config)
            out[name] = None if smoothed is None else of_smoother(smoothed)
    return out


def _usable(fixes: list[Fix], config: NavigatorConfig) -> str:
    """What is to be said of the fixes where they led to no start."""
    usable = [fix for fix in fixes if not fix.withheld and not config.fix.objection(fix)]
    if len(usable) < len(fixes):
        return f"; {len(usable)} of {len(fixes)} fixes can be used for it"
    return "" if all(fix.v_n is not None for fix in usable) else "; the fixes have no velocity"


def mute(
    fixes: list[Fix], outages: Sequence[tuple[float, float]]
) -> tuple[list[Fix], list[tuple[float, float]]]:
    """Fixes with those in the outages withheld as well, and the outages in the log's time."""
    first = min((fix.t for fix in fixes), default=0.0)
    windows = [(first + start, first + start + length) for start, length in outages]
    hidden = [
        replace(f, withheld=f.withheld or any(a <= f.t < b for a, b in windows)) for f in fixes
    ]
    return hidden, windows


def outage_ends(result: Result | None, windows: list[tuple[float, float]]) -> list[float | None]:
    """Horizontal error at the last fix inside each outage, m."""
    if result is None:
        return [None] * len(windows)
    out: list[float | None] = []
    for a, b in windows:
        inside = np.flatnonzero((result.t >= a) & (result.t < b) & result.unseen)
        out.append(float(math.hypot(*result.y[inside[-1], :2])) if len(inside) else None)
    return out


_EMPTY = (
    "position_h_rms_m",
    "position_v_rms_m",
    "velocity_h_rms_mps",
    "velocity_v_rms_mps",
    "heading_rms_rad",
    "tilt_rms_rad",
    "prediction_1s_m",
    "residual_to_fed_m",
    "outage_end_m",
    "nees_mean",
    "us_per_epoch",
)


def score(result: Result, truth: DriveTruth | None, ends: list[float | None]) -> dict[str, Any]:
    """The scores of one filter; docs/navigation.md says what each means."""
    out: dict[str, Any] = dict.fromkeys(_EMPTY)
    chosen = result.scored
    out["outage_end_m"] = ends
    out["us_per_epoch"] = result.us_per_epoch
    out["position_h_rms_m"], out["position_v_rms_m"] = (
        _rms(result.y[chosen, :2]),
        _rms(result.y[chosen, 2:3]),
    )
    out["velocity_h_rms_mps"], out["velocity_v_rms_mps"] = (
        _rms(result.y[chosen, 3:5]),
        _rms(result.y[chosen, 5:6]),
    )
    out["heading_rms_rad"] = _rms(course_error(result, chosen)[:, None])
    fed = ~result.unseen & (result.t >= result.began + SETTLED)
    if result.left is not None:
        out["residual_to_fed_m"] = _rms(result.left[fed, :2])
        if not np.array_equal(
            result.left[fed, :2], result.y[fed, :2]
        ):  # a smoother predicts nothing
            out["prediction_1s_m"] = _rms(result.y[fed, :2])
    if truth is not None:
        out |= against_truth(result, truth)
    return out


def course_error(result: Result, chosen: NDArray[np.bool_]) -> Array:
    """Heading minus course over ground where the vehicle is fast enough, (k,) rad."""
    chosen = chosen & np.array([fix.v_n is not None for fix in result.fixes], dtype=bool)
    v = np.array([fix.v_n for fix, c in zip(result.fixes, chosen, strict=True) if c]).reshape(-1, 3)
    fast = np.hypot(v[:, 0], v[:, 1]) > COURSE_SPEED
    error = result.yaw[chosen][fast] - np.arctan2(v[fast, 1], v[fast, 0])
    return (error + math.pi) % (2.0 * math.pi) - math.pi


def against_truth(result: Result, truth: DriveTruth) -> dict[str, Any]:
    """Scores against the truth at the times of all fixes, where the log has it; after the
    correction.
    """
    rows = result.t >= result.began + SETTLED
    rows &= (result.t >= truth.t[0]) & (result.t <= truth.t[-1])
    t, x, P = result.t[rows], result.x[rows], result.P[rows]
    near = np.clip(np.searchsorted(truth.t, t - 1e-9), 0, len(truth.t) - 1)
    out: dict[str, Any] = {}
    parts, places = [], []
    if truth.q_nb is not None:
        C_bn = x["C_nb"].transpose(0, 2, 1)
        psi = rotation_vector(to_matrix(truth.q_nb[near]) @ C_bn)
        out["tilt_rms_rad"], out["heading_rms_rad"] = _rms(psi[:, :2]), _rms(psi[:, 2:])
        parts, places = [psi], [0, 1, 2]
    if truth.v_n is not None:
        v = np.column_stack([np.interp(t, truth.t, column) for column in truth.v_n.T])
        out["velocity_h_rms_mps"], out["velocity_v_rms_mps"] = (
            _rms((x["v_n"] - v)[:, :2]),
            _rms((x["v_n"] - v)[:, 2:]),
        )
        parts, places = [*parts, x["v_n"] - v], [*places, 3, 4, 5]
    if truth.position is not None:
        p = np.column_stack([np.interp(t, truth.t, column) for column in truth.position.T])
        d = np.column_stack(ned_between(p.T, place_of(x))) * (1.0, 1.0, -1.0)
        out["position_h_rms_m"], out["position_v_rms_m"] = _rms(d[:, :2]), _rms(d[:, 2:])
        parts, places = [*parts, d], [*places, 6, 7, 8]
    if len(places) == 9 and len(t):
        e = np.hstack(parts)
        out["nees_mean"] = float(
            np.mean(np.einsum("ki,ki->k", e, np.linalg.solve(P, e[:, :, None])[:, :, 0]))
        )
    return out


def _rms(errors: Array) -> float | None:
    """Root of the mean of the squared row lengths; None for no rows."""
    errors = errors[np.isfinite(errors).all(axis=1)] if errors.size else errors
    return float(np.sqrt(np.mean(np.sum(np.square(errors), axis=1)))) if errors.size else None
