"""A chart as browsers get it: heading, points, lines and bands, made of curves. Nothing in it is of
one browser.

The heading also tells the page around the scene what is drawn (data-chart: title, unit, ranges with
their names), from which static/figure.js makes cursors, named ranges and pictures for a paper.

uPlot's own legend knows values only under the cursor, so the heading takes its place. Known traps
of the charts and what is done about them: NaN is never sent; the time axis is told that it is not a
date; a gap is a grey series on a scale of its own, drawn last and opaque so that it covers the
straight line beneath. What was filled in after a loss has an amber strip at the bottom, and a note
a vertical line, made the same way.
"""

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from dashboard.data.ring import gap_limit
from dashboard.scene.drawing import series
from dashboard.scene.drawing.page import Markup, explained, tag
from dashboard.scene.drawing.palette import number, rgba
from logs.figures.sight import vouched, word, worst
from logs.figures.stretch import stretch

LATE_HEIGHT = 0.035  # of the strip that marks filled-in data, of the chart's height
MOST_RANGES, MOST_SHADES = 24, 8  # named in one chart; told of one shade
SINGLE = np.float32  # of a browser's points: seven digits are more than a screen shows
RUNAWAY = 4.0  # widths of what is known
REPAIRED = "#e69f00"


@dataclass(frozen=True)
class Name:
    """What stands above a chart."""

    title: str | Markup
    unit: str
    digits: int = 1  # of the newest values


@dataclass
class Curve:
    """One line of a chart. t (n,) s, y (n,) in the chart's unit; half (n,) is the half width of its
    band.
    """

    label: str
    colour: str
    t: np.ndarray
    y: np.ndarray
    half: np.ndarray | None = None
    dash: bool = False
    stale: bool = False
    width: float = 1.6
    about_zero: bool = False  # the band is what an error is allowed to be, so it lies around zero
    live: bool = True  # its newest value stands in the heading
    sight: np.ndarray | None = None  # (n,) what the estimator says of y, RateEstimate.Sight


@dataclass
class Shade:
    """Times of a chart that a colour lies behind: where on (n,) is true, at t (n,) s."""

    label: str
    colour: str
    t: np.ndarray
    on: np.ndarray


@dataclass(frozen=True)
class Range:
    """What happened from t0 to t1, s; a moment where both are the same."""

    t0: float
    t1: float
    text: str
    kind: str = "mark"  # mark, step, late or alarm


@dataclass(frozen=True)
class Drawn:
    """A chart as a browser gets it; the same for every browser that shows the same."""

    heading: str
    data: tuple[np.ndarray, ...] = ()  # none: there is nothing to draw
    lines: tuple[dict, ...] = ()
    bands: tuple[dict, ...] | None = None
    signature: tuple = ()  # of lines and bands


def drawn(
    name: Name,
    curves: Sequence[Curve],
    t0: float,
    t1: float,
    dark: bool,
    primary: int = 0,
    late: Sequence[Sequence[float]] = (),
    ranges: Sequence[Range] = (),
    shades: Sequence[Shade] = (),
    cursors: tuple[float, float] | tuple[()] = (),
    origin: str = "",
    thin: Sequence[Sequence[float]] = (),
) -> Drawn:
    """The window [t0, t1] of curves; gaps are those of the curve number `primary`.

    Stretches [from, until] of `late` get a strip at the bottom: filled in after a loss. Each of
    `ranges` is drawn with its name. A shade lies behind the times it names. Between the
    cursors all samples are measured; `origin` says what the time counts from; `thin`
    are stretches [from, until, one sample in so many s] of a preview, which are no gaps.
    """
    shades = [shade for shade in shades if len(shade.t)]
    inside = [one for one in ranges if one.t1 >= t0 and one.t0 <= t1][-MOST_RANGES:]
    told = {
        "title": re.sub(r"<[^>]*>", "", str(name.title)),
        "unit": name.unit,
        "origin": origin,
        "ranges": [[one.t0, one.t1, one.text, one.kind] for one in inside],
        "measured": _measured(curves, *cursors) if cursors else None,
        "shades": [piece for shade in shades for piece in _pieces(shade, t0, t1)],
        "holes": _all_holes(curves, t0, t1),
        "faint": {str(c.label): faint for c in curves if (faint := _faint(c, t0, t1))},
        "unsure": {str(c.label): said for c in curves if (said := worst(c.sight))},
    }
    heading = _heading(name, curves, shades, told)
    curves = [curve for curve in curves if len(curve.t)]
    if not curves:
        return Drawn(heading)
    data = _data(curves, t0, t1, min(primary, len(curves) - 1), late, shades, thin)
    signature = (
        dark,
        *(s.label for s in shades),
        *((c.label, c.colour, c.half is not None, c.dash, c.width) for c in curves),
    )
    return Drawn(heading, data, *_lines(curves, dark, shades), signature)


def _heading(
    name: Name,
    curves: Sequence[Curve],
    shades: Sequence[Shade],
    told: dict[str, Any],
) -> str:
    items = []
    for curve in curves:
        if not curve.label:
            continue
        value = _newest(curve, name.digits) if curve.live else ""
        mark = "gf-dash" if curve.dash else "gf-line"
        stale = " gf-stale" if curve.stale else ""
        sample = tag("i", class_=mark, style=f"border-color:{curve.colour}")
        items.append(
            tag(
                "span",
                sample,
                explained(curve.label),
                " ",
                tag("b", value),
                class_=f"gf-item{stale}",
            )
        )
    for shade in shades:
        if shade.on.any():
            style = f"border-color:{shade.colour};border-width:8px"
            sample = tag("i", class_="gf-line", style=style)
            items.append(tag("span", sample, explained(shade.label), class_="gf-item"))
    items = items or [tag("span", "no data yet", class_="gf-item gf-stale")]
    title = tag("span", explained(name.title), " ", tag("em", name.unit), class_="gf-title")
    legend = tag("span", *items, class_="gf-legend")
    data = json.dumps(told, separators=(",", ":"), ensure_ascii=False)
    return str(tag("div", title, legend, class_="gf-chart", data_chart=data))


def _holes(curve: Curve, t0: float, t1: float) -> list[list[float]]:
    """Where a curve within [t0, t1] has samples but no values, [from, until]; those of the first
    curve cover all others anyway.
    """
    known = np.isfinite(curve.y)
    if known.all():
        return []
    t = curve.t[known]
    ends = np.concatenate([[t0], t, [t1]]).clip(t0, t1)
    wide = np.flatnonzero(np.diff(ends) > gap_limit(t))[-MOST_RANGES:]
    return np.column_stack([ends[wide], ends[wide + 1]]).round(3).tolist()


def _all_holes(curves: Sequence[Curve], t0: float, t1: float) -> dict[str, list[list[float]]]:
    """Of each curve, and of its band where that is not known."""
    found = {str(c.label): _holes(c, t0, t1) for c in curves}
    for c in curves:
        if c.half is not None and len(c.t):
            band = _holes(replace(c, y=c.half), t0, t1)
            found |= {f"{c.label} +3σ": band, f"{c.label} −3σ": band}
    return {label: holes for label, holes in found.items() if holes}


def _faint(curve: Curve, t0: float, t1: float) -> list[list[float]]:
    """Where within [t0, t1] an estimator does not vouch for its line, which is dotted there."""
    if not worst(curve.sight):
        return []
    shade = Shade("", "", curve.t, curve.sight > 0)
    return [[begin, end] for begin, end, *_ in _pieces(shade, t0, t1)]


def _pieces(shade: Shade, t0: float, t1: float) -> list[tuple[float, float, str, str]]:
    """A shade within [t0, t1] as ranges, for a picture; the longest of them."""
    edges = np.flatnonzero(np.diff(shade.on.astype(np.int8), prepend=0, append=0))
    ends = np.append(shade.t, shade.t[-1])[edges].round(3).reshape(-1, 2)
    inside = ends[(ends[:, 1] >= t0) & (ends[:, 0] <= t1)]
    longest = np.sort(np.argsort(inside[:, 0] - inside[:, 1], kind="stable")[:MOST_SHADES])
    return [(a, b, shade.label, shade.label) for a, b in inside[longest].tolist()]


def _newest(curve: Curve, digits: int) -> Markup | str:
    """The newest value, or the word of an estimator that does not vouch for it."""
    good = np.flatnonzero(np.isfinite(curve.y))
    if not len(good) or curve.t[-1] - curve.t[good[-1]] > gap_limit(curve.t[good]):
        return "–"  # or not known any more
    unsure = "" if curve.sight is None else word(curve.sight[good[-1]])
    return explained(unsure) if unsure else number(float(curve.y[good[-1]]), digits)


def _lines(
    curves: Sequence[Curve], dark: bool, shades: Sequence[Shade] = ()
) -> tuple[tuple[dict, ...], tuple[dict, ...] | None]:
    """uPlot's description of the series that _data gives, and of the bands between them."""
    lines: list[dict] = [{"label": "t"}]
    bands: list[dict] = []
    for curve in curves:
        line = {
            "label": str(curve.label),
            "stroke": curve.colour,
            "width": curve.width,
            "points": {"show": False},
        }
        lines.append(line | ({"dash": (6, 4)} if curve.dash else {}))
        if curve.half is not None:
            bands.append({"series": (len(lines), len(lines) + 1), "fill": rgba(curve.colour, 0.20)})
            edge = {"stroke": rgba(curve.colour, 0.35), "width": 0.7, "points": {"show": False}}
            lines += [
                edge | {"label": f"{curve.label} +3σ"},
                edge | {"label": f"{curve.label} −3σ"},
            ]
    for shade in shades:
        fill = {
            "scale": "gap",
            "stroke": shade.colour,
            "width": 0,
            "fill": rgba(shade.colour, 0.25),
            "fillTo": 0,
        }
        lines.append(fill | {"label": shade.label, "points": {"show": False}})
    grey = "#3b3b3b" if dark else "#d5d5d5"
    gap = {"label": "gap", "scale": "gap", "stroke": grey, "width": 0, "fill": grey, "fillTo": 0}
    strip = gap | {"label": "filled in", "scale": "strip", "stroke": REPAIRED, "fill": REPAIRED}
    lines += [line | {"points": {"show": False}} for line in (strip, gap)]
    return tuple(lines), tuple(bands) or None


def _data(
    curves: Sequence[Curve],
    t0: float,
    t1: float,
    primary: int,
    late: Sequence[Sequence[float]] = (),
    shades: Sequence[Shade] = (),
    thin: Sequence[Sequence[float]] = (),
) -> tuple[np.ndarray, ...]:
    """The arrays of a chart: time, each curve with the edges of its band, and the masks of shades,
    of what was filled in and of gaps; all of one length, in the smallest type that serves.
    """
    edges, x = series.grid(t0, t1)
    lines = [series.decimate(curve.t, _bounded(curve, curves), edges)[0] for curve in curves]
    low, high = min(float(y.min()) for y in lines), max(float(y.max()) for y in lines)
    # A band that grows without bound would press the curves flat: it is cut half their range
    # outside.
    reach = max((high - low) / 2, 1e-9)
    out = [x]
    for curve, y in zip(curves, lines, strict=True):
        out.append(y.astype(SINGLE))
        if curve.half is not None:
            half = series.decimate(curve.t, curve.half, edges)[0]
            centre = np.zeros_like(y) if curve.about_zero else y
            out += [
                np.clip(centre + half, low - reach, high + reach).astype(SINGLE),
                np.clip(centre - half, low - reach, high + reach).astype(SINGLE),
            ]
    for shade in shades:  # the nearest sample's word, 0 or 1
        on = np.clip(np.searchsorted(shade.t, x), 0, len(shade.t) - 1)
        out.append(shade.on[on].astype(np.uint8))
    out.append(series.stretch_mask(late, edges).astype(np.uint8))
    t, y = curves[primary].t, curves[primary].y
    if not np.isfinite(y).any():
        t = t[:0]  # samples without a value are no values: all of it is a gap
    pause = max(gap_limit(t), 2.5 * (edges[1] - edges[0]))
    out.append(series.gap_mask(t, edges, pause, thin).astype(np.uint8))
    return tuple(out)


def _bounded(curve: Curve, curves: Sequence[Curve]) -> np.ndarray:
    """Its values (n,); those that the estimator does not vouch for at most so far outside of what
    is known that a filter which runs away does not flatten the others.
    """
    if not worst(curve.sight):
        return curve.y
    known = np.concatenate([vouched(one.y, one.sight) for one in curves])
    known = known[np.isfinite(known)]
    if not len(known) or not (wide := float(np.ptp(known))) > 0.0:
        return curve.y
    bounds = np.clip(curve.y, known.min() - RUNAWAY * wide, known.max() + RUNAWAY * wide)
    return np.where(curve.sight > 0, bounds, curve.y)


def _measured(curves: Sequence[Curve], a: float, b: float) -> dict[str, Any]:
    """What lies between two cursors, of every sample; by label."""
    return {
        str(curve.label): stretch(curve.t, curve.y, a, b, curve.sight) | {"at": [a, b]}
        for curve in curves
        if curve.label
    }
