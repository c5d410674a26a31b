"""The pictures of the concepts, drawn from the product's own mathematics as SVG.

python docs/guide/draw.py docs/guide/pictures
"""

import sys
from pathlib import Path

import matplotlib

matplotlib.use("svg")
import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402
from matplotlib.axes import Axes  # noqa: E402
from scipy.stats import chi2  # noqa: E402

from inertial.layouts.catalogue import CUBE  # noqa: E402
from inertial.rate.beliefs import make  # noqa: E402
from inertial.rate.estimators import VARIANTS  # noqa: E402
from inertial.rate.sight import AMBIGUOUS, BLIND  # noqa: E402
from inertial.simulation.imperfect import STEPS, TableRun, device, table_run  # noqa: E402

BLUE, RED, GREY, GREEN = "#0072B2", "#D55E00", "#8C8C8C", "#009E73"
STYLE = {
    "svg.hashsalt": "gyrofree",
    "svg.fonttype": "path",
    "font.size": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
}
HALF = 0.05  # m
BEGINS_S = 3.0  # of the second run, amid its first plateau
DEG = 180.0 / np.pi


def rotation(path: Path) -> None:
    """What a push, an angular acceleration and a rate make of a cube's sensors, from above."""
    layout = CUBE(HALF)
    places = np.unique(layout.r_b, axis=0)
    up = np.array([0.0, 0.0, 1.0])
    parts = {
        "pushed: all feel the same": np.tile([3.0, 0.0, 0.0], (len(places), 1)),
        "turned faster: round the axis, as far as they sit": np.cross(60.0 * up, places),
        "turning: towards the axis,\nwith the square of the rate": np.cross(
            8.0 * up, np.cross(8.0 * up, places)
        ),
    }
    figure, panels = plt.subplots(1, 3, figsize=(10, 3.7), layout="constrained")
    for panel, (title, felt), colour in zip(
        panels, parts.items(), (GREY, GREEN, BLUE), strict=True
    ):
        _cube(panel, places, felt, colour)
        panel.set_title(title.replace(": round", ":\nround").replace(": all", ":\nall"))
    _save(figure, path)


def _cube(panel: Axes, places: np.ndarray, felt: np.ndarray, colour: str) -> None:
    side = 1e3 * HALF
    panel.add_patch(plt.Rectangle((-side, -side), 2 * side, 2 * side, fill=False, color=GREY))
    panel.plot(0.0, 0.0, "k+", ms=10)
    x, y = 1e3 * places[:, 0], 1e3 * places[:, 1]
    panel.quiver(x, y, felt[:, 0], felt[:, 1], color=colour, scale=16, width=0.012, zorder=3)
    panel.plot(x, y, "ks", ms=7)
    panel.set(xlim=(-90, 90), ylim=(-90, 90), aspect="equal", xlabel="mm")


def sight(path: Path) -> None:
    """A run on the table by the default filter from rest, and the same from amid a turn, with its
    3 sigma and what it says that it sees.
    """
    run = table_run(device(CUBE(HALF), 4), profile=STEPS, seconds=16.0)
    figure, panels = plt.subplots(2, 1, figsize=(10, 6), sharex=True, layout="constrained")
    _seen(panels[0], run, 0)
    _seen(panels[1], run, round(BEGINS_S * 100.0))
    panels[0].set_title("the run begins at rest")
    panels[1].set_title("the same run, first seen while it turns")
    panels[0].legend(loc="lower right", ncols=5, frameon=False)
    panels[1].set_xlabel("time, s")
    _save(figure, path)


def _seen(panel: Axes, run: TableRun, first: int) -> None:
    t_s, truth = run.t_s[first:], run.omega_b[first:, 2] * DEG
    filter_ = make(VARIANTS["products-ekf"], CUBE(HALF), None)
    columns = filter_.feed(t_s, np.ascontiguousarray(run.readings[first:]))
    rate, sigma = columns.omega_b[:, 2] * DEG, np.sqrt(columns.P[:, 2, 2]) * DEG
    seen = np.asarray(columns.sight)[:, 2]
    low, high = rate - 3 * sigma, rate + 3 * sigma
    panel.fill_between(t_s, low, high, color=BLUE, alpha=0.25, lw=0, label="3 σ")
    panel.plot(t_s, truth, color="k", lw=2.5, alpha=0.35, label="truth")
    panel.plot(t_s, rate, color=BLUE, lw=1.2, label="products-ekf")
    for state, colour, word in ((AMBIGUOUS, "#E69F00", "ambiguous"), (BLIND, GREY, "blind")):
        panel.fill_between(
            t_s, -700, 700, where=seen == state, color=colour, alpha=0.25, lw=0, label=word
        )
    panel.set(ylabel="rate about z, °/s", ylim=(-700, 700), xlim=(0, 16))


def nis(path: Path) -> None:
    """NIS of three filters of one constant: noise believed too small, right, too large."""
    draw = np.random.default_rng(1)
    readings = draw.normal(0.0, 1.0, 400)
    low, high = chi2.ppf([0.005, 0.995], 20) / 20.0
    figure, panels = plt.subplots(1, 3, figsize=(10, 3.2), sharey=True, layout="constrained")
    cases = ((0.5, "too sure", RED), (1.0, "right", BLUE), (2.0, "too careful", GREEN))
    for panel, (believed, title, colour) in zip(panels, cases, strict=True):
        values = _nis_of(readings, believed)
        mean = values.reshape(-1, 20).mean(axis=1)
        panel.axhspan(low, high, color=GREY, alpha=0.25, lw=0)
        panel.axhline(1.0, color=GREY, lw=1)
        panel.plot(20.0 * np.arange(len(mean)) + 10.0, mean, "o-", color=colour, ms=4)
        panel.set(title=f"{title}:\n{believed:g} times the noise believed", yscale="log")
        panel.set_xlabel("measurement")
    panels[0].set_ylabel("NIS, mean of 20")
    _save(figure, path)


def _nis_of(readings: np.ndarray, noise: float) -> np.ndarray:
    """Of a filter of one constant, whose measurement noise is believed to be `noise`."""
    x, variance, values = 0.0, 100.0, []
    for reading in readings:
        innovation, of_it = reading - x, variance + noise**2
        values.append(innovation**2 / of_it)
        gain = variance / of_it
        x, variance = x + gain * innovation, (1.0 - gain) * variance
    return np.array(values)


def _save(figure: plt.Figure, path: Path) -> None:
    figure.savefig(path, format="svg", metadata={"Date": None, "Creator": None})
    plt.close(figure)
    # matplotlib ends lines with blanks
    path.write_text("\n".join(line.rstrip() for line in path.read_text().splitlines()) + "\n")


def draw(folder: Path) -> list[Path]:
    """All pictures; returns their files."""
    folder.mkdir(parents=True, exist_ok=True)
    made = []
    with matplotlib.rc_context(STYLE):
        for one in (rotation, sight, nis):
            made.append(folder / f"{one.__name__}.svg")
            one(made[-1])
    return made


if __name__ == "__main__":
    for made_file in draw(Path(sys.argv[1])):
        print(made_file)
