"""What the comparison of in-motion filters looks like on paper: Markdown tables, bars, the horizon
along a drive.
"""

import math
from pathlib import Path
from typing import Any

import numpy as np

from inertial.simulation.drive import CONDITIONS
from logs.reproduce.in_motion import COMPONENTS, Errors
from messages.text import html

DEG = 180.0 / math.pi
FAMILIES = {  # colours that stay apart for the colour-blind (Okabe and Ito)
    "FPE-P0": "#0072b2",
    "FPE-Pbar": "#e69f00",
    "FPE-4Pbar": "#009e73",
    "KF": "#000000",
    "Huber": "#d55e00",
    "MHE": "#cc79a7",
    "Smoother": "#56b4e9",
}


def markdown(result: dict[str, Any]) -> str:
    """All tables of a comparison."""
    parts = [
        "# In-motion alignment: the comparison again",
        f"{result['seeds']} simulated drives per condition. {result['note']}",
        "## Error against truth: horizontal m / 3-D velocity m/s / heading deg",
        _grid(result["conditions"], _error),
        "## Prediction of the next fix: horizontal m / 3-D velocity m/s",
        _grid(result["conditions"], lambda f: _pair(f, "prediction")),
        "## Residual to the fix just fed: horizontal m / 3-D velocity m/s. No error: see the note",
        _grid(result["conditions"], lambda f: _pair(f, "residual")),
        "Conditions: "
        + "; ".join(f"**{k}** {CONDITIONS[k].text}" for k in result["conditions"])
        + ".",
    ]
    for title, table in result["paper"].items():
        for metric, text in (
            ("error", "error against truth"),
            ("residual", "residual to the fix just fed"),
        ):
            parts += [
                f"## Form of the paper, {title}: {text}, mean ± standard deviation",
                _paper(table, metric),
            ]
    if result["real"]:
        parts.append(_real(result["real"]))
    return "\n\n".join(parts) + "\n"


def page(text: str, pictures: list[Path]) -> str:
    """The Markdown tables and the pictures as one HTML page that needs nothing else."""
    body = []
    for block in text.strip().split("\n\n"):
        lines = block.splitlines()
        if lines[0].startswith("|"):
            rows = [[html(cell.strip()) for cell in line.strip("|").split("|")] for line in lines]
            head = "".join(f"<th>{cell}</th>" for cell in rows[0])
            cells = "".join(
                "<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>" for row in rows[2:]
            )
            body.append(f"<table><tr>{head}</tr>{cells}</table>")
        elif lines[0].startswith("#"):
            level = 1 if lines[0].startswith("# ") else 2
            body.append(f"<h{level}>{html(lines[0].lstrip('# '))}</h{level}>")
        else:
            body.append(f"<p>{html(block)}</p>")
    images = "".join(
        f'<p><img src="{picture.name}" alt="{picture.stem}" width="900"></p>'
        for picture in pictures
    )
    style = "body{font:14px sans-serif;margin:2em}table{border-collapse:collapse}"
    style += "td,th{border:1px solid #ccc;padding:2px 6px}"
    return (
        (
            '<!doctype html><html lang="en"><meta charset="utf-8"><title>In-motion'
            " alignment</title>"
            f"<style>{style}</style>{''.join(body)}{images}</html>\n"
        )
        .replace("&lt;sub&gt;", "<sub>")
        .replace("&lt;/sub&gt;", "</sub>")
    )


def _error(f: dict[str, float]) -> str:
    return f"{f['error_h_m']:.2f}/{f['error_velocity_mps']:.3f}/{f['heading_rad'] * DEG:.1f}"


def _pair(f: dict[str, float], metric: str) -> str:
    return f"{f[f'{metric}_h_m']:.2f}/{f[f'{metric}_velocity_mps']:.3f}"


def _grid(conditions: dict[str, Any], cell: Any) -> str:
    names = list(conditions)
    lines = ["| method | " + " | ".join(names) + " |", "|---|" + "---|" * len(names)]
    for method in conditions[names[0]]:
        lines.append(
            f"| {method} | " + " | ".join(cell(conditions[name][method]) for name in names) + " |"
        )
    return "\n".join(lines)


def _paper(table: dict[str, Any], metric: str) -> str:
    titles = ("N m", "E m", "h m", "v<sub>N</sub> m/s", "v<sub>E</sub> m/s", "v<sub>D</sub> m/s")
    lines = ["| method | " + " | ".join(titles) + " |", "|---|" + "---|" * 6]
    for method, metrics in table.items():
        cells = [
            f"{metrics[metric][c]['mean']:+.3f} ± {metrics[metric][c]['std']:.3f}"
            for c in COMPONENTS
        ]
        lines.append(f"| {method} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _real(cases: dict[str, Any]) -> str:
    lines = []
    for case, entry in cases.items():
        lines += [f"## Real drive {case}: {entry['text']} ({entry['seeds']} noise seeds)", ""]
        heads = (
            "method",
            "horizontal m",
            "height m",
            "velocity m/s",
            "tilt deg",
            "heading deg",
            "prediction of next fix m, m/s",
            "residual to fed fix m, m/s",
        )
        lines += ["| " + " | ".join(heads) + " |", "|---" * len(heads) + "|"]
        for method, f in entry["methods"].items():
            lines.append(
                f"| {method} | {f['error_h_m']:.3f} | {f['error_v_m']:.3f} |"
                f" {f['error_velocity_mps']:.3f} | {f['tilt_rad'] * DEG:.2f} |"
                f" {f['heading_rad'] * DEG:.2f} | {f['prediction_h_m']:.3f},"
                f" {f['prediction_velocity_mps']:.3f} | {f['residual_h_m']:.3f},"
                f" {f['residual_velocity_mps']:.3f} |"
            )
        lines.append("")
    lines.append(
        "Tilt and heading are relative to the " + next(iter(cases.values()))["reference"] + "."
    )
    return "\n".join(lines)


def _pyplot() -> Any:
    import matplotlib  # here: slow to load, and only pictures need it

    matplotlib.use("Agg")
    from matplotlib import pyplot

    return pyplot


def horizon(out: Path, name: str, errors: Errors) -> Path:
    """The fuzzy horizon along a drive, and the two inputs that chose it."""
    plt = _pyplot()
    t, n, alpha1, alpha2 = np.array(errors.horizon).T
    figure, axes = plt.subplots(3, 1, figsize=(10, 6.5), sharex=True)
    axes[0].step(t, n, where="post", color="#0072b2", lw=1.2)
    axes[0].set_ylabel("horizon N, fixes")
    axes[0].set_yticks(range(2, 11, 2))
    axes[0].set_title(
        f"Fuzzy horizon, {name} drive: mean N {n.mean():.1f}", fontsize=10, loc="left"
    )
    axes[1].plot(t, alpha1, color="#d55e00", lw=1.0)
    axes[1].set_ylabel("α₁ = ‖f‖, m/s²")
    axes[2].plot(t, np.degrees(alpha2), color="#009e73", lw=1.0)
    axes[2].set_ylabel("α₂ = ‖ω‖, °/s")
    for axis, levels in ((axes[1], (9.9, 10.2, 10.8)), (axes[2], np.degrees([0.05, 0.20, 0.45]))):
        for level, letter in zip(levels, "SMH", strict=True):
            axis.axhline(level, color="0.6", lw=0.6, ls=":")
            axis.annotate(letter, (t[-1], level), fontsize=8, color="0.4")
    axes[2].set_xlabel("time, s")
    for axis in axes:
        axis.grid(alpha=0.25)
    return _save(plt, figure, out / f"horizon-{name.replace('_', '-')}.png")


def columns(out: Path, conditions: dict[str, Any]) -> Path:
    """Velocity error of every method relative to the Kalman filter, a column of dots for each
    condition.
    """
    plt = _pyplot()
    methods = [m for m in next(iter(conditions.values())) if m != "KF"]
    figure, axis = plt.subplots(figsize=(11, 6))
    seen: dict[str, int] = {}
    for method in methods:
        family = next(name for name in FAMILIES if method.startswith(name))
        k = seen[family] = seen.get(family, -1) + 1
        ratio = [
            c[method]["error_velocity_mps"] / c["KF"]["error_velocity_mps"]
            for c in conditions.values()
        ]
        places = np.arange(len(conditions)) + 0.5 * (methods.index(method) / len(methods) - 0.5)
        axis.semilogy(
            places,
            ratio,
            marker="osD^v"[k % 5],
            ls="",
            color=FAMILIES[family],
            label=method,
            ms=4.5,
        )
    axis.axhline(1.0, color="k", lw=0.8)
    axis.set_xticks(range(len(conditions)), list(conditions))
    ticks = [0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 5.0, 10.0]
    axis.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
    axis.minorticks_off()
    axis.set_ylabel("velocity error / that of the Kalman filter")
    axis.set_xlabel("condition; above the line the Kalman filter is better")
    axis.grid(alpha=0.25, which="both")
    axis.legend(fontsize=7, ncols=1, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return _save(plt, figure, out / "methods.png")


def _save(plt: Any, figure: Any, file: Path) -> Path:
    figure.tight_layout()
    figure.savefig(file, dpi=110)
    plt.close(figure)
    return file
