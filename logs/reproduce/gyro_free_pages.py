"""Pictures and the page of `gyrofree reproduce gyro-free`, in the order of the paper."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")  # no screen

import matplotlib.pyplot as plt
import numpy as np

from inertial.constants import MILLI_G
from logs.figures.colours import COLOURS
from logs.figures.cube import REFERENCE, STYLE
from logs.reproduce import gyro_free_study as study
from logs.reproduce.gyro_free_study import Study
from messages.text import html

DEG = 180.0 / np.pi
TITLES = {
    "least-squares": "paper's way: (26) and Runge-Kutta",
    "products-ekf": "ours: products filter",
}
XYZ = COLOURS[:3]

PAGE = """<!doctype html><html lang="en"><meta charset="utf-8">
<title>The published table test, reproduced</title>
<meta name="viewport" content="width=device-width, initial-scale=1">
<style>
body{font:15px/1.5 system-ui,sans-serif;max-width:64rem;margin:2rem auto;padding:0 1rem;color:#222}
table{border-collapse:collapse;margin:1rem 0}
th,td{padding:.3rem .8rem;border-bottom:1px solid #ddd;text-align:right}
tr>th:first-child{text-align:left;font-weight:500}img{max-width:100%}figure{margin:2rem 0}
figcaption{color:#555}
</style>
<h1>The published table test, reproduced</h1>
"""


def draw(out: Path, s: Study, result: dict[str, Any]) -> list[dict[str, str]]:
    """Write the seven pictures; file, title and caption of each. Raises OSError."""
    drawn: tuple[tuple[str, str, Callable[[Any, Any, Any], str]], ...] = (
        ("1-raw.png", "Raw data of the four triads", _raw),
        ("2-specific-force.png", "Specific force of the centre by (25)", _force),
        ("3-biases.png", "Equivalent accelerometer biases, Table 1", _biases),
        ("4-angular-acceleration.png", "Angular acceleration about z by (26)", _alpha),
        ("5-rate.png", "Angular rate about z over the tachometer's", _rate),
        ("6-angle.png", "Rotation angle", _angle),
        ("7-position.png", "Position error of the inertial navigation", _position),
    )
    figures = []
    for name, title, fill in drawn:
        with plt.rc_context(STYLE):
            figure = plt.figure(
                figsize=(9.5, 6.2 if fill in (_raw, _rate, _angle) else 4.2), layout="constrained"
            )
            caption = fill(figure, s, result)
            figure.suptitle(title, x=0.01, ha="left", fontweight="bold")
            figure.savefig(out / name)
            plt.close(figure)
        figures.append({"file": name, "title": title, "caption": caption})
    return figures


def _time(s: Study) -> np.ndarray:
    return s.log.t_s - s.log.t_s[0]


def _legend(axes: Any, **where: Any) -> None:
    axes.legend(frameon=False, fontsize=8, ncols=3, **where)


def _raw(figure: Any, s: Study, result: dict[str, Any]) -> str:
    t = _time(s)
    counts = s.log.counts if s.log.counts is not None else s.log.f_axis
    grid = figure.subplots(2, 2, sharex=True)
    for j, axes in enumerate(grid.ravel()):
        for k in range(3):
            axes.plot(
                t, counts[:, 3 * j + k], color=XYZ[k], linewidth=0.7, label=s.log.names[3 * j + k]
            )
        axes.set_title(f"triad {j + 1}", fontsize=9, loc="left")
        axes.set_ylabel("counts of 3.9 mg" if s.log.counts is not None else "m/s²")
        _legend(axes, loc="center right")
    for axes in grid[1]:
        axes.set_xlabel("time, s")
    return "Each sensor along its own axes, as read."


def _force(figure: Any, s: Study, result: dict[str, Any]) -> str:
    t, axes = _time(s), figure.subplots()
    for k, name in enumerate("xyz"):
        axes.plot(t, s.f_b[:, k], color=XYZ[k], linewidth=0.8, label=f"$p_{name}$")
    axes.set(xlabel="time, s", ylabel="p, m/s²")
    _legend(axes, loc="center right")
    return "x and y show gravity through the table's tilt as it turns; z reads +1 g."


def _biases(figure: Any, s: Study, result: dict[str, Any]) -> str:
    axes, table = figure.subplots(), result["table_1_bias_mg"]
    rows = [
        ("paper", "paper, Table 1"),
        ("ours", "ours, from the still intervals"),
        ("true", "true, simulated sensors"),
    ]
    shown = [(table[key], label) for key, label in rows if table[key] is not None]
    for n, (values, label) in enumerate(shown):
        x = np.arange(3) + (n - 0.5 * (len(shown) - 1)) * 0.26
        bars = axes.bar(x, values, 0.24, color=("#999999", COLOURS[0], COLOURS[2])[n], label=label)
        axes.bar_label(bars, fmt="%.1f", fontsize=8)
    axes.axhline(0.0, color=REFERENCE, linewidth=0.6)
    axes.set_xticks(np.arange(3), ["x", "y", "z"])
    axes.set_ylabel("equivalent bias, mg")
    axes.grid(False, axis="x")
    axes.margins(y=0.15)
    _legend(axes, loc="upper left")
    how = (
        "told apart from the tilt by two table angles"
        if table["told_apart_from_tilt"]
        else "tilt and bias together"
    )
    return f"Other sensors, other biases: what compares is their size. Ours in x and y: {how}."


def _alpha(figure: Any, s: Study, result: dict[str, Any]) -> str:
    t, axes = _time(s), figure.subplots()
    axes.plot(t, s.alpha_b[:, 2], color=COLOURS[0], linewidth=0.6, label="$\\dot\\omega_z$ by (26)")
    if s.log.omega_b is not None:
        true = np.gradient(s.log.omega_b[:, 2], s.log.t_s)
        axes.plot(t, true, color=REFERENCE, linestyle=(0, (4, 2)), label="truth")
    axes.set(xlabel="time, s", ylabel="$\\dot\\omega_z$, rad/s²")
    _legend(axes, loc="upper right")
    return (
        "The bias of the still start is not yet removed here; noise is the sensors' over the side"
        " of the cube."
    )


def _reference(s: Study) -> tuple[np.ndarray | None, str]:
    if s.log.tacho is not None:
        return s.log.tacho, "tachometer"
    return (s.log.omega_b[:, 2], "truth") if s.log.omega_b is not None else (None, "")


def _rate(figure: Any, s: Study, result: dict[str, Any]) -> str:
    t, (upper, lower) = _time(s), figure.subplots(2, 1, sharex=True, height_ratios=(2, 1.2))
    other, name = _reference(s)
    for colour, (estimator, track) in zip((COLOURS[1], COLOURS[0]), s.tracks.items(), strict=True):
        upper.plot(t, track.omega_b[:, 2] * DEG, color=colour, label=TITLES[estimator])
        lower.plot(t, (track.omega_b[:, 2] - s.truth.omega_b[:, 2]) * DEG, color=colour)
    if other is not None:
        upper.plot(
            t, other * DEG, color=REFERENCE, linewidth=0.9, linestyle=(0, (4, 2)), label=name
        )
    upper.set_ylabel("$\\omega_z$, °/s")
    lower.set(xlabel="time, s", ylabel="error, °/s")
    _legend(upper, loc="upper left")
    return _numbers(result, "omega_z_rms_deg_per_s", "RMS error {:.2f} °/s")


def _angle(figure: Any, s: Study, result: dict[str, Any]) -> str:
    t, (upper, lower) = _time(s), figure.subplots(2, 1, sharex=True, height_ratios=(2, 1.2))
    for colour, (estimator, track) in zip((COLOURS[1], COLOURS[0]), s.tracks.items(), strict=True):
        upper.plot(t, track.angle_z * DEG, color=colour, label=TITLES[estimator])
        lower.plot(t, (track.angle_z - s.truth.angle_z) * DEG, color=colour)
    upper.plot(
        t,
        s.truth.angle_z * DEG,
        color=REFERENCE,
        linewidth=0.9,
        linestyle=(0, (4, 2)),
        label=s.truth.name,
    )
    upper.set_ylabel("angle, °")
    lower.set(xlabel="time, s", ylabel="error, °")
    _legend(upper, loc="lower left")
    return _numbers(result, "angle_error_deg", "at the end off by {:+.1f}°")


def _position(figure: Any, s: Study, result: dict[str, Any]) -> str:
    axes = figure.subplots()
    for colour, name in zip((COLOURS[1], COLOURS[0]), s.tracks, strict=True):
        t, error = study.navigation_error(s, name)
        axes.plot(
            t, np.maximum(np.linalg.norm(error, axis=1), 1e-3), color=colour, label=TITLES[name]
        )
    paper = study.closed_form(np.array(study.PAPER_BIAS_MG) * MILLI_G, study.paper_drift(), t)
    axes.plot(
        t,
        np.maximum(np.linalg.norm(paper, axis=1), 1e-3),
        color=REFERENCE,
        linestyle=(0, (4, 2)),
        label="(27) with the paper's Table 1 and 30 °/h",
    )
    axes.set_yscale("log")
    axes.set(xlabel="time since the table began to turn, s", ylabel="distance from the start, m")
    _legend(axes, loc="lower right")
    drift = result["drift_deg_per_h"]
    said = ", ".join(f"{TITLES[name]} {drift[name]:.0f} °/h" for name in s.tracks)
    return (
        f"Equivalent drift by (27): paper {drift['paper']:.0f} °/h beside its biases; here the"
        f" biases are taken out at the start and the whole error is laid on the drift: {said}."
    )


def _numbers(result: dict[str, Any], key: str, form: str) -> str:
    parts = [
        f"{TITLES[name]}: {form.format(row[key])}"
        for name, row in result["estimators"].items()
        if row[key] is not None
    ]
    return "; ".join(parts) or "Nothing in this session says what is true."


def _row(what: str, *values: Any) -> str:
    def cell(value: Any) -> str:
        if isinstance(value, list):
            return " · ".join(f"{v:.2f}" for v in value)
        return "–" if value is None else f"{value:.2f}" if isinstance(value, float) else str(value)

    cells = "".join(f"<td>{html(cell(value))}</td>" for value in values)
    return f"<tr><th>{html(what)}</th>{cells}</tr>"


def write_index(out: Path, result: dict[str, Any]) -> None:
    """index.html: the table of all figures and the pictures below. Raises OSError."""
    bias, drift, place = (
        result["table_1_bias_mg"],
        result["drift_deg_per_h"],
        result["position_27_m"],
    )
    papers, ours = (result["estimators"][name] for name in TITLES)
    rows = [
        _row(
            "equivalent bias x · y · z, mg", bias["paper"], bias["ours"], bias["ours"], bias["true"]
        ),
        _row(
            "omega_z, RMS error, °/s",
            None,
            papers["omega_z_rms_deg_per_s"],
            ours["omega_z_rms_deg_per_s"],
            0.0,
        ),
        _row(
            "angle error at the end, °",
            None,
            papers["angle_error_deg"],
            ours["angle_error_deg"],
            0.0,
        ),
        _row("time of navigation, s", 30.0, papers["navigated_s"], ours["navigated_s"], None),
        _row(
            "position error x · y · z, m",
            None,
            papers["position_error_m"],
            ours["position_error_m"],
            [0.0] * 3,
        ),
        _row(
            "(27): the biases left in, 30 s, m",
            place["paper"],
            place["our_biases_alone"],
            None,
            None,
        ),
        _row(
            "equivalent drift by (27), °/h",
            drift["paper"],
            drift["least-squares"],
            drift["products-ekf"],
            None,
        ),
    ]
    figures = "".join(
        f'<figure><img src="{one["file"]}" alt="{html(one["title"])}">'
        f"<figcaption>{html(one['caption'])}</figcaption></figure>"
        for one in result["figures"]
    )
    head = "".join(
        f"<th>{name}</th>" for name in ("", "paper", "paper's way here", "ours here", "truth")
    )
    (out / "index.html").write_text(
        PAGE
        + f"""<p>Session: {html(result["session"])}, {result["samples"]} samples at
{result["rate_hz"]:g} Hz.
The numbers of the paper are Hoseini and Moradi, 2017; it prints no errors of rate and angle.</p>
<table><tr>{head}</tr>{"".join(rows)}</table>
{figures}</html>
""",
        encoding="utf-8",
    )
