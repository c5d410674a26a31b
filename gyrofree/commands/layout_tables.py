"""What `gyrofree layout` prints: the axes of a layout, its figures, what it sees."""

import math
from typing import Any

from rich.table import Table

from inertial.constants import MILLI_G


def _products(q: Any) -> int:
    return int((q.singular_products > 1e-4 * max(q.singular_products.max(), 1e-9)).sum())


def _number(value: float, digits: int = 3) -> str:
    return f"{value:.{digits}f}" if math.isfinite(value) else "-"


def _feedback(q: Any) -> str:
    if not math.isfinite(q.gdop):
        return "-"
    return {(0, 0): "none", (1, 0): "in w'", (0, 1): "in p", (1, 1): "in w' and p"}[
        q.feedback_alpha, q.feedback_force
    ]


def price(q: Any) -> str:
    lost = [name for name, seen in zip(_names(), q.seen, strict=True) if seen == "no"]
    parts = [f"feedback {_feedback(q)}", f"rank {q.rank} of 12"]
    if lost:
        parts.append(f"not seen alone: {', '.join(lost)}")
    if q.mixtures:
        parts.append(f"of the products only {', '.join(q.mixtures)}")
    return "; ".join(parts)


def _names() -> tuple[str, ...]:
    from inertial.layouts.quality import UNKNOWNS

    return UNKNOWNS


def axes_table(layout: Any) -> Table:
    table = Table(
        "axis",
        "position mm",
        "direction",
        "sensor",
        "scale",
        "channel",
        title=f"{layout.axes} axes",
    )
    for i in range(layout.axes):
        table.add_row(
            layout.axis_names[i],
            "  ".join(f"{1e3 * v:7.2f}" for v in layout.r_b[i]),
            "  ".join(f"{v:6.3f}" for v in layout.theta_b[i]),
            layout.sensors[i].name,
            f"{layout.gain[i]:g}",
            str(layout.channels[i]),
        )
    return table


def figures_table(found: list[Any]) -> Table:
    table = Table("", *(q.layout.name for q in found))
    degrees = math.degrees
    turning = f"w at {degrees(found[0].rate[2]):.0f} °/s, filter, °/s"
    rows = [
        ("axes", [str(q.layout.axes) for q in found]),
        ("scale (counts as 1), mm", [f"{1e3 * q.layout.scale_m:g}" for q in found]),
        ("kappa", [_number(q.kappa, 4) for q in found]),
        ("GDOP", [_number(q.gdop, 4) for q in found]),
        ("feedback", [_feedback(q) for q in found]),
        ("rank of 12", [str(q.rank) for q in found]),
        ("condition of what is seen", [_number(q.condition, 2) for q in found]),
        ("products seen (rank of 6)", [str(_products(q)) for q in found]),
        (
            "noise of p x y z, mg",
            [_three_of(q.sigma_least_squares[3:], 1 / MILLI_G, 2) for q in found],
        ),
        (
            "noise of w' x y z, rad/s2",
            [_three_of(q.sigma_least_squares[:3], 1.0, 3) for q in found],
        ),
        ("w by integration, °/s per root s", [_three_of(q.walk, degrees(1.0), 2) for q in found]),
        (turning, [_three_of(q.sigma_rate, degrees(1.0), 2) for q in found]),
    ]
    for name, values in rows:
        table.add_row(name, *values)
    return table


def _three_of(values: Any, unit: float, digits: int) -> str:
    return "  ".join(_number(float(v) * unit, digits) for v in values)


def unknowns_table(q: Any) -> Table:
    table = Table(
        "unknown", "seen", "noise of one sample", title="The twelve unknowns of the field"
    )
    units = ("rad/s2",) * 3 + ("m/s2",) * 3 + ("(rad/s)2",) * 6
    for name, seen, sigma, unit in zip(_names(), q.seen, q.sigma_field, units, strict=True):
        table.add_row(
            name, seen, f"{_number(float(sigma), 4)} {unit}" if math.isfinite(sigma) else "-"
        )
    return table


def matrix_table(title: str, matrix: Any, names: Any) -> Table:
    table = Table("", *([""] * matrix.shape[1]), title=title, show_header=False)
    for name, row in zip(names, matrix, strict=True):
        table.add_row(name, *(f"{v:.4g}" for v in row + 0.0))
    return table
