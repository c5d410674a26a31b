"""A comparison as one picture: rates, errors, angle and tracks of all sessions on the first one's
time. Degrees.
"""

from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from inertial.whole_file import whole
from logs.figures.names import ANGLE_UNIT, RATE_UNIT, line_colour, line_title
from sessions.library.compare import Comparison, Overlaid, moved
from sessions.library.curves import TACHO, Line
from sessions.report.figures import STYLE

POINTS = 4000  # per line
DASHES = (
    "-",
    (0, (5, 2)),
    (0, (1.5, 1.5)),
    (0, (6, 2, 1.5, 2)),
)
SHADES = (1.0, 0.75, 0.55, 0.45)  # colours tell estimators; sessions have dashes and shades


def draw(found: Comparison, path: Path) -> Path:
    """Write the picture as PNG. Raises OSError."""
    tracks = [(k, one, key) for k, one in enumerate(found.sessions) for key in one.curves.tracks]
    rows = 5 if tracks else 4
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(10.0, 2.1 * rows + 1.2), dpi=120, layout="constrained")
        grid = figure.add_gridspec(rows, 2, height_ratios=[1] * 4 + ([1.6] if tracks else []))
        first = None
        for row, name in enumerate(("x", "y", "z")):
            left = figure.add_subplot(grid[row, 0], sharex=first)
            right = figure.add_subplot(grid[row, 1], sharex=left)
            first = first or left
            _component(left, right, found, name)
        angle, marks = figure.add_subplot(grid[3, 0], sharex=first), figure.add_subplot(grid[3, 1])
        for k, one in enumerate(found.sessions):
            line = one.curves.lines.get(one.lead)
            if line is not None and line.part("angle_z") is not None:
                _plot(angle, one, line, "angle_z", k)
        angle.set(ylabel=f"angle about z, {ANGLE_UNIT}", xlabel="s")
        _words(marks, found)
        if tracks:
            _tracks(figure.add_subplot(grid[4, :]), tracks)
        handles, labels = first.get_legend_handles_labels() if first is not None else ([], [])
        figure.legend(handles, labels, loc="outside upper center", ncols=2, fontsize=8)
        with whole(path) as draft:
            figure.savefig(draft, format="png", metadata={"Software": None})
    return path


def _component(left: Axes, right: Axes, found: Comparison, name: str) -> None:
    """Rates of one component, and their errors beside."""
    for k, one in enumerate(found.sessions):
        line = one.curves.lines.get(one.lead)
        if line is None:
            continue
        _plot(left, one, line, name, k, f"{one.curves.session}: {line_title(line.title)}")
        against, errors = one.curves.error_of(line)
        if name in errors:
            t, values = _thinned(one.curves.t + one.offset_s, errors[name])
            right.plot(
                t,
                np.degrees(values),
                color=line_colour(line.title),
                alpha=SHADES[k],
                linestyle=DASHES[k],
                label=f"against {line_title(against)}",
            )
        for tacho in one.curves.of_kind(TACHO)[:1]:
            if name in tacho.components:
                _plot(left, one, tacho, name, k, alpha=0.45, linewidth=0.6)
    left.set_ylabel(f"$\\omega_{name}$, {RATE_UNIT}")
    right.set_ylabel(f"error of $\\omega_{name}$, {RATE_UNIT}")
    if not right.lines:
        right.text(
            0.5,
            0.5,
            "no reference",
            ha="center",
            va="center",
            transform=right.transAxes,
            color="#888888",
        )


def _plot(
    ax: Axes, one: Overlaid, line: Line, name: str, k: int, label: str = "", **style: float
) -> None:
    part = line.part(name)
    if part is not None:
        t, values = _thinned(one.curves.t + one.offset_s, part[0])
        ax.plot(
            t,
            np.degrees(values),
            color=line_colour(line.title),
            linestyle=DASHES[k],
            label=label or None,
            **({"alpha": SHADES[k]} | style),
        )


def _thinned(t: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Least and greatest of every few points, in turn."""
    every = max(1, 2 * len(values) // POINTS)
    if every == 1:
        return t, values
    n = len(values) // every * every
    blocks = values[:n].reshape(-1, every)
    both = np.column_stack([np.fmin.reduce(blocks, axis=1), np.fmax.reduce(blocks, axis=1)])
    middle = t[:n].reshape(-1, every)[:, every // 2]
    return np.repeat(middle, 2), both.ravel()


def _words(ax: Axes, found: Comparison) -> None:
    """How they were aligned."""
    ax.axis("off")
    rows = []
    for one in found.sessions:
        text = f"{one.curves.session}  offset {one.offset_s:+.4f} s by {one.by}"
        if one.shift is not None:
            text += (
                f", r = {one.shift.correlation:.4f} over {one.shift.overlap_s:.0f} s, {one.quality}"
            )
        rows.append(text)
    ax.text(0.0, 0.98, "\n".join(rows), va="top", fontsize=6.5, transform=ax.transAxes)


def _tracks(ax: Axes, tracks: list[tuple[int, Overlaid, str]]) -> None:
    _, one, key = tracks[0]
    origin = one.curves.tracks[key].origin
    for k, one, key in tracks:
        points = moved(one.curves.tracks[key], origin)
        name = key.split("/", 1)[1].removeprefix("nav/")
        colour = line_colour(name)
        if key.endswith("/gnss"):
            ax.plot(
                points[:, 2], points[:, 1], ".", color=colour, markersize=2, alpha=0.6 * SHADES[k]
            )
        else:
            ax.plot(
                points[:, 2],
                points[:, 1],
                color=colour,
                alpha=SHADES[k],
                linestyle=DASHES[k],
                label=f"{k + 1}: {key.split('/')[0]} {line_title(name)}",
            )
    ax.set(xlabel="east, m", ylabel="north, m")
    ax.set_aspect("equal", adjustable="datalim")
    ax.legend(fontsize=7, loc="lower left", bbox_to_anchor=(0.0, 1.0), borderaxespad=0.3, ncols=3)
