"""Attitude filters on logs with a reference: what `gyrofree run LOG --attitude` prints."""

import time
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inertial.attitude.filters import ATTITUDES
from inertial.timing import Timing
from inertial.whole_file import whole
from logs.attitude_log import Trial, read_trials
from logs.sheet import LogError
from logs.tables.series import check_form, of_attitude, write
from messages.text import drawn

Array = NDArray[np.float64]

BRIDGED_S = 0.3  # s without samples that are interpolated; after more a filter starts anew

Progress = Callable[[float, str], None]


def run_attitude(
    log: Path,
    *,
    filters: list[str] | None = None,
    plot: Path | None = None,
    units_as_named: bool = False,
    out: Path | None = None,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Run filters over one log, or every log of a folder, and score their inclination where the
    reference is good.

    filters: names of ATTITUDES; None: all. plot: an image file (.png, .svg, .pdf) of the errors
    along time. out: CSV or Parquet file of every filter's attitude. Returns
    {"filters": {name: figures}, "default": name, "logs": {log: {"rate_hz",
    "samples", "scored", "filters": {name: figures}}}}; figures are inclination_rms_rad,
    inclination_max_rad and us_per_sample, at the top the mean over the logs (the largest of the
    maxima). Raises LogError, a ValueError.
    """
    names = list(ATTITUDES) if filters is None else filters
    for name in names:
        if name not in ATTITUDES:
            raise LogError(f"no attitude filter {name!r}; want some of {', '.join(ATTITUDES)}")
    if not names:
        raise LogError(f"no attitude filter named; want some of {', '.join(ATTITUDES)}")
    check_form(out)
    trials = read_trials(Path(log), units_as_named)
    logs, errors, series = {}, {}, {}
    for k, trial in enumerate(trials):
        figures = {}
        for j, name in enumerate(names):
            if progress:
                progress((k + j / len(names)) / len(trials), f"{trial.name}: {name}")
            q_nb, cost = attitude_of(trial, name)
            error = inclination_error(q_nb, trial.up_b)
            if out is not None:
                said = of_attitude(trial.t, q_nb, error, trial.scored, trial.name)
                series.setdefault(name, []).append(said)
            errors[trial.name, name] = error
            figures[name] = _figures(error[trial.scored], cost)
        logs[trial.name] = {
            "rate_hz": 1.0 / trial.period,
            "samples": len(trial.t),
            "scored": int(trial.scored.sum()),
            "filters": figures,
        }
    if progress:
        progress(1.0, "done")
    if plot is not None:
        _draw(Path(plot), trials, names, errors)
    result = {
        "filters": {name: _mean(logs, name) for name in names},
        "default": next(iter(ATTITUDES)),
        "logs": logs,
        "notes": [note for trial in trials for note in trial.notes],
    }
    if out is not None:
        result["written"] = write(Path(out), series, "filter")
    return result


def run_filter(trial: Trial, name: str) -> tuple[Array, float]:
    """Inclination error (n,) rad of one filter, nan without a reference, and its time per sample,
    us.
    """
    q_nb, cost = attitude_of(trial, name)
    return inclination_error(q_nb, trial.up_b), cost


def attitude_of(trial: Trial, name: str) -> tuple[Array, float]:
    """Attitude q_nb (n, 4) by one filter, and its time per sample, us. As live, a hole of up to
    BRIDGED_S is bridged; after a longer one it starts anew.
    """
    ATTITUDES[name](trial.period).batch(
        trial.f_b[:2], trial.omega_b[:2]
    )  # compile before the clock runs
    q_nb = np.empty((len(trial.t), 4))
    started = time.perf_counter_ns()
    for rows in _stretches(trial.timing):
        index = trial.timing.index[rows] - trial.timing.index[rows][0]
        even = [_even(index, values[rows]) for values in (trial.f_b, trial.omega_b)]
        q_nb[rows] = ATTITUDES[name](trial.period).batch(*even)[index]
    cost = (time.perf_counter_ns() - started) / 1000.0 / len(trial.t)
    return q_nb, cost


def _stretches(timing: Timing) -> list[slice]:
    """Rows between long holes."""
    ends = [hole.row for hole in timing.holes if hole.seconds > BRIDGED_S]
    return [slice(a, b) for a, b in pairwise([0, *ends, len(timing.index)])]


def _even(index: NDArray[np.int64], values: Array) -> Array:
    """Values (n, 3) at sample numbers index (n,), those that are missing interpolated."""
    wanted = np.arange(int(index[-1]) + 1)
    if len(wanted) == len(index):
        return values
    return np.column_stack([np.interp(wanted, index, column) for column in values.T])


def inclination_error(q_nb: Array, up_b: Array) -> Array:
    """Angle (n,) rad between up by q_nb (n, 4) and by the reference (n, 3): 2 acos(sqrt(w^2 + z^2))
    of the error.
    """
    w, x, y, z = q_nb.T
    up = -np.column_stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)])
    return np.arctan2(np.linalg.norm(np.cross(up, up_b), axis=1), np.einsum("ij,ij->i", up, up_b))


def _figures(error: Array, cost: float) -> dict[str, float]:
    return {
        "inclination_rms_rad": float(np.sqrt(np.mean(error**2))),
        "inclination_max_rad": float(error.max()),
        "us_per_sample": cost,
    }


def _mean(logs: dict[str, Any], name: str) -> dict[str, float]:
    rows = [entry["filters"][name] for entry in logs.values()]
    return {
        "inclination_rms_rad": float(np.mean([r["inclination_rms_rad"] for r in rows])),
        "inclination_max_rad": max(r["inclination_max_rad"] for r in rows),
        "us_per_sample": float(np.mean([r["us_per_sample"] for r in rows])),
    }


def _draw(
    file: Path, trials: list[Trial], names: list[str], errors: dict[tuple[str, str], Array]
) -> None:
    import matplotlib  # here: slow to load, and only pictures need it

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(
        len(trials), 1, figsize=(10, 1.0 + 2.4 * len(trials)), squeeze=False
    )
    for axis, trial in zip(axes[:, 0], trials, strict=True):
        step = max(1, len(trial.t) // 3000)
        for name, colour in zip(
            names, ("#0072b2", "#e69f00", "#cc79a7", "#009e73", "#56b4e9"), strict=False
        ):
            error = np.degrees(np.where(trial.scored, errors[trial.name, name], np.nan))
            rms = np.sqrt(np.nanmean(error**2))
            axis.semilogy(
                trial.t[::step],
                error[::step],
                lw=0.8,
                color=colour,
                label=f"{name}: {rms:.2f}° RMS",
            )
        axis.set_title(drawn(trial.name), fontsize=9, loc="left")
        axis.set_ylabel("inclination error, °")
        axis.grid(True, which="major", alpha=0.3)
        axis.legend(fontsize=8, loc="upper right")
    axes[-1, 0].set_xlabel("time, s (gaps: standing still or without reference)")
    figure.tight_layout()
    with whole(file) as draft:
        figure.savefig(draft, dpi=120)
    plt.close(figure)
