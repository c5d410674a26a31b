"""A cube's log through every rate estimator, scored against truth or, without it, against the
tachometer.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inertial.calibration.card import Card, read_card
from inertial.constants import GRAVITY
from inertial.layouts.catalogue import find
from inertial.layouts.layout import GeometryError, Layout
from inertial.plausible import doubt_of_frozen, doubt_of_gravity, doubt_of_sense
from inertial.rate import resolved
from inertial.rate.batch import RateColumns
from inertial.rate.beliefs import make
from inertial.rate.estimators import ESTIMATORS, ProductsRate, leave_out
from inertial.rate.names import LEADER
from inertial.rate.sight import BLIND, VALID
from inertial.rate.tachometer import SUFFIX
from logs.cube_axes import agreement, axes_of, doubts_of_settings, moving
from logs.cube_log import CubeLog, centre_force, read_log, squared_rate
from logs.cube_parts import Monitored, Part, cut, monitored
from logs.cube_run import EstimatorRun, reference
from logs.cube_score import bound_of, notes_of, score
from logs.quantities import refuse, said_of
from logs.sheet import LogError
from logs.tables.series import check_form, of_cube, write

Array = NDArray[np.float64]
Progress = Callable[[float, str], None]

SHOW_GAPS = 20
BLOCK = 8192  # samples that an estimator is given at once
SAID = ("omega_b", "P", "q_nb", "angle_z", "alpha_b", "f_b", "still", "p_n", "sight", "started")
SCORED = ("omega_b", "P", "angle_z", "sight", "started")  # ... where nothing is drawn
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
    units_as_named: bool = False,
    plot: Path | None = None,
    out: Path | None = None,
    progress: Progress = nothing,
) -> dict[str, Any]:
    """Run the log; the JSON object of `gyrofree run`: estimators, default, gaps, axes, and notes
    for people.

    resolve: where a log begins while turning, correct what came before the sign was decided; such a
    track is named so. A value that cannot be known (no truth for x and y, say) is None. out: CSV or
    Parquet file of what every estimator said of every sample. Raises
    LogError, GeometryError, CardError (all ValueError) and OSError.
    """
    if not half_side_m > 0.0:
        raise GeometryError(
            f"--half-side {half_side_m}: want more than 0 m, from the centre to a face"
        )
    shape = find(layout, half_side_m)
    check_form(out)
    progress(0.0, "reading")
    data = read_log(log, shape.axis_names, lsb_mg)
    used = read_card(card) if card is not None else None
    doubtful = refuse(
        log,
        [
            doubt_of_frozen(data.f_axis),
            doubt_of_gravity(centre_force(data.f_axis, shape), _lsb(data)),
        ],
        units_as_named,
    )
    square = squared_rate(data.f_axis, shape)
    if square is not None and (doubt := doubt_of_sense(square)):
        doubtful.append(doubt.text)
    doubtful += doubts_of_settings(data, shape, _lsb(data))
    if tacho_aid and data.tacho is None:
        raise LogError(f"--tacho-aid: {log} has no column tacho_rad_s")
    lean = plot is None and out is None and not resolve
    tracks, watched, notes = run_log(
        data, shape, used, estimators, progress, tacho_aid, resolve, lean
    )
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
    known = used.layout(shape) if used is not None else shape
    f_axis = data.f_axis * np.array(shape.gain)
    agree = agreement(known, f_axis if used is None else used.correct(f_axis), moving(data))
    notes += [agree.text] if agree and agree.text else []
    bound = bound_of(data, known, truth, agree)
    plain = [name.partition("+")[0] for name in tracks]
    asked = [*tracks, *(name for name in estimators or ESTIMATORS if name not in plain)]
    default = next(
        (name for name, of in zip(tracks, plain, strict=True) if of == LEADER),
        None,
    )
    result = {
        "estimators": {name: score(tracks.get(name), truth, bound) for name in asked},
        "default": default or next(iter(tracks), None),
        "gaps": {
            "count": len(data.gaps),
            "missing_samples": sum(gap.missing for gap in data.gaps),
            "list": [asdict(gap) for gap in data.gaps[:SHOW_GAPS]],
        },
        "axes": axes_of(data, shape, watched),
        "notes": [
            *doubtful,
            *said_of(log, data.timing, data.cut_off),
            *notes,
            *notes_of(data, truth, used),
        ],
    }
    if plot is not None:
        from logs.figures.cube import draw  # here: matplotlib only where something is drawn

        progress(0.95, "drawing")
        draw(plot, data, tracks, truth, result)
    if out is not None:
        parts = {name: of_cube(data, track, truth) for name, track in tracks.items()}
        result["written"] = write(out, parts, "estimator")
    progress(1.0, "done")
    return result


def _lsb(data: CubeLog) -> float | None:
    """mg that a count was taken for; None for a log in m/s^2."""
    return data.lsb_mps2 / GRAVITY * 1e3 if data.lsb_mps2 else None


def run_log(
    data: CubeLog,
    shape: Layout,
    card: Card | None,
    names: Sequence[str] | None,
    progress: Progress = nothing,
    tacho_aid: bool = False,
    resolve: bool = False,
    lean: bool = False,
) -> tuple[dict[str, EstimatorRun], Monitored, list[str]]:
    """Tracks of the estimators that can use this layout, what the axis monitor says, and why others
    cannot. lean: only what is scored is kept of the tracks. Raises LogError, CardError.
    """
    gain = np.array(shape.gain)
    f_axis = data.f_axis if np.all(gain == 1.0) else data.f_axis * gain
    if card is not None:
        shape, f_axis = card.layout(shape), card.correct(f_axis)
    chosen = list(names) if names else list(ESTIMATORS)
    for name in chosen:
        if name not in ESTIMATORS:
            raise LogError(f"no estimator {name!r}; want some of {', '.join(ESTIMATORS)}")
    watched = monitored(data, shape, f_axis)
    tracks: dict[str, EstimatorRun] = {}
    notes = [f"{text}: not used" for text in watched.named(data.names)]
    notes += [watched.width] if watched.width else []
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
                    watched.parts,
                    lambda part, k=k, name=name: progress(
                        0.05 + 0.9 * (k + part) / len(chosen), name
                    ),
                    card,
                    tacho_aid,
                    resolve,
                    lean,
                )
            tracks[track.name] = track
            notes += [track.kept] if track.kept else []
        except GeometryError as error:
            notes.append(f"{name}: {error}")
        except np.linalg.LinAlgError:
            notes.append(
                f"{name}: its rate grew beyond all numbers on layout {shape.name}: no result"
            )
    return tracks, watched, notes


def run_estimator(
    name: str,
    data: CubeLog,
    shape: Layout,
    f_axis: Array,
    parts: Sequence[Part],
    progress: Callable[[float], None] = lambda part: None,
    card: Card | None = None,
    tacho_aid: bool = False,
    resolve: bool = False,
    lean: bool = False,
) -> EstimatorRun:
    """Every sample of a log through one estimator, in the parts that the axis monitor cut; missing
    samples are announced to it as on the live path.

    With tacho_aid the name of the track ends in SUFFIX, once the estimator has used the tachometer;
    with resolve in resolved.SUFFIX, where the log began while turning and a sign was decided.
    Raises GeometryError when the axes that are believed cannot see the motion.
    """
    estimator, n = make(ESTIMATORS[name], shape, card), len(data.t_s)
    reports = _reports(data) if tacho_aid else {}
    said = _Said(n, SCORED if lean else SAID)
    busy, left_out, refused = 0, 0, ""
    for part in cut(parts, list(reports)):
        began = time.thread_time_ns()
        if part.missing:
            estimator.skip(part.missing)
        if part.mask != left_out:
            left_out = part.mask
            if (error := leave_out(estimator, left_out)) is not None:
                refused = f"{name} knew nothing while axes were not good: {error}"
        estimator.doubt(part.doubted)
        for begin in range(part.begin, part.end, BLOCK):
            rows = slice(begin, min(begin + BLOCK, part.end))
            said.take(rows, estimator.feed(data.t_s[rows], f_axis[rows]))
        if (last := part.end - 1) in reports:
            estimator.tacho(float(data.t_s[last]), reports[last], TACHO_SIGMA)
        busy += time.thread_time_ns() - began
        progress(part.end / n)
    run = replace(said.run(name, busy / n / 1000.0), kept=refused)
    if resolve and issubclass(ESTIMATORS[name], ProductsRate):
        return _resolved(run, make(ESTIMATORS[name], shape, card), data, f_axis)
    return run


class _Said:
    """What an estimator says of a log of n samples, block by block."""

    def __init__(self, n: int, fields: Sequence[str]) -> None:
        self._fields = fields
        self._n, self._aided, self._blind, self._why = n, False, 0, ""
        self._columns: dict[str, NDArray[Any]] = {}

    def take(self, rows: slice, said: RateColumns) -> None:
        """Its columns over some rows."""
        for field in SAID:
            column = getattr(said, field)
            if field not in self._columns:
                kept = self._n if field in self._fields else 0
                self._columns[field] = np.empty((kept, *column.shape[1:]), column.dtype)
            if field in self._fields:
                self._columns[field][rows] = column
        self._aided |= bool(said.aided.any())
        blind = np.nonzero((said.sight == BLIND).all(axis=1))[0]
        self._blind += len(blind)
        if len(blind):
            self._why = said.sight_reason(int(blind[-1]))

    def run(self, name: str, us_per_sample: float) -> EstimatorRun:
        """All of it; a rate that is not known in more than half of the samples is named so."""
        why = (self._why or "not known") if 2 * self._blind > self._n else ""
        name = name + SUFFIX if self._aided else name
        return EstimatorRun(name, **self._columns, us_per_sample=us_per_sample, blind=why)


def _resolved(run: EstimatorRun, fresh: ProductsRate, data: CubeLog, f_axis: Array) -> EstimatorRun:
    """The run with its beginning corrected, where the log began while turning and a sign was
    decided later.
    """
    hole = np.diff(data.index) > 1
    whole = int(np.argmax(hole)) + 1 if hole.any() else len(data.t_s)
    past = resolved.resolve(fresh.core, data.t_s[:whole], f_axis[:whole])
    if not past:
        return run
    past.into(run.omega_b, run.P, run.angle_z, run.q_nb)
    n = len(past.omega_b)
    run.sight[:n], run.started[:n] = VALID, True
    return replace(run, name=run.name + resolved.SUFFIX, blind="")


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
