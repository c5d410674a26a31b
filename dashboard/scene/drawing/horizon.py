"""Tilt for people: an artificial horizon as SVG, and how far two verticals are apart."""

import math
from typing import Any

import numpy as np
from markupsafe import Markup

from inertial.rotation import to_matrix

SKY, GROUND, LINE, PLANE = "#56B4E9", "#8a6d3b", "#ffffff", "#E69F00"


def between(q: Any, p: Any) -> float:
    """Angle between the verticals of two attitudes, rad."""
    down, other = to_matrix(q)[2], to_matrix(p)[2]
    return math.atan2(float(np.linalg.norm(np.cross(down, other))), float(np.dot(down, other)))


def horizon_svg(roll: float, pitch: float, stale: bool, size: int = 190) -> Markup:
    """An artificial horizon: the aircraft's symbol stands, sky and ground move. Angles in rad.

    Only numbers and our own constants are written into it.
    """
    r, per_degree = size / 2.0, size / 90.0
    lift = max(-89.0, min(89.0, math.degrees(pitch))) * per_degree
    ladder = "".join(
        f'<line x1="{-w}" x2="{w}" y1="{-d * per_degree:.1f}" y2="{-d * per_degree:.1f}"'
        f' stroke="{LINE}"/><text x="{w + 4}" y="{-d * per_degree + 3:.1f}" fill="{LINE}"'
        f' font-size="9">{abs(d)}</text>'
        for d in (-60, -45, -30, -20, -10, 10, 20, 30, 45, 60)
        for w in ((22,) if d % 20 == 0 or abs(d) > 30 else (13,))
    )
    marks = "".join(
        f'<line y1="{-r + 3:.1f}" y2="{-r + (11 if a % 30 else 15):.1f}" stroke="{LINE}"'
        f' transform="rotate({a})"/>'
        for a in (-60, -45, -30, -20, -10, 0, 10, 20, 30, 45, 60)
    )
    words = f"roll {math.degrees(roll):+.1f} degrees, pitch {math.degrees(pitch):+.1f} degrees"
    return Markup(
        f'<svg class="gf-horizon{" gf-stale" if stale else ""}" role="img" aria-label="artificial'
        f' horizon: {words}" width="{size}" height="{size}" viewBox="{-r} {-r} {size} {size}"'
        ' style="display:block;margin:6px auto"><defs><clipPath id="gf-h"><circle'
        f' r="{r - 2:.1f}"/></clipPath></defs><g clip-path="url(#gf-h)"><g'
        f' transform="rotate({-math.degrees(roll):.2f}) translate(0 {lift:.2f})"><rect x="{-2 * r}"'
        f' y="{-4 * r}" width="{4 * r}" height="{4 * r}" fill="{SKY}"/><rect x="{-2 * r}" y="0"'
        f' width="{4 * r}" height="{4 * r}" fill="{GROUND}"/><line x1="{-2 * r}" x2="{2 * r}"'
        f' stroke="{LINE}" stroke-width="2"/>{ladder}</g><g'
        f' transform="rotate({-math.degrees(roll):.2f})">{marks}</g></g><path d="M0 {-r + 16:.1f}'
        f' l-6 10 h12 z" fill="{PLANE}"/><path d="M-52 0 h30 l6 8 M52 0 h-30 l-6 8" fill="none"'
        f' stroke="{PLANE}" stroke-width="4"/><circle r="3" fill="{PLANE}"/><circle r="{r - 2:.1f}"'
        ' fill="none" stroke="#8C8C8C" stroke-width="2"/></svg>'
    )
