"""The report's figures as PNG: the paper's, in the paper's order, then ours. Same analysis, same
bytes.
"""

import io
from collections.abc import Callable
from dataclasses import dataclass

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from logs.figures.colours import COLOURS
from logs.figures.names import ANGLE_UNIT, RATE_UNIT, REFERENCE, estimator_colour, estimator_title
from sessions.report.analysis import Analysis
from sessions.report.data import Run
from sessions.report.segments import grid, reference

STYLE = {
    "font.family": "DejaVu Sans",
    "font.size": 8.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.6,
    "lines.linewidth": 0.9,
    "legend.frameon": False,
    "axes.prop_cycle": matplotlib.cycler(color=COLOURS),
    "axes.titlesize": 9,
    "svg.hashsalt": "gyrofree",
    "agg.path.chunksize": 10000,
}
WIDE, HIGH, DPI = 7.2, 2.7, 160  # inches, inches, dots per inch


@dataclass(frozen=True)
class Picture:
    """One figure with its caption."""

    name: str
    caption: str
    png: bytes  # or JPEG, of a photo

    @property
    def kind(self) -> str:
        """As HTML calls it, by its content."""
        return "jpeg" if self.png.startswith(b"\xff\xd8") else "png"


def pictures(found: Analysis) -> list[Picture]:
    """All figures that this run has data for."""
    drawn = []
    with matplotlib.rc_context(STYLE):
        for name, caption, draw in FIGURES:
            figure = Figure(figsize=(WIDE, HIGH), dpi=DPI, layout="constrained")
            if draw(figure, found):
                drawn.append(Picture(name, caption, _png(figure)))
    return drawn


def _legend(ax: Axes, ncols: int = 4, **look: float) -> None:
    """Above the axes: to look for the emptiest place takes minutes where curves are long."""
    ax.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), borderaxespad=0.3, ncols=ncols, **look)


def _png(figure: Figure) -> bytes:
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", metadata={"Software": None})
    return buffer.getvalue()


def _raw(figure: Figure, found: Analysis) -> bool:
    if found.cube is None:
        return False
    figure.set_size_inches(WIDE, 4.2)
    axes = figure.subplots(2, 2, sharex=True, sharey=True)
    for k, ax in enumerate(axes.flat):
        for axis in range(3):
            ax.plot(
                found.cube.t,
                found.cube.f_axis[:, 3 * k + axis],
                label=f"a{k + 1}{axis + 1}",
                linewidth=0.6,
            )
        ax.set_title(f"triad {k + 1}")
        ax.legend(ncols=3, loc="upper right", fontsize=7)
    figure.supxlabel("time, s")
    figure.supylabel("specific force, m/s²")
    return True


def _p(figure: Figure, found: Analysis) -> bool:
    if found.cube is None:
        return False
    ax = _axes(figure, "specific force of the centre, m/s²")
    for k, name in enumerate("xyz"):
        ax.plot(found.cube.t, found.cube.p_b[:, k], label=f"p$_{name}$", linewidth=0.7)
    _legend(ax)
    return True


def _bias(figure: Figure, found: Analysis) -> bool:
    if found.cube is None or found.cube.bias_b is None:
        return False
    ax = figure.subplots()
    values = found.cube.bias_b / found.gravity * 1e3
    ax.bar(["x", "y", "z"], values, color=COLOURS[0], width=0.5, label="this run")
    for k, value in enumerate(values):
        ax.annotate(f"{value:.2f}", (k, value), ha="center", va="bottom" if value >= 0 else "top")
    ax.axhline(0.0, color="#555555", linewidth=0.8)
    ax.margins(y=0.2)
    ax.set_ylabel("equivalent bias, mg")
    return True


def _alpha(figure: Figure, found: Analysis) -> bool:
    if found.cube is None:
        return False
    ax = _axes(figure, "angular acceleration ω′$_z$, rad/s²")
    ax.plot(found.cube.t, found.cube.alpha_b[:, 2], linewidth=0.6, label="by (26)")
    return True


def _omega(figure: Figure, found: Analysis) -> bool:
    if not found.run.rates:
        return False
    ax = _axes(figure, f"rate ω$_z$, {RATE_UNIT}")
    for rate in found.run.rates:
        ax.plot(rate.t, np.degrees(rate.omega_b[:, 2]), **_look(rate.name))
    t, omega = _reference(found.run)
    if len(t):
        ax.plot(
            t, np.degrees(omega), color=REFERENCE, linestyle="--", linewidth=0.8, label="tachometer"
        )
    _legend(ax)
    return True


def _angle(figure: Figure, found: Analysis) -> bool:
    if not found.run.rates:
        return False
    ax = _axes(figure, f"angle about z, {ANGLE_UNIT}")
    for rate in found.run.rates:
        ax.plot(rate.t, np.degrees(rate.angle_z - rate.angle_z[0]), **_look(rate.name))
    t, omega = _reference(found.run)
    if len(t):
        ax.plot(
            t,
            np.degrees(np.cumsum(omega) * (t[1] - t[0] if len(t) > 1 else 0.0)),
            color=REFERENCE,
            linestyle="--",
            label="tachometer",
        )
    _legend(ax)
    return True


def _position(figure: Figure, found: Analysis) -> bool:
    moving = [rate for rate in found.run.rates if np.any(rate.p_n)]
    if not moving:
        return False
    ax = _axes(figure, "position error, m")
    for rate in moving:
        distance = np.linalg.norm(rate.p_n, axis=1)
        ax.semilogy(rate.t, np.where(distance > 1e-4, distance, np.nan), **_look(rate.name))
    _legend(ax)
    return True


def _plateau_errors(figure: Figure, found: Analysis) -> bool:
    rates = [rate for rate in found.rates if rate.plateaus]
    if not rates:
        return False
    ax = figure.subplots()
    for k, rate in enumerate(rates):
        levels = np.degrees([part.segment.omega for part in rate.plateaus])
        error = np.degrees([part.error[2] for part in rate.plateaus])
        spread = 2.0 * np.degrees(np.nan_to_num([part.standard_error[2] for part in rate.plateaus]))
        ax.errorbar(
            levels + 1.5 * k,
            error,
            yerr=spread,
            fmt="os^Dv"[k % 5],
            capsize=3,
            markersize=4,
            **_look(rate.name),
        )
    ax.axhline(0.0, color="#555555", linewidth=0.8)
    ax.set_yscale("symlog", linthresh=1.0)
    ax.set_xlabel(f"reference, {RATE_UNIT}")
    ax.set_ylabel(f"mean error, {RATE_UNIT}")
    _legend(ax)
    return True


def _allan(figure: Figure, found: Analysis) -> bool:
    if not found.allan_axes:
        return False
    ax = figure.subplots()
    for one in found.allan_axes:
        ax.loglog(one.tau, one.deviation, linewidth=0.8, label=one.name)
    first = found.allan_axes[0]
    ax.fill_between(first.tau, first.low, first.high, color=COLOURS[0], alpha=0.15)
    white = first.deviation[0] * np.sqrt(first.tau[0] / first.tau)
    ax.loglog(first.tau, white, "k:", linewidth=0.8, label="slope −1/2")
    ax.set_xlabel("averaging time τ, s")
    ax.set_ylabel("Allan deviation, m/s²")
    _legend(ax, ncols=6, fontsize=6.5)
    return True


def _nis(figure: Figure, found: Analysis) -> bool:
    rates = [rate for rate in found.run.rates if np.any(rate.nis_dof > 0)]
    rows = [(rate.name, rate.t, rate.nis, rate.nis_dof) for rate in rates]
    rows += [(one.name, one.t, one.nis, one.dof) for one in found.run.corrections]
    if not rows:
        return False
    ax = _axes(figure, "NIS / degrees of freedom")
    for name, t, nis, dof in rows:
        at = dof > 0
        values = nis[at] / dof[at]
        width = max(1, len(values) // 60)
        smooth = np.convolve(values, np.ones(width) / width, mode="valid")
        ax.plot(t[at][: len(smooth)] + 0.5 * (t[at][width - 1] - t[at][0]), smooth, **_look(name))
    ax.axhline(1.0, color="#555555", linestyle="--", linewidth=0.8)
    ax.set_yscale("log")
    _legend(ax)
    return True


def _track(figure: Figure, found: Analysis) -> bool:
    drawn = [nav for nav in found.run.navigation if len(nav.t) > 1]
    if not drawn:
        return False
    figure.set_size_inches(WIDE, 4.0)
    ax = figure.subplots()
    for nav in drawn:
        ax.plot(nav.p_ned[:, 1], nav.p_ned[:, 0], **_look(nav.name))
    ax.set_aspect("equal", adjustable="datalim")
    ax.set_xlabel("east, m")
    ax.set_ylabel("north, m")
    _legend(ax)
    return True


def _look(name: str) -> dict[str, str]:
    """An estimator's name and colour, as everywhere."""
    return {"label": estimator_title(name), "color": estimator_colour(name)}


def _axes(figure: Figure, label: str):
    ax = figure.subplots()
    ax.set_xlabel("time, s")
    ax.set_ylabel(label)
    return ax


def _reference(run: Run) -> tuple[np.ndarray, np.ndarray]:
    if run.tacho is None:
        return np.zeros(0), np.zeros(0)
    t, _ = grid(run.tacho, 0.0, run.seconds)
    return t, reference(run.tacho, t)


FIGURES: tuple[tuple[str, str, Callable[[Figure, Analysis], bool]], ...] = (
    ("raw", "Raw data of the four triads.", _raw),
    ("specific-force", "Linear acceleration (specific force) of the cube's centre by (25).", _p),
    ("bias", "Equivalent accelerometer bias, from the standstills at different headings.", _bias),
    ("angular-acceleration", "Angular acceleration about z by (26).", _alpha),
    ("rate", "Angular rate about z over the tachometer's.", _omega),
    ("angle", "Rotation angle about z.", _angle),
    ("position", "Position error of the unaided inertial navigation.", _position),
    ("plateaus", "Mean rate error on every plateau, with two standard errors.", _plateau_errors),
    (
        "allan",
        "Overlapping Allan deviation of every axis over the longest standstill, 68 % band of one.",
        _allan,
    ),
    (
        "nis",
        "Normalised innovation squared over its degrees of freedom, running mean; 1 is consistent.",
        _nis,
    ),
    ("track", "Track of every navigation filter.", _track),
)
