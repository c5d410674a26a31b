"""What `gyrofree run` prints: one table that fits 80 columns, in degrees and metres, and in words
what a person should know. Unknown is a dash.
"""

import json
import math
from collections.abc import Callable
from typing import Any

from rich.table import Table

from gyrofree.commands.options import say, show_table

Row = dict[str, Any]
DASH = "-"
WIDTH = 80
LEADING = "*"  # beside the name of the one that is believed
DEG = 180.0 / math.pi
SAID_APART = ("default", "notes", "axes", "gaps", "logs", "written")
COSTS = ("us_per_sample", "us_per_epoch", "bound_rate_rms_radps", "valid_share")


def kind_of(result: dict[str, Any]) -> str:
    """What the rows of a result are: "estimators" or "filters"."""
    return "estimators" if "estimators" in result else "filters"


def known(row: Row) -> bool:
    """Did this estimator say anything that was scored, or call any of it valid?"""
    if any(row.get("valid_share") or ()):
        return True
    return any(
        value is not None and value != [] and not (isinstance(value, list) and not any(value))
        for name, value in row.items()
        if name not in (*COSTS, "rate_rms_all_radps")
    )


def number(value: float | None, scale: float = 1.0, digits: int = 3) -> str:
    """A figure as a person reads it, a dash where it is not known; never 0 for what is not 0."""
    if value is None or not math.isfinite(value):
        return DASH
    value *= scale
    size = abs(value)
    if value == 0.0:
        return "0"
    if size >= 1e5 or size < 1e-3:
        return f"{value:.1e}"
    return f"{value:.{max(0, digits - 1 - math.floor(math.log10(size)))}f}"


def three(values: list[float | None] | None, scale: float = 1.0) -> str:
    """Parts side by side; one dash where none is known."""
    if not values or all(value is None for value in values):
        return DASH
    return " ".join(number(value, scale) for value in values)


def percent(values: list[float] | None) -> str:
    """Shares of the parts, one where they are the same: never 0 or 100 for what is not."""
    if not values:
        return DASH
    shown = [_percent(value) for value in values]
    return shown[0] if len(set(shown)) == 1 else " ".join(shown)


def _percent(share: float) -> str:
    if 0.0 < share < 0.01:
        return "<1"
    return ">99" if 0.99 < share < 1.0 else f"{100.0 * share:.0f}"


def pair(first: str, second: str, scale: float = 1.0) -> Callable[[Row], str]:
    """Two figures side by side."""
    return lambda row: three([row.get(first), row.get(second)], scale)


def one(name: str, scale: float = 1.0) -> Callable[[Row], str]:
    """One figure."""
    return lambda row: number(row.get(name), scale)


Column = tuple[str, Callable[[Row], str]]
CUBE: tuple[Column, ...] = (
    ("valid,\n%", lambda row: percent(row.get("valid_share"))),
    ("rate error RMS\nx y z, deg/s", lambda row: three(row.get("rate_rms_radps"), DEG)),
    ("angle z at\nend, deg", one("angle_error_final_rad", DEG)),
    ("NEES\n(of 3)", one("nees_mean")),
    ("us a\nsample", one("us_per_sample")),
)
ATTITUDE: tuple[Column, ...] = (
    ("inclination error\nRMS, deg", one("inclination_rms_rad", DEG)),
    ("largest,\ndeg", one("inclination_max_rad", DEG)),
    ("us a\nsample", one("us_per_sample")),
)
DRIVE: tuple[Column, ...] = (
    ("position\nh v, m", pair("position_h_rms_m", "position_v_rms_m")),
    ("velocity\nh v, m/s", pair("velocity_h_rms_mps", "velocity_v_rms_mps")),
    ("heading\ndeg", one("heading_rms_rad", DEG)),
    ("tilt\ndeg", one("tilt_rms_rad", DEG)),
    ("1 s on\nm", one("prediction_1s_m")),
    ("left\nm", one("residual_to_fed_m")),
    ("NEES\nof 9", one("nees_mean")),
    ("us", one("us_per_epoch")),
)
OUTAGES: Column = ("error at the end of each outage, m", lambda row: three(row.get("outage_end_m")))
MEANT = {
    CUBE: "Errors are of what an estimator calls valid.",
    ATTITUDE: "Errors where the reference is good and the filter is to be scored.",
    DRIVE: (
        "RMS errors; h horizontal, v vertical; 1 s on: fed fix less what was expected of it;"
        " left: fed fix less the solution, which says nothing of accuracy."
    ),
}


def show(result: dict[str, Any], as_json: bool) -> None:
    """One JSON object, or a table with a row per filter."""
    if as_json:
        say(json.dumps(result, indent=2))
        return
    kind = kind_of(result)
    rows: dict[str, Row] = result[kind]
    columns = CUBE if kind == "estimators" else _filters(rows)
    _table(kind[:-1], rows, columns, result.get("default"))
    if any(row.get("outage_end_m") for row in rows.values()):
        _table(kind[:-1], rows, (OUTAGES,), None)
    say(f"{LEADING} the default one. {MEANT[columns]} {DASH} not known.")
    for line in words(rows):
        say(line)
    _rest(result, kind)


def _filters(rows: dict[str, Row]) -> tuple[Column, ...]:
    return ATTITUDE if any("inclination_rms_rad" in row for row in rows.values()) else DRIVE


def _table(
    kind: str, rows: dict[str, Row], columns: tuple[Column, ...], default: str | None
) -> None:
    cells = {name: [cell(row) for _, cell in columns] for name, row in rows.items()}
    kept = [
        k
        for k in range(len(columns))
        if columns is CUBE or any(of[k] != DASH for of in cells.values())
    ]
    table = Table(box=None, pad_edge=False, padding=(0, 1, 0, 0))
    table.add_column(kind, no_wrap=True)
    for k in kept:
        table.add_column(columns[k][0], justify="right", no_wrap=True)
    for name, of in cells.items():
        mark = LEADING if name == default else ""
        table.add_row(name + mark, *(of[k] for k in kept))
    show_table(table, WIDTH)


def words(rows: dict[str, Row]) -> list[str]:
    """What a table of numbers hides: whose rate is mostly unknown, and what nobody scored."""
    said = []
    for name, row in rows.items():
        share = row.get("valid_share")
        if share and max(share) < 0.5:
            of = "none" if max(share) == 0.0 else f"{percent(share)} %"
            every = three(row.get("rate_rms_all_radps"), DEG)
            all_of_it = "" if every == DASH else f" (all that it said: {every} deg/s)"
            said.append(f"{name}: most of its rate is unknown, {of} is valid{all_of_it}")
    bounds = next((row.get("bound_rate_rms_radps") for row in rows.values()), None)
    if three(bounds) != DASH:
        said.append(f"bound: no estimator can be better than {three(bounds, DEG)} deg/s (x y z)")
    return said


def _rest(result: dict[str, Any], kind: str) -> None:
    """What else a result says."""
    if isinstance(found := result.get("axes"), dict):
        say(f"axes: {axes(found)}")
    if isinstance(gaps := result.get("gaps"), dict):
        say(f"gaps: {gaps['count']}, missing samples: {gaps['missing_samples']}")
    for name, log in (result.get("logs") or {}).items():
        say(
            f"{name}: {log['samples']} samples at {log['rate_hz']:.1f} Hz, {log['scored']} of them"
            " scored"
        )
    for note in result.get("notes") or ():
        say(f"note: {note}")
    for key, value in result.items():
        if key not in (kind, *SAID_APART) and value not in (None, [], {}, ""):
            say(f"{key}: {json.dumps(value)}")
    if written := result.get("written"):
        say(f"written to {written['file']}: {written['rows']} rows")


def axes(found: dict[str, Any]) -> str:
    """How many axes are good, and what is wrong with each of the others."""
    states = {name: one["state"] if isinstance(one, dict) else one for name, one in found.items()}
    from inertial.rate.axis_verdicts import good_of  # here: not every command needs the core

    return good_of(states)
