"""The picture of `gyrofree run`: rates, their errors and the angle of every estimator over the
reference.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib

from inertial.whole_file import whole

matplotlib.use("Agg")  # no screen; this module is imported only where something is drawn

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from logs.cube_log import CubeLog
from logs.cube_run import EstimatorRun, Reference
from logs.figures.names import RATE_UNIT, REFERENCE, estimator_colour, estimator_title
from messages.text import drawn

DEG = 180.0 / np.pi
STYLE = {
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "figure.facecolor": "white",
    "savefig.dpi": 130,
    "lines.linewidth": 1.1,
}


def draw(
    path: Path,
    data: CubeLog,
    tracks: Mapping[str, EstimatorRun],
    truth: Reference,
    result: Mapping[str, Any],
) -> None:
    """Write the picture; raises OSError."""
    t = data.t_s - data.t_s[0]
    with plt.rc_context(STYLE):
        figure, grid = plt.subplots(4, 2, figsize=(12.5, 11.0), sharex=True, layout="constrained")
        for k, axis in enumerate("xyz"):
            _rates(grid[k, 0], grid[k, 1], t, k, axis, tracks, truth, result)
        _angles(grid[3, 0], grid[3, 1], t, tracks, truth)
        for one in grid.ravel():
            _gaps(one, data)
        for one in grid[3]:
            one.set_xlabel("time, s")
            one.set_xlim(t[0], t[-1])
        title = (
            f"{data.path.name}: {len(data.names)} axes, {data.seconds:.1f} s at"
            f" {1.0 / data.period_s:.0f} Hz"
        )
        figure.suptitle(drawn(title), fontsize=12, fontweight="bold", x=0.01, ha="left")
        handles, labels = grid[2, 0].get_legend_handles_labels()
        figure.legend(
            handles, labels, loc="outside upper right", ncols=max(1, len(labels)), frameon=False
        )
        with whole(path) as draft:
            figure.savefig(draft)
        plt.close(figure)


def _rates(
    left: Axes,
    right: Axes,
    t: np.ndarray,
    k: int,
    axis: str,
    tracks: Mapping[str, EstimatorRun],
    truth: Reference,
    result,
) -> None:
    known = bool(np.isfinite(truth.omega_b[:, k]).any())
    reach = 0.0
    for name, track in tracks.items():
        colour, title = estimator_colour(name, tracks), estimator_title(name)
        left.plot(t, track.omega_b[:, k] * DEG, color=colour, label=title)
        if not known:
            continue
        error = (track.omega_b[:, k] - truth.omega_b[:, k]) * DEG
        rms = result["estimators"][name]["rate_rms_radps"][k] * DEG
        right.plot(t, error, color=colour, label=f"{title}: RMS {rms:.2f} {RATE_UNIT}")
        if name == result["default"]:
            sigma = 3.0 * np.sqrt(np.maximum(track.P[:, k, k], 0.0)) * DEG
            right.fill_between(t, -sigma, sigma, color=colour, alpha=0.15, linewidth=0)
            reach = max(reach, 1.3 * float(np.quantile(np.abs(error), 0.995)), 3.0 * rms, 1.0)
    if known:
        left.plot(
            t,
            truth.omega_b[:, k] * DEG,
            color=REFERENCE,
            linewidth=0.9,
            linestyle=(0, (4, 2)),
            label=truth.name,
        )
        if reach:
            right.set_ylim(-2.0 * reach, 2.0 * reach)
        right.legend(loc="upper left", fontsize=7.5, frameon=False, ncols=2)
    else:
        right.text(
            0.5,
            0.5,
            f"$\\omega_{axis}$ is not known in this log",
            transform=right.transAxes,
            ha="center",
        )
    left.set_ylabel(f"$\\omega_{axis}$, {RATE_UNIT}")
    right.set_ylabel(f"error of $\\omega_{axis}$, °/s")


def _angles(
    left: Axes, right: Axes, t: np.ndarray, tracks: Mapping[str, EstimatorRun], truth: Reference
) -> None:
    known = bool(np.isfinite(truth.angle_z).any())
    for name, track in tracks.items():
        colour, title = estimator_colour(name, tracks), estimator_title(name)
        left.plot(t, track.angle_z * DEG, color=colour)
        if known:
            error = (track.angle_z - truth.angle_z) * DEG
            right.plot(t, error, color=colour, label=f"{title}: {error[-1]:+.1f}° at the end")
    if known:
        left.plot(t, truth.angle_z * DEG, color=REFERENCE, linewidth=0.9, linestyle=(0, (4, 2)))
        right.set_yscale("symlog", linthresh=5.0)
        right.legend(loc="upper left", fontsize=7.5, frameon=False)
    left.set_ylabel("angle about z, °")
    right.set_ylabel("error of the angle, °")


def _gaps(axes: Axes, data: CubeLog) -> None:
    for gap in data.gaps:
        start = gap.t_s - data.t_s[0]
        axes.axvspan(start, start + gap.seconds, color="#bbbbbb", linewidth=0)
