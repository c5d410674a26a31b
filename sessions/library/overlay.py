"""A comparison as a browser draws it: any window of it, at most so many points per line. Degrees
here, at the last.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from logs.figures.names import line_colour, line_title
from logs.figures.sight import WORDS, vouched
from logs.figures.stretch import stretch
from messages.contract.topics import ALARMS
from sessions.library.compare import XYZ, Comparison, Overlaid, moved
from sessions.library.curves import RATE, TACHO, TRUTH, Line, Mark
from sessions.library.derived import Made, derive

Array = NDArray[np.floating[Any]]

POINTS = 1200  # per line, two for each bin of the window
TRACK_POINTS = 1500
DEG = float(np.degrees(1.0))
PROCEDURE = "procedure"  # author of what a procedure says in a recording
RANGES = {PROCEDURE: "step", ALARMS: "alarm"}  # what is drawn for what lasts, by its author


def drawing(
    found: Comparison,
    begin_s: float | None = None,
    end_s: float | None = None,
    points: int = POINTS,
    everything: bool = False,
    cursors: tuple[float, float] | None = None,
    own: Sequence[str] = (),
) -> dict[str, Any]:
    """Lines of rate, error and angle within a window, and the tracks; for JSON. Between two cursors
    (s on the first session's time) every sample of the curves is measured, too.

    `everything`: all estimators of every session instead of its leading line; `own`: expressions
    over the channels of each session. Units: deg/s, deg, s, m.
    """
    span = found.span
    begin = span[0] if begin_s is None else begin_s
    end = span[1] if end_s is None else end_s
    lines = []
    for number, one in enumerate(found.sessions):
        for line in _shown(one, number, everything):
            drawn = _line(one, number, line, begin, end, points)
            if cursors is not None:
                drawn["measured"] = _measured(one, line, *cursors)
            lines.append(drawn)
    return {
        "span": list(span),
        "start_utc_s": found.sessions[0].curves.start_utc_ns * 1e-9,
        "window": [begin, end],
        "sessions": [
            _session(one) | {"shades": _shades(one, (begin, end), points)} for one in found.sessions
        ],
        "lines": [line for line in lines if line["rate"] or line["error"]],
        "tracks": _tracks(found),
        "own": _own(found, own, (begin, end), points, cursors),
    }


def _own(
    found: Comparison,
    own: Sequence[str],
    window: tuple[float, float],
    points: int,
    cursors: tuple[float, float] | None,
) -> list[dict[str, Any]]:
    """Each expression with its unit, its fault, and its line in every session that has what it
    names.
    """
    drawn = [{"text": text, "unit": "", "fault": "", "lines": []} for text in own]
    for number, one in enumerate(found.sessions):
        for curve, made in zip(drawn, derive(one.curves, own), strict=True):
            if made.y is None:
                curve["fault"] = curve["fault"] or made.fault
                continue
            curve["unit"] = made.unit
            curve["lines"].append(_own_line(one, number, made, window, points, cursors))
    for curve in drawn:
        if curve["lines"]:
            curve["fault"] = ""
    return drawn


def _own_line(
    one: Overlaid,
    number: int,
    made: Made,
    window: tuple[float, float],
    points: int,
    cursors: tuple[float, float] | None,
) -> dict[str, Any]:
    inside = (window[0] - one.offset_s, window[1] - one.offset_s)
    y = vouched(made.y, made.sight)  # what nobody vouches for is a hole
    t, step, first, last, every = _grid(len(y), one.curves.bin_s, inside, max(1, points // 2))
    line = {"session": number, "t0": t + one.offset_s, "dt": step}
    if cursors is not None:
        line["measured"] = stretch(one.curves.t + one.offset_s, made.y, *cursors, made.sight)
    return line | _decimated(y[first:last], y[first:last], every, 1.0)


def _shown(one: Overlaid, number: int, everything: bool) -> list[Line]:
    """The leading line and the tachometer of each; the truth of the first only."""
    lines = [line for line in one.curves.lines.values() if everything or line.key == one.lead]
    if everything:
        return lines
    kinds = (TACHO, TRUTH) if number == 0 else (TACHO,)
    return lines + [line for kind in kinds for line in one.curves.of_kind(kind)]


def _session(one: Overlaid) -> dict[str, Any]:
    shift = one.shift
    return {
        "id": one.curves.session,
        "offset_s": one.offset_s,
        "seconds": one.curves.seconds,
        "by": one.by,
        "quality": one.quality,
        "correlation": None if shift is None else shift.correlation,
        "rival_s": None if shift is None else shift.rival_s,
        "rival_correlation": None if shift is None else shift.rival_correlation,
        "line": one.lead,
        "coarse": one.curves.coarse,
        "others": max(0, len(one.curves.of_kind(RATE)) - 1),
        "bin_s": one.curves.bin_s,
        # does a bin hold one sample at most, so that what is measured is measured of all of them?
        "whole": all(line.low is line.mean for line in one.curves.lines.values()),
        "marks": [_mark(mark, one.offset_s) for mark in one.curves.marks],
    }


def _shades(one: Overlaid, window: tuple[float, float], points: int) -> dict[str, Any]:
    """Where the leading line does not vouch for x, y, z: [from, until, word] of each."""
    line = one.curves.lines.get(one.lead)
    return {} if line is None else _unsure(one, line, window, points)


def _unsure(
    one: Overlaid, line: Line, window: tuple[float, float], points: int
) -> dict[str, list[list[float | str]]]:
    """Where a line does not vouch for x, y, z: [from, until, word] of each."""
    if line.sight is None:
        return {}
    inside = (window[0] - one.offset_s, window[1] - one.offset_s)
    _, step, first, last, every = _grid(len(line.sight), one.curves.bin_s, inside, points // 2 or 1)
    sight = line.sight[first:last]
    sight = np.pad(sight, ((0, -len(sight) % every), (0, 0)))
    worst = np.minimum(sight.reshape(-1, every, 3).max(axis=1), len(WORDS) - 1)
    begin = first * one.curves.bin_s + one.offset_s
    found = {}
    for k, name in enumerate(XYZ):
        edges = np.flatnonzero(np.diff(worst[:, k], prepend=0, append=0))
        found[name] = [
            [round(begin + a * step, 4), round(begin + b * step, 4), WORDS[worst[a, k]]]
            for a, b in pairwise(edges.tolist())
            if worst[a, k]
        ]
    return found


def _mark(mark: Mark, offset_s: float) -> dict[str, Any]:
    """A remark; one about some time is a range of the plots, a procedure's is one of its steps, an
    alarm is there from its beginning to its end.
    """
    begin = mark.t + offset_s
    kind = RANGES.get(mark.author, "mark") if mark.seconds > 0 else "mark"
    until = begin + max(mark.seconds, 0.0)
    return {"t": begin, "until": until, "kind": kind, "text": mark.text, "author": mark.author}


def _line(
    one: Overlaid, number: int, line: Line, begin: float, end: float, points: int
) -> dict[str, Any]:
    against, error = one.curves.error_of(line)
    bins = max(1, points // 2)
    window = (begin - one.offset_s, end - one.offset_s)
    t, step, first, last, every = _grid(len(line.mean), one.curves.bin_s, window, bins)
    parts: dict[str, Any] = {}
    for name in line.components:
        _, low, high = line.part(name) or (None, np.zeros(0), np.zeros(0))
        parts[name] = _decimated(low[first:last], high[first:last], every, DEG)
    errors = {
        name: _decimated(e[first:last], e[first:last], every, DEG) for name, e in error.items()
    }
    angle = parts.pop("angle_z", None)
    return {
        "session": number,
        "key": line.key,
        "kind": line.kind,
        "title": line_title(line.title),
        "colour": line_colour(line.title),
        "reference": line.kind in (TACHO, TRUTH),
        "t0": t + one.offset_s,
        "dt": step,
        "rate": parts,
        "error": errors,
        "against": against,
        "angle": {"z": angle} if angle else {},
        "unsure": _unsure(one, line, (begin, end), points),
    }


def _measured(one: Overlaid, line: Line, begin: float, end: float) -> dict[str, Any]:
    """Figures between two cursors, by kind and component, as _line gives the points."""
    t = one.curves.t + one.offset_s
    parts = {name: line.part(name) for name in line.components}
    rates = {
        name: stretch(t, part[0] * DEG, begin, end, line.said_of(name))
        for name, part in parts.items()
        if part is not None
    }
    angle = rates.pop("angle_z", None)
    errors = one.curves.error_of(line)[1]
    return {
        "rate": rates,
        "error": {
            name: stretch(t, e * DEG, begin, end, line.said_of(name)) for name, e in errors.items()
        },
        "angle": {"z": angle} if angle else {},
    }


def _grid(
    n: int, bin_s: float, window: tuple[float, float], bins: int
) -> tuple[float, float, int, int, int]:
    """(time of the first point, step of points, first and one past the last bin, bins per point)
    for a window.
    """
    first = int(np.clip(np.floor(window[0] / bin_s), 0, n))
    last = int(np.clip(np.ceil(window[1] / bin_s), first, n))
    every = max(1, -(-(last - first) // bins))
    first -= first % every  # so that points stay where they are when the window moves
    return (first + 0.5 * every) * bin_s, every * bin_s, first, last, every


def _decimated(low: Array, high: Array, every: int, scale: float) -> dict[str, Any]:
    """Least and greatest of every `every` bins, NaN as None; `high` only where it differs."""
    if every > 1 and len(low):
        pad = -len(low) % every
        low = np.fmin.reduce(
            np.pad(low, (0, pad), constant_values=np.nan).reshape(-1, every), axis=1
        )
        high = np.fmax.reduce(
            np.pad(high, (0, pad), constant_values=np.nan).reshape(-1, every), axis=1
        )
    same = np.array_equal(low, high, equal_nan=True)
    return {"low": _numbers(low * scale), "high": None if same else _numbers(high * scale)}


def _numbers(values: Array) -> list[float | None]:
    rounded = np.round(values.astype(np.float64), 5)
    return [None if value != value else value for value in rounded.tolist()]


def _tracks(found: Comparison) -> list[dict[str, Any]]:
    """North and east from the first track's origin."""
    keyed: Sequence[tuple[int, Overlaid, str]] = [
        (number, one, key) for number, one in enumerate(found.sessions) for key in one.curves.tracks
    ]
    if not keyed:
        return []
    origin = keyed[0][1].curves.tracks[keyed[0][2]].origin
    result = []
    for number, one, key in keyed:
        points = moved(one.curves.tracks[key], origin)
        points = points[:: max(1, -(-len(points) // TRACK_POINTS))]
        result.append(
            {
                "session": number,
                "key": key,
                "title": line_title(key.split("/", 1)[1].removeprefix("nav/")),
                "colour": line_colour(key.split("/", 1)[1].removeprefix("nav/")),
                "dots": key.endswith("/gnss"),
                "t": np.round(points[:, 0] + one.offset_s, 2).tolist(),
                "north": np.round(points[:, 1], 3).tolist(),
                "east": np.round(points[:, 2], 3).tolist(),
                "down": _numbers(points[:, 3]),
            }
        )
    return result
