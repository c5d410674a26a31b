"""Layouts as pictures: axes in space and the ellipsoids of predicted noise."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from inertial.layouts.layout import Layout
from inertial.layouts.quality import Quality
from inertial.whole_file import whole

Array = NDArray[np.float64]

COLOUR = "#0072B2"
EDGES = "#8C8C8C"


def noise_ellipsoid(layout: Layout) -> tuple[Array, Array]:
    """Half axes (3,), rad/s^2, and directions (3, 3, columns) of one sigma of omega' by least
    squares of one sample.
    """
    S = layout.S[:3] * layout.noise
    values, vectors = np.linalg.eigh(S @ S.T)
    return np.sqrt(np.maximum(values, 0.0)), vectors


def draw(found: Sequence[Quality], path: Path) -> None:
    """One picture per layout, beside one another, into a PNG file; raises OSError for a path that
    cannot be written.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # here: only who draws waits for it
    from matplotlib.figure import Figure

    columns = min(3, len(found))
    rows = -(-len(found) // columns)
    figure = Figure(figsize=(5.0 * columns, 5.2 * rows), layout="constrained")
    FigureCanvasAgg(figure)
    for k, q in enumerate(found):
        _one(figure.add_subplot(rows, columns, k + 1, projection="3d"), q)
    with whole(path) as draft:
        figure.savefig(draft, dpi=110, format="png")


def _one(ax: object, q: Quality) -> None:
    layout, size = q.layout, 1e3 * q.layout.scale_m
    r, theta = 1e3 * layout.r_b, 0.5 * size * layout.theta_b
    for a in range(3):
        for u in (-size, size):
            for v in (-size, size):
                line = np.tile([u, v, 0.0], (2, 1))
                line[:, 2] = (-size, size)
                ax.plot(*np.roll(line, a, axis=1).T, color=EDGES, linewidth=0.8)
    ax.quiver(*r.T, *theta.T, color=COLOUR, arrow_length_ratio=0.25, linewidth=1.8)
    for name, tip in zip(layout.axis_names, r + 1.15 * theta, strict=True):
        ax.text(*tip, name, fontsize=7, ha="center")
    if np.isfinite(q.gdop):
        half, vectors = noise_ellipsoid(layout)
        half = 0.3 * size * half / half.max()
        u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 24), np.linspace(0, np.pi, 13))
        ball = np.stack([np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)])
        x, y, z = np.einsum("ij,jab->iab", vectors * half, ball)
        ax.plot_surface(x, y, z, color="#E69F00", alpha=0.5, linewidth=0)
    limit = 1.3 * max(size, float(np.abs(r).max()))
    ax.set(
        xlim=(-limit, limit),
        ylim=(-limit, limit),
        zlim=(-limit, limit),
        xlabel="x_b mm",
        ylabel="y_b mm",
        zlabel="z_b mm",
    )
    ax.set_box_aspect((1, 1, 1))
    gdop = f"{q.gdop:.4f}" if np.isfinite(q.gdop) else "none"
    ax.set_title(
        f"{layout.name}: kappa {q.kappa:.3f}, GDOP {gdop}, rank {q.rank} of 12", fontsize=10
    )
