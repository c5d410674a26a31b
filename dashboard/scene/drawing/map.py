"""The way of a vehicle from above and its height beside it, as one small SVG: trajectories, fixes,
uncertainty.
"""

from collections.abc import Iterable

import numpy as np

from dashboard.scene.drawing.page import Markup, joined, note, tag
from dashboard.scene.drawing.palette import FIX, REJECTED, truth_colour

WIDTH, HEIGHT, MARGIN = 360, 300, 14
POINTS = 300  # of each line
STEPS = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000)  # m, lengths of the scale bar


def thin(points: np.ndarray, most: int = POINTS) -> np.ndarray:
    """At most `most` rows of (n, k), the newest kept."""
    step = max(1, -(-len(points) // most))
    return points[(len(points) - 1) % step :: step]


def map_svg(
    ways: Iterable[tuple[str, str, np.ndarray]],
    fixes: np.ndarray,
    rejected: np.ndarray,
    sigma: tuple[float, float] | None,
    dark: bool,
) -> Markup:
    """North up. ways: (title, colour, (n, 3) NED m), the first on top; fixes and rejected (n, 3)
    NED m.

    sigma (north, east), m, draws the 3-sigma ellipse at the end of the first way. Empty text for
    nothing to draw.
    """
    ways = [(title, colour, thin(way)) for title, colour, way in ways if len(way) > 1]
    everything = [way[:, :2] for _, _, way in ways] + [fixes[:, :2]]
    points = (
        np.concatenate([p for p in everything if len(p)])
        if any(len(p) for p in everything)
        else np.empty((0, 2))
    )
    points = points[np.isfinite(points).all(axis=1)]
    if len(points) < 2:
        return Markup()
    low, high = points.min(axis=0), points.max(axis=0)
    scale = min(
        (WIDTH - 2 * MARGIN) / max(high[1] - low[1], 5.0),
        (HEIGHT - 2 * MARGIN) / max(high[0] - low[0], 5.0),
    )
    middle = 0.5 * (low + high)

    def at(p: np.ndarray) -> np.ndarray:
        return np.column_stack(
            [WIDTH / 2 + (p[:, 1] - middle[1]) * scale, HEIGHT / 2 - (p[:, 0] - middle[0]) * scale]
        )

    ink = truth_colour(dark)
    out = []
    for group, colour, size in ((thin(fixes), FIX, 2.0), (thin(rejected), REJECTED, 3.2)):
        for x, y in at(group) if len(group) else ():
            out.append(tag("circle", cx=f"{x:.1f}", cy=f"{y:.1f}", r=size, fill=colour))
    for _, colour, way in reversed(ways):
        line = " ".join(f"{x:.1f},{y:.1f}" for x, y in at(way))
        out.append(tag("polyline", points=line, fill="none", stroke=colour, stroke_width=1.6))
    if ways:
        x, y = at(ways[0][2][-1:])[0]
        if sigma is not None and np.isfinite(sigma).all():
            rx, ry = (min(3.0 * s * scale, 2.0 * WIDTH) for s in (sigma[1], sigma[0]))
            size = {"rx": f"{rx:.1f}", "ry": f"{ry:.1f}"}
            look = {"fill": ways[0][1], "fill_opacity": 0.2, "stroke": ways[0][1]}
            out.append(tag("ellipse", cx=f"{x:.1f}", cy=f"{y:.1f}", **size, **look))
        out.append(tag("circle", cx=f"{x:.1f}", cy=f"{y:.1f}", r=4, fill=ink))
    bar = max((s for s in STEPS if s * scale < WIDTH / 3), default=1)
    y = HEIGHT - 8
    out += [
        tag("path", d=f"M{MARGIN} {y}h{bar * scale:.1f}", stroke=ink, stroke_width=2),
        tag("text", f"{bar} m", x=MARGIN, y=y - 5, font_size=11, fill=ink),
        tag("text", "N ↑", x=WIDTH - 22, y=16, font_size=12, fill=ink),
    ]
    box = {"viewBox": f"0 0 {WIDTH} {HEIGHT}", "width": "100%", "role": "img"}
    drawing = tag("svg", *out, aria_label="map of the way, north up", **box)
    signs = [("━", colour, title) for title, colour, _ in ways]
    signs += [("●", FIX, "fix"), ("●", REJECTED, "not believed")]
    legend = (
        joined([tag("span", sign, style=f"color:{colour}"), f" {title}"])
        for sign, colour, title in signs
    )
    return drawing + note(joined(legend, " \u00a0 "))
