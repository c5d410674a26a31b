"""The way of a vehicle from above and its height beside it, as one small SVG: trajectories, fixes,
uncertainty.
"""

from collections.abc import Iterable

import numpy as np

from dashboard.scene.drawing.palette import FIX, REJECTED, escape, truth_colour

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
) -> str:
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
        return ""
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
    out = [
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" width="100%" role="img" aria-label="map of the way,'
        ' north up">'
    ]
    for group, colour, size in ((thin(fixes), FIX, 2.0), (thin(rejected), REJECTED, 3.2)):
        for x, y in at(group) if len(group) else ():
            out.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{size}" fill="{colour}"/>')
    for _, colour, way in reversed(ways):
        line = " ".join(f"{x:.1f},{y:.1f}" for x, y in at(way))
        out.append(f'<polyline points="{line}" fill="none" stroke="{colour}" stroke-width="1.6"/>')
    if ways:
        x, y = at(ways[0][2][-1:])[0]
        if sigma is not None and np.isfinite(sigma).all():
            rx, ry = (min(3.0 * s * scale, 2.0 * WIDTH) for s in (sigma[1], sigma[0]))
            out.append(
                f'<ellipse cx="{x:.1f}" cy="{y:.1f}" rx="{rx:.1f}" ry="{ry:.1f}"'
                f' fill="{ways[0][1]}" fill-opacity="0.2" stroke="{ways[0][1]}"/>'
            )
        out.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4" fill="{ink}"/>')
    bar = max((s for s in STEPS if s * scale < WIDTH / 3), default=1)
    y = HEIGHT - 8
    out.append(f'<path d="M{MARGIN} {y}h{bar * scale:.1f}" stroke="{ink}" stroke-width="2"/>')
    out.append(f'<text x="{MARGIN}" y="{y - 5}" font-size="11" fill="{ink}">{bar} m</text>')
    out.append(f'<text x="{WIDTH - 22}" y="16" font-size="12" fill="{ink}">N ↑</text></svg>')
    legend = "".join(
        f'<span style="color:{colour}">━</span> {escape(title)} &nbsp; '
        for title, colour, _ in ways
    )
    return (
        "".join(out) + f'<p class="gf-note">{legend}<span style="color:{FIX}">●</span> fix &nbsp; '
        f'<span style="color:{REJECTED}">●</span> not believed</p>'
    )
