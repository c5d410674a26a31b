"""Picture of a drive: the way with its fixes, errors with the 3-sigma that the filter claims,
horizon, scores.
"""

from pathlib import Path
from typing import Any

import matplotlib
import numpy as np

from inertial.earth import ned_between
from inertial.navigation.filters import DEFAULT
from inertial.navigation.results import place_of
from inertial.whole_file import whole
from logs.drive_log import DriveLog
from logs.drive_result import Result
from logs.figures.colours import COLOURS

matplotlib.use("Agg")
from matplotlib import pyplot as plt  # noqa: E402

NINE = (*COLOURS, "#8C8C8C", "#000000", "#F0E442")  # one for each filter


def draw(
    path: Path, log: DriveLog, results: dict[str, Result], scores: dict[str, dict[str, Any]]
) -> None:
    """Write the picture, PNG by the name's end."""
    lead = results.get(DEFAULT) or next(iter(results.values()), None)
    figure, axes = plt.subplots(2, 2, figsize=(14, 10), constrained_layout=True)
    if lead is not None:
        _way(axes[0, 0], log, lead)
        _errors(axes[0, 1], lead)
        _bars(axes[1, 0], scores, "position_h_rms_m", "horizontal RMS on unseen fixes, m")
        if any(score["outage_end_m"] for score in scores.values()):
            _outages(axes[1, 1], scores)
        else:
            _bars(
                axes[1, 1],
                scores,
                "velocity_h_rms_mps",
                "horizontal velocity RMS on unseen fixes, m/s",
            )
    with whole(path) as draft:
        figure.savefig(draft, dpi=110)
    plt.close(figure)


def _way(ax: Any, log: DriveLog, lead: Result) -> None:
    # seen from above: heights do not count
    places = np.array([(f.latitude, f.longitude, 0.0) for f in log.fixes if f.quality])
    origin = tuple(places[0])
    fixes, way = ned_between(origin, places.T), ned_between(origin, place_of(lead.x))
    ax.plot(fixes[1], fixes[0], ".", ms=2, color="#E69F00", label="fixes")
    ax.plot(way[1], way[0], lw=1.2, color=COLOURS[0], label="solution")
    ax.set_aspect("equal", adjustable="datalim")
    ax.set(xlabel="east, m", ylabel="north, m", title="the way")
    ax.legend()


def _errors(ax: Any, lead: Result) -> None:
    chosen = lead.scored
    t = lead.t[chosen] - lead.t[0]
    for k, name in enumerate(("north", "east")):
        ax.plot(t, lead.y[chosen, k], lw=0.8, color=COLOURS[k], label=name)
    half = 3.0 * np.sqrt(lead.P[chosen][:, 6, 6])
    ax.fill_between(t, -half, half, color="#8C8C8C", alpha=0.25, lw=0, label="3 sigma of north")
    ax.set(xlabel="s", ylabel="m", title=f"error on unseen fixes, {DEFAULT}")
    ax.legend()


def _bars(ax: Any, scores: dict[str, dict[str, Any]], key: str, title: str) -> None:
    names = [name for name in scores if scores[name][key] is not None]
    values = [scores[name][key] for name in names]
    bars = ax.barh(
        names, values, color=[COLOURS[2] if name == DEFAULT else COLOURS[0] for name in names]
    )
    ax.bar_label(bars, fmt="%.3f", padding=3)
    ax.invert_yaxis()
    ax.margins(x=0.15)
    ax.set_title(title)


def _outages(ax: Any, scores: dict[str, dict[str, Any]]) -> None:
    names = [name for name in scores if any(v is not None for v in scores[name]["outage_end_m"])]
    width = 0.8 / max(1, len(names))
    for i, name in enumerate(names):
        values = [v if v is not None else 0.0 for v in scores[name]["outage_end_m"]]
        ax.bar(
            np.arange(len(values)) + i * width,
            values,
            width,
            label=name,
            color=NINE[i % len(NINE)],
        )
    ax.set(
        yscale="log",
        ylabel="m",
        xlabel="outage",
        title="horizontal error at the end of each outage",
    )
    ax.legend(fontsize=8)
