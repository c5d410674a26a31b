"""The sky above a receiver as one small SVG: north up, zenith in the middle, horizon at the rim; a
satellite's colour is its C/N0, filled where it is used in the fix.
"""

import math
from collections.abc import Iterable

from dashboard.scene.drawing.page import EMPTY, Markup, joined, note, rows, tag
from dashboard.scene.drawing.palette import number, truth_colour
from messages.contract import gyrofree_pb2 as pb

SIZE, RADIUS = 360, 150  # of the drawing; of the horizon
DOT = 7.5
NAME = (23.0, 9.0)  # size of a satellite's name
NAMES = {  # in the order of the table
    pb.Sky.CONSTELLATION_GPS: "GPS",
    pb.Sky.CONSTELLATION_GALILEO: "Galileo",
    pb.Sky.CONSTELLATION_GLONASS: "GLONASS",
    pb.Sky.CONSTELLATION_BEIDOU: "BeiDou",
    pb.Sky.CONSTELLATION_QZSS: "QZSS",
    pb.Sky.CONSTELLATION_NAVIC: "NavIC",
    pb.Sky.CONSTELLATION_SBAS: "SBAS",
    pb.Sky.CONSTELLATION_UNKNOWN: "unknown",
}
# dB-Hz from which a colour holds: told apart by all eyes, by their lightness too
STEPS = ((0, "#8a5bb0"), (25, "#4f7fc4"), (32, "#2aa198"), (38, "#7cc95a"), (44, "#f2d024"))
UNTRACKED = "#8C8C8C"

Satellite = pb.Sky.Satellite


def colour_of(cn0_dbhz: float) -> str:
    """The colour of a C/N0; grey for one that is not tracked."""
    found = UNTRACKED
    for least, colour in STEPS:
        if cn0_dbhz >= least:
            found = colour
    return found


def place_of(one: Satellite) -> tuple[float, float] | None:
    """Where it stands in the drawing; None below the horizon, or where nobody knows."""
    if not (math.isfinite(one.elevation_deg) and math.isfinite(one.azimuth_deg)):
        return None
    if one.elevation_deg < 0.0:
        return None
    away, azimuth = RADIUS * (1.0 - one.elevation_deg / 90.0), math.radians(one.azimuth_deg)
    return SIZE / 2 + away * math.sin(azimuth), SIZE / 2 - away * math.cos(azimuth)


def said(satellites: Iterable[Satellite]) -> str:
    """In words, what there is."""
    seen = list(satellites)
    used = sum(one.use == pb.Sky.USE_YES for one in seen)
    open_ = seen and all(one.use == pb.Sky.USE_UNKNOWN for one in seen)
    count = "the receiver does not say which are used" if open_ else f"{used} used"
    return f"{len(seen)} satellites in view, {count}"


def sky_svg(satellites: Iterable[Satellite], dark: bool) -> Markup:
    """The plot; those without a direction are not in it."""
    seen, ink = list(satellites), truth_colour(dark)
    middle = SIZE / 2
    out = [
        tag(
            "circle",
            cx=middle,
            cy=middle,
            r=f"{RADIUS * (1 - elevation / 90):.1f}",
            fill="none",
            stroke=ink,
            stroke_opacity=0.3,
        )
        for elevation in (0, 30, 60)
    ]
    span = 2 * RADIUS
    out.append(
        tag(
            "path",
            d=f"M{middle} {middle - RADIUS}v{span}M{middle - RADIUS} {middle}h{span}",
            stroke=ink,
            stroke_opacity=0.18,
        )
    )
    for text, x, y in (
        ("N", middle, middle - RADIUS - 6),
        ("E", middle + RADIUS + 12, middle + 5),
        ("S", middle, middle + RADIUS + 17),
        ("W", middle - RADIUS - 12, middle + 5),
    ):
        out.append(_text(text, x, y, 13, ink))
    for elevation in (30, 60):
        y = middle - RADIUS * (1 - elevation / 90) + 13
        out.append(_text(f"{elevation}°", middle + 14, y, 10, ink))
    places = [place for one in seen if (place := place_of(one)) is not None]
    names = _Names(places)
    for one in sorted(seen, key=lambda one: one.use == pb.Sky.USE_YES):
        out.append(_satellite(one, ink, names))
    box = {"viewBox": f"0 0 {SIZE} {SIZE}", "width": "100%", "role": "img"}
    return tag("svg", *out, aria_label=said(seen), **box)


class _Names:
    """Where the names of satellites stand, so that none lies over a dot or another name."""

    def __init__(self, dots: list[tuple[float, float]]) -> None:
        self._taken = [(x, y, DOT, DOT) for x, y in dots]  # middles and half sizes

    def place(self, x: float, y: float) -> tuple[float, float]:
        """Foot of the name of a dot at x, y: below it, above or beside; below where all is full."""
        below = (x, y + DOT + 11)
        for at in (below, (x, y - DOT - 4), (x + 21, y + 4), (x - 21, y + 4)):
            middle = (at[0], at[1] - NAME[1] / 2)
            if not any(
                abs(middle[0] - u) < NAME[0] / 2 + a and abs(middle[1] - v) < NAME[1] / 2 + b
                for u, v, a, b in self._taken
            ):
                self._taken.append((*middle, NAME[0] / 2, NAME[1] / 2))
                return at
        return below


def _text(text: str, x: float, y: float, size: int, ink: str) -> Markup:
    place = {"x": f"{x:.1f}", "y": f"{y:.1f}", "text_anchor": "middle"}
    return tag("text", text, fill=ink, font_size=size, font_family="sans-serif", **place)


def _satellite(one: Satellite, ink: str, names: _Names) -> Markup:
    place = place_of(one)
    if place is None:
        return EMPTY
    x, y = place
    colour = colour_of(one.cn0_dbhz)
    look = {
        pb.Sky.USE_YES: {"fill": colour, "stroke": ink, "stroke_width": 1.2},
        pb.Sky.USE_NO: {"fill": "none", "stroke": colour, "stroke_width": 2.4},
    }.get(one.use, {"fill": colour, "fill_opacity": 0.7, "stroke": ink, "stroke_dasharray": "2 2"})
    power = number(one.cn0_dbhz, 0, "dB-Hz") if math.isfinite(one.cn0_dbhz) else "not tracked"
    title = (
        f"{one.name}: elevation {one.elevation_deg:.0f}°, azimuth {one.azimuth_deg:.0f}°, {power}"
    )
    dot = tag("circle", tag("title", title), cx=f"{x:.1f}", cy=f"{y:.1f}", r=DOT, **look)
    return dot + _text(one.name, *names.place(x, y), 10.5, ink)


def legend() -> Markup:
    """What colours and shapes mean."""
    signs = []
    for k, (least, colour) in enumerate(STEPS):
        until = f"below {STEPS[1][0]}" if k == 0 else f"from {least}"
        signs.append(joined([tag("span", "●", style=f"color:{colour}"), f" {until}"]))
    shapes = "Filled: used in the fix; ring: not used; dashed: not said; grey: not tracked."
    return note("C/N0, dB-Hz: ", joined(signs, " \u00a0 ")) + note(shapes)


def table(satellites: Iterable[Satellite], stale: bool = False) -> Markup:
    """Each system: in view, tracked, used, mean C/N0 of those tracked."""
    seen = list(satellites)
    items = []
    for system, name in NAMES.items():
        mine = [one for one in seen if one.constellation == system]
        if not mine:
            continue
        powers = [one.cn0_dbhz for one in mine if math.isfinite(one.cn0_dbhz)]
        mean = number(sum(powers) / len(powers), 0, "dB-Hz") if powers else "–"
        items.append(
            (name, f"{len(mine)} in view · {len(powers)} tracked · {_used(mine)} · {mean}")
        )
    hidden = [one.name for one in seen if place_of(one) is None]
    if hidden:
        items.append(("without a direction", ", ".join(hidden[:12])))
    return rows(items, stale)


def _used(seen: list[Satellite]) -> str:
    unknown = sum(one.use == pb.Sky.USE_UNKNOWN for one in seen)
    if unknown == len(seen):
        return "used: not said"
    used = sum(one.use == pb.Sky.USE_YES for one in seen)
    return f"{used} used" + (f" ({unknown} not said)" if unknown else "")
