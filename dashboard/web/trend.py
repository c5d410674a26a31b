"""A figure over a device's sessions as an SVG of our own: a line of points, each a link to its
session.
"""

import math
from dataclasses import dataclass

from markupsafe import Markup, escape

WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 560, 150, 64, 14, 12, 26


@dataclass(frozen=True)
class Point:
    """One session's value."""

    session: str
    start_s: float  # s since 1970
    value: float


@dataclass(frozen=True)
class Trend:
    """A figure with its drawing."""

    label: str
    points: list[Point]
    svg: Markup


def draw(points: list[Point]) -> Markup:
    """Points evenly spaced in the order of their sessions; mean and one standard deviation as a
    band.
    """
    values = [point.value for point in points]
    mean = sum(values) / len(values)
    spread = math.sqrt(sum((value - mean) ** 2 for value in values) / max(1, len(values) - 1))
    low, high = min([*values, mean - spread]), max([*values, mean + spread])
    margin = 0.08 * (high - low) or max(1e-9, abs(mean) * 0.1)
    low, high = low - margin, high + margin

    def x(k: int) -> float:
        return LEFT + (WIDTH - LEFT - RIGHT) * (k + 0.5) / len(points)

    def y(value: float) -> float:
        return TOP + (HEIGHT - TOP - BOTTOM) * (high - value) / (high - low)

    path = " ".join(f"{x(k):.1f},{y(value):.1f}" for k, value in enumerate(values))
    band = (
        f'<rect class="band" x="{LEFT}" width="{WIDTH - LEFT - RIGHT}" y="{y(mean + spread):.1f}"'
    )
    parts = [
        (
            f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{len(points)} sessions,'
            f' mean {mean:.4g}">'
        ),
        f'{band} height="{y(mean - spread) - y(mean + spread):.1f}"/>',
        (
            f'<line class="mean" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y(mean):.1f}"'
            f' y2="{y(mean):.1f}"/>'
        ),
        f'<polyline points="{path}"/>',
    ]
    for value in (low + margin, mean, high - margin):
        parts.append(
            f'<text x="{LEFT - 8}" y="{y(value) + 4:.1f}" text-anchor="end">{value:.4g}</text>'
        )
    for k, point in enumerate(points):
        name = escape(point.session)
        parts.append(
            f'<a href="/sessions/{name}"><circle cx="{x(k):.1f}" cy="{y(point.value):.1f}" r="4.5">'
            f"<title>{name}: {point.value:.5g}</title></circle></a>"
        )
    first, last = escape(points[0].session[:15]), escape(points[-1].session[:15])
    parts.append(f'<text x="{LEFT}" y="{HEIGHT - 6}">{first}</text>')
    if len(points) > 1:
        parts.append(f'<text x="{WIDTH - RIGHT}" y="{HEIGHT - 6}" text-anchor="end">{last}</text>')
    return Markup("".join(parts) + "</svg>")
