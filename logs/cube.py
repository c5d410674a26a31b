"""A cube's log through every rate estimator, scored against truth or, without it, against the
tachometer.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inertial.calibration.card import Card, read_card
from inertial.layouts.catalogue import find
from inertial.layouts.layout import GeometryError, Layout
from inertial.rate import resolved
from inertial.rate.beliefs import make
from inertial.rate.estimators import ESTIMATORS, ProductsRate
from inertial.rate.names import LEADER
from inertial.rate.sight import ALL_BLIND
from inertial.rate.tachometer import SUFFIX
from logs.cube_axes import examine
from logs.cube_log import CubeLog, LogError, read_log
from logs.cube_run import EstimatorRun, reference
from logs.cube_score import bound_of, notes_of, score

Array = NDArray[np.float64]
Progress = Callable[[float, str], None]

WARM_SAMPLES = (
    560  # run on a throw-away estimator, into the first turn, so that no compiler is timed
)
SHOW_GAPS = 20
TACHO_SIGMA = (
    0.03  # rad/s; a log says neither how well its tachometer measured nor when its pulses came
)
REPORT_S = 0.25  # s, between reports of a tachometer that reads the same


def nothing(done: float, what: str) -> None:
    """Progress that nobody looks at."""


def run_cube(
    log: Path,
    *,
    layout: str = "cube",
    half_side_m: float = 0.05,
    lsb_mg: float | None = None,
    card: Path | None = None,
    estimators: list[str] | None = None,
    tacho_aid: bool = False,
    resolve: bool = False,
    plot: Path | None = None,
    progress: Progress = nothing,
) -> dict[str, Any]:
    """Run the log; the JSON object of `gyrofree run`: estimators, default, gaps, axes, and notes
    for people.

    resolve: where a log begins while turning, correct what came before the sign was decided; such a
    track is named so. A value that cannot be known (no truth for x and y, say) is None. Raises
    LogError, GeometryError, CardError (all ValueError) and OSError.
    """
    if not half_side_m > 0.0:
        raise GeometryError(
            f"--half-side {half_side_m}: want more than 0 m, from the centre to a face"
        )
    shape = find(layout, half_side_m)
    progress(0.0, "reading")
    data = read_log(log, shape.axis_names, lsb_mg)
    used = read_card(card) if card is not None else None
    if tacho_aid and data.tacho is None:
        raise LogError(f"--tacho-aid: {log} has no column tacho_rad_s")
    tracks, notes = run_log(data, shape, used, estimators, progress, tacho_aid, resolve)
    truth = reference(data)
    aided = [name for name in tracks if name.endswith(SUFFIX)]
    if truth.name == "tachometer":
        notes += [
            f"{name}: aided by the tachometer that it would be scored against: not scored"
            for name in aided
        ]
    elif aided:
        notes.append(f"{', '.join(aided)}: aided by the tachometer")
    if late := [name for name in tracks if name.endswith(resolved.SUFFIX)]:
        notes.append(
            f"{', '.join(late)}: corrected backwards once the sign of the rate was known; live it"
            " is not"
        )
    notes += [
        f"{name}: its rate is not known in most of this log: {t.blind}"
        for name, t in tracks.items()
        if t.blind
    ]
    progress(0.95, "bound")
    bound = bound_of(data, used.layout(shape) if used is not None else shape, truth)
    plain = [name.partition("+")[0] for name in tracks]
    known = [*tracks, *(name for name in estimators or ESTIMATORS if name not in plain)]
    default = next(
        (name for name, of in zip(tracks, plain, strict=True) if of == LEADER),
        None,
    )
    result = {
        "estimators": {name: score(tracks.get(name), truth, bound) for name in known},
        "default": default or next(iter(tracks), None),
        "gaps": {
            "count": len(data.gaps),
            "missing_samples": sum(gap.missing for gap in data.gaps),
            "list": [asdict(gap) for gap in data.gaps[:SHOW_GAPS]],
        },
        "axes": examine(data, shape),
        "notes": notes + notes_of(data, truth, used),
    }
    if plot is not None:
        from logs.cube_plot import draw  # here: matplotlib only where something is drawn

        progress(0.95, "drawing")
        draw(plot, data, tracks, truth, result)
    progress(1.0, "done")
    return result


def run_log(
    data: CubeLog,
    shape: Layout,
    card: Card | None,
    names: Sequence[str] | None,
    progress: Progress = nothing,
    tacho_aid: bool = False,
    resolve: bool = False,
) -> tuple[dict[str, EstimatorRun], list[str]]:
    """Tracks of the estimators that can use this layout, and why the others cannot. Raises
    LogError, CardError.
    """
    f_axis = data.f_axis * np.array(shape.gain)
    if card is not None:
        shape, f_axis = card.layout(shape), card.correct(f_axis)
    chosen = list(names) if names else list(ESTIMATORS)
    for name in chosen:
        if name not in ESTIMATORS:
            raise LogError(f"no estimator {name!r}; want some of {', '.join(ESTIMATORS)}")
    tracks, notes = {}, []
    for k, name in enumerate(chosen):
        try:
            with np.errstate(
                over="ignore", invalid="ignore"
            ):  # an integral that runs away is a result, too
                track = run_estimator(
                    name,
                    data,
                    shape,
                    f_axis,
                    lambda part, k=k, name=name: progress(
                        0.05 + 0.9 * (k + part) / len(chosen), name
                    ),
                    card,
                    tacho_aid,
                    resolve,
                )
            tracks[track.name] = track
        except GeometryError as error:
            notes.append(f"{name}: {error}")
        except np.linalg.LinAlgError:
            notes.append(
                f"{name}: its rate grew beyond all numbers on layout {shape.name}: no result"
            )
    return tracks, notes


def run_estimator(
    name: str,
    data: CubeLog,
    shape: Layout,
    f_axis: Array,
    progress: Callable[[float], None] = lambda part: None,
    card: Card | None = None,
    tacho_aid: bool = False,
    resolve: bool = False,
) -> EstimatorRun:
    """Every sample of a log through one estimator; missing samples are announced to it as on the
    live path.

    With tacho_aid the name of the track ends in SUFFIX, once the estimator has used the tachometer;
    with resolve in resolved.SUFFIX, where the log began while turning and a sign was decided.
    """
    warm = make(ESTIMATORS[name], shape)
    for k in range(min(WARM_SAMPLES, len(data.t_s))):
        warm.step(k, k * data.period_s, f_axis[k])
    estimator, n = make(ESTIMATORS[name], shape, card), len(data.t_s)
    reports, aided = _reports(data) if tacho_aid else {}, False
    omega, P, q, angle = np.zeros((n, 3)), np.zeros((n, 3, 3)), np.zeros((n, 4)), np.zeros(n)
    alpha, force, still, p_n = (
        np.zeros((n, 3)),
        np.zeros((n, 3)),
        np.zeros(n, dtype=bool),
        np.zeros((n, 3)),
    )
    missing = np.diff(data.index, prepend=data.index[0] - 1) - 1
    busy, blind, why = 0, 0, ""
    for k in range(n):
        started = time.thread_time_ns()
        if missing[k]:
            estimator.skip(int(missing[k]))
        s = estimator.step(int(data.index[k]), float(data.t_s[k]), f_axis[k])
        if k in reports:
            estimator.tacho(float(data.t_s[k]), reports[k], TACHO_SIGMA)
        busy += time.thread_time_ns() - started
        aided = aided or bool(s.aid)
        if tuple(s.sight) == ALL_BLIND:
            blind, why = blind + 1, s.sight_reason
        omega[k], P[k], q[k], angle[k], still[k] = s.omega_b, s.P, s.q_nb, s.angle_z, s.still
        alpha[k], force[k], p_n[k] = s.alpha_b, s.f_b, s.p_n
        if k % 200 == 0:
            progress(k / n)
    called = name + SUFFIX if aided else name
    if resolve and issubclass(ESTIMATORS[name], ProductsRate):
        fresh = make(ESTIMATORS[name], shape, card)
        whole = int(np.argmax(missing[1:] > 0)) + 1 if (missing[1:] > 0).any() else n
        if past := resolved.resolve(fresh.core, data.t_s[:whole], f_axis[:whole]):
            called += resolved.SUFFIX
            past.into(omega, P, angle, q)
            blind = 0
    said = why if 2 * blind > n else ""
    return EstimatorRun(
        called, omega, P, q, angle, alpha, force, still, p_n, busy / n / 1000.0, said
    )


def _reports(data: CubeLog) -> dict[int, float]:
    """The tachometer's column as reports, by row: its rate, rad/s, when it changes, and every
    quarter of a second.
    """
    found, last = {}, 0
    for k in range(1, len(data.t_s)):
        rate = float(data.tacho[k])
        if np.isfinite(rate) and (
            rate != data.tacho[k - 1] or data.t_s[k] - data.t_s[last] >= REPORT_S
        ):
            found[k], last = rate, k
    return found
