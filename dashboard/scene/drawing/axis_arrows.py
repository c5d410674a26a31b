"""The accelerometer axes on the cube: arrows coloured by how well each reading fits the others.

Below <body>/axes: arrows (axes in use), excluded (thin grey lines, hollow), and one label per axis
by its name.
"""

import numpy as np
from viser import SceneApi

from dashboard.scene.drawing import geometry as geo
from dashboard.scene.drawing.palette import AXES, GREY, SKY, VERMILLION, YELLOW, rgb
from messages.contract import gyrofree_pb2 as pb
from messages.text import plain

MOST = 64  # axes drawn
LENGTH, LABEL_AT = 0.42, 0.5  # half sides
GONE = " ✕"  # after the name of an axis that is left out
DOUBTFUL, BAD = 2.0, 4.0  # |residual| over its sigma
CUBE_NAMES = tuple(f"a{i // 3 + 1}{i % 3 + 1}" for i in range(12))


def residual_colour(axis: pb.AxisHealth.Axis) -> str:
    """Blue fits, yellow is doubtful, vermillion does not fit, grey is not used."""
    if axis.excluded:
        return GREY
    if axis.state != pb.AxisHealth.STATE_GOOD:
        return VERMILLION
    ratio = (
        abs(axis.residual_mps2) / axis.residual_sigma_mps2
        if axis.residual_sigma_mps2 > 0.0
        else 0.0
    )
    return VERMILLION if ratio >= BAD else YELLOW if ratio >= DOUBTFUL else SKY


class AxisArrows:
    """Arrows of one body; update() sends what has changed."""

    def __init__(self, scene: SceneApi, nodes: dict[str, object], body: str) -> None:
        self._scene, self._group = scene, f"{body}/axes"
        nodes[self._group] = scene.add_frame(self._group, show_axes=False)
        self._labels: dict[str, object] = {}
        self._parts: list[object] = []
        self._sent: tuple = ()
        self._draw(
            CUBE_NAMES,
            geo.SENSORS_B,
            geo.DIRECTIONS_B,
            [AXES[i % 3] for i in range(12)],
            (False,) * 12,
        )

    def labels(self) -> list[tuple[object, bool]]:
        """The labels, and whether their axis is left out; those first."""
        found = [(handle, handle.text.endswith(GONE)) for handle in self._labels.values()]
        return sorted(found, key=lambda one: not one[1])

    def update(self, health: pb.AxisHealth | None) -> None:
        """The newest AxisHealth of the device; None leaves the arrows in the colours of x, y and
        z.
        """
        if health is None or not health.axes:
            return
        axes = health.axes[:MOST]
        colours = [residual_colour(axis) for axis in axes]
        out = tuple(axis.excluded for axis in axes)
        key = (health.layout, tuple(colours), out)
        if key == self._sent:
            return
        self._sent = key
        placed = (
            all(len(a.position_b_m) == 3 and len(a.direction_b) == 3 for a in axes)
            and health.scale_m > 0
        )
        if placed:
            r = np.array([a.position_b_m for a in axes]) / health.scale_m
            theta = np.array([a.direction_b for a in axes])
            known = np.isfinite(r).all() and np.isfinite(theta).all()
            if not known or not np.linalg.norm(theta, axis=1).all():
                return  # a place that is not known is not drawn somewhere
        elif len(axes) == 12:
            r, theta = geo.SENSORS_B, geo.DIRECTIONS_B
        else:
            return
        self._draw(tuple(plain(a.name, 16) for a in axes), r, theta, colours, out)

    def _draw(
        self,
        names: tuple[str, ...],
        r: np.ndarray,
        theta: np.ndarray,
        colours: list[str],
        out: tuple[bool, ...],
    ) -> None:
        lines = np.stack([r, r + LENGTH * theta], axis=1).astype(np.float32)
        left_out = np.array(out, dtype=bool)
        for part in self._parts:
            part.remove()
        self._parts = []
        if (~left_out).any():
            self._parts.append(
                self._scene.add_arrows(
                    f"{self._group}/arrows",
                    lines[~left_out],
                    np.array([rgb(c) for c in colours], dtype=np.uint8)[~left_out],
                    shaft_radius=0.022,
                    head_radius=0.055,
                    head_length=0.13,
                )
            )
        if left_out.any():
            self._parts.append(
                self._scene.add_line_segments(
                    f"{self._group}/excluded",
                    _hollow(r, theta, left_out),
                    rgb(GREY),
                    thickness=2.0,
                    thickness_units="screen",
                )
            )
        if set(self._labels) != set(names):
            for label in self._labels.values():
                label.remove()
            self._labels = {
                name: self._scene.add_label(
                    f"{self._group}/label-{i}",
                    name,
                    position=tuple(r[i] + LABEL_AT * theta[i]),
                    anchor="center-center",
                    font_screen_scale=0.62,
                )
                for i, name in enumerate(names)
            }
        for name, gone in zip(names, out, strict=True):
            text = f"{name}{GONE}" if gone else name
            if self._labels[name].text != text:
                self._labels[name].text = text


def _hollow(r: np.ndarray, theta: np.ndarray, which: np.ndarray) -> np.ndarray:
    """Outlines (n, 2, 3) of arrows: four edges of a shaft and four of a head each."""
    segments = []
    for start, direction in zip(r[which], theta[which], strict=True):
        helper = np.array([1.0, 0.0, 0.0]) if abs(direction[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
        u = np.cross(direction, helper)
        u /= np.linalg.norm(u)
        tip = start + LENGTH * direction
        neck = start + (LENGTH - 0.13) * direction
        for side in (u, -u, np.cross(direction, u), -np.cross(direction, u)):
            segments += [(start + 0.022 * side, neck + 0.022 * side), (neck + 0.055 * side, tip)]
    return np.array(segments, dtype=np.float32)
