"""The layout bench: drag sensors in 3-D and see what the arrangement can tell, beside the published
cube.

Its scene, in body axes and units of half the side, stands at /bench while the page is open; the
device's is hidden.
"""

import re

import numpy as np
import viser

from dashboard.scene.drawing import geometry as geo
from dashboard.scene.drawing.page import EMPTY, Markup, joined, note, rows, tag
from dashboard.scene.drawing.palette import GREY, ORANGE, SKY, number, rgb
from dashboard.scene.panels.base import DEG, Panel, Snapshot
from inertial.constants import MILLI_G
from inertial.layouts import catalogue
from inertial.layouts.catalogue import CUBE, LAYOUTS
from inertial.layouts.draw import noise_ellipsoid
from inertial.layouts.layout import Layout
from inertial.layouts.quality import UNKNOWNS, Quality, analyse
from inertial.rotation import from_matrix, rotate

HALF_SIDE = 0.05  # m
ARROW = 0.42  # half sides
BALL = 0.35  # half sides: radius of the noise of omega' of the published cube
REACH = 1.5  # half sides, how far a sensor can be dragged
MARKS = {"yes": "●", "weak": "◐", "no": "○"}


class LayoutBench(Panel):
    """One gizmo moves and turns the chosen axis, or all axes of its triad; figures follow."""

    title = "Layout"
    workspace = "calibrate"
    own_inputs = ("Start from", "Sensor", "Whole triad", "Save as TOML")
    own_scene = True

    def __init__(self, client: viser.ClientHandle, folder: viser.GuiFolderHandle) -> None:
        super().__init__(client, folder)
        self._cube = analyse(CUBE(HALF_SIDE))
        self._layout = self._cube.layout
        self._nodes: list[object] = []
        self._gizmo: viser.TransformControlsHandle | None = None
        self._dirty = True
        self._open = False
        self._table = None
        if client is not None:  # without a browser there are figures only
            self._controls()

    def _controls(self) -> None:
        gui = self.client.gui
        with self.folder:
            self._from = gui.add_dropdown(
                "Start from", tuple(LAYOUTS), initial_value="cube", order=0.1
            )
            self._axis = gui.add_dropdown("Sensor", self._layout.axis_names, order=0.2)
            self._triad = gui.add_checkbox(
                "Whole triad", True, order=0.3, hint="Move all axes that sit at one point"
            )
            self._save = gui.add_button(
                "Save as TOML", icon=viser.Icon.DOWNLOAD, color="gray", order=0.4
            )
        self._from.on_update(lambda _: self._take(catalogue.find(self._from.value, HALF_SIDE)))
        self._axis.on_update(lambda _: self._place_gizmo())
        self._triad.on_update(lambda _: self._place_gizmo())
        self._save.on_click(lambda _: self._download())

    @property
    def layout(self) -> Layout:
        """The arrangement as it stands."""
        return self._layout

    def update(self, s: Snapshot) -> None:
        self._open = True
        if self._dirty or not self._nodes:
            self._dirty = False
            q = analyse(self._layout)
            if self.client is not None:
                self._draw(q)
            self._table = self.html(figures(q, self._cube), self._table)
        if self._gizmo is None and self.client is not None:
            self._place_gizmo()

    def hide(self) -> None:
        """The page was left: the bench goes away."""
        self._open = False
        for node in [*self._nodes, *([self._gizmo] if self._gizmo else [])]:
            node.remove()
        self._nodes, self._gizmo = [], None

    def move(self, which: list[int], r: np.ndarray, theta: np.ndarray) -> None:
        """Axes `which` now sit at r (n, 3), m, and point along theta (n, 3)."""
        old = self._layout
        all_r, all_theta = old.r_b.copy(), old.theta_b.copy()
        all_r[which], all_theta[which] = r, theta / np.linalg.norm(theta, axis=1)[:, None]
        self._layout = Layout(
            "mine",
            all_r,
            all_theta,
            old.scale_m,
            old.axis_names,
            old.channels,
            old.gain,
            old.sensors,
            "drawn on the layout bench",
        )
        self._dirty = True

    def _take(self, layout: Layout) -> None:
        self._layout = layout
        self._dirty = True
        self._axis.options = layout.axis_names
        self._axis.value = layout.axis_names[0]
        if self._open:
            self._place_gizmo()

    def _chosen(self) -> list[int]:
        names = self._layout.axis_names
        i = names.index(self._axis.value) if self._axis.value in names else 0
        if not self._triad.value:
            return [i]
        near = np.linalg.norm(self._layout.r_b - self._layout.r_b[i], axis=1) < 1e-6
        return np.nonzero(near)[0].tolist()

    def _place_gizmo(self) -> None:
        """The gizmo at the chosen sensor; dragging it moves from where the sensor is now."""
        if self._gizmo is not None:
            self._gizmo.remove()
        which, scale = self._chosen(), self._layout.scale_m
        r0, theta0 = self._layout.r_b[which], self._layout.theta_b[which]
        limits = ((-REACH, REACH),) * 3
        gizmo = self._gizmo = self.client.scene.add_transform_controls(
            "/bench/gizmo", scale=0.55, position=tuple(r0[0] / scale), translation_limits=limits
        )

        @gizmo.on_update
        def _(_: object) -> None:
            r = np.tile(np.round(np.asarray(gizmo.position), 3) * scale, (len(which), 1))
            self.move(which, r, rotate(gizmo.wxyz, theta0))

    def _draw(self, q: Quality) -> None:
        scene, layout = self.client.scene, q.layout
        for node in self._nodes:
            node.remove()
        r = layout.r_b / layout.scale_m
        lines = np.stack([r, r + ARROW * layout.theta_b], axis=1).astype(np.float32)
        self._nodes = [
            scene.add_line_segments(
                "/bench/edges",
                geo.box_edges((1, 1, 1)),
                rgb(GREY),
                thickness=2.0,
                thickness_units="screen",
            ),
            scene.add_arrows(
                "/bench/axes",
                lines,
                rgb(SKY),
                shaft_radius=0.022,
                head_radius=0.055,
                head_length=0.13,
            ),
        ]
        self._nodes += [
            scene.add_label(
                f"/bench/names/{name}", name, position=tuple(tip), font_screen_scale=0.62
            )
            for name, tip in zip(layout.axis_names, r + 0.52 * layout.theta_b, strict=True)
        ]
        if np.isfinite(q.gdop):
            half, vectors = noise_ellipsoid(layout)
            if np.linalg.det(vectors) < 0.0:
                vectors[:, 0] = -vectors[:, 0]
            size = np.minimum(BALL * half / self._cube.sigma_least_squares[0], 3.0)
            self._nodes.append(
                scene.add_icosphere(
                    "/bench/noise",
                    radius=1.0,
                    color=rgb(ORANGE),
                    opacity=0.35,
                    scale=tuple(size.tolist()),
                    wxyz=from_matrix(vectors),
                    cast_shadow=False,
                )
            )

    def _download(self) -> None:
        text = catalogue.as_toml(self._layout)
        self.client.send_file_download("layout.toml", text.encode(), save_immediately=True)
        self.client.add_notification(
            "Layout saved",
            'Use it with [estimator.layout] file = "layout.toml"',
            auto_close_seconds=8.0,
        )


def symbols(name: str) -> Markup:
    """An unknown of least squares (w'x, px, wxwy) as it is written on paper."""
    parts = re.findall(r"(w'?|p)([xyz])", name)
    return joined(
        joined([letter.replace("w", "ω").replace("'", "′"), tag("sub", axis)])
        for letter, axis in parts
    )


def figures(q: Quality, cube: Quality) -> Markup:
    """The figures of a layout beside the cube's, as HTML."""

    def pair(a: float, b: float, digits: int, unit: str = "") -> Markup:
        beside = tag("small", f"(cube {number(b, digits)})")
        return joined([number(a, digits, unit), " ", beside])

    feedback = {(0, 0): "none", (1, 0): "in ω′", (0, 1): "in p", (1, 1): "in ω′ and p"}
    seen = joined(
        (
            tag("span", MARKS[g], " ", symbols(n), style="white-space:nowrap")
            for n, g in zip(UNKNOWNS, q.seen, strict=True)
        ),
        " ",
    )
    items = [
        ("κ", pair(q.kappa, cube.kappa, 3)),
        ("GDOP", pair(q.gdop, cube.gdop, 4)),
        (
            "feedback of least squares",
            feedback[q.feedback_alpha, q.feedback_force] if np.isfinite(q.gdop) else "–",
        ),
        ("rank", f"{q.rank} of 12, condition {number(q.condition, 1)}"),
        (
            "noise of p",
            pair(
                float(q.sigma_least_squares[3:].max()) / MILLI_G,
                float(cube.sigma_least_squares[3]) / MILLI_G,
                2,
                "mg",
            ),
        ),
        (
            "noise of ω′",
            pair(
                float(q.sigma_least_squares[:3].max()),
                float(cube.sigma_least_squares[0]),
                3,
                "rad/s²",
            ),
        ),
        ("ω by integration", pair(float(q.walk.max()) * DEG, float(cube.walk[0]) * DEG, 2, "°/√s")),
        (
            "ω at 180 °/s, filter",
            pair(float(q.sigma_rate.max()) * DEG, float(cube.sigma_rate.max()) * DEG, 2, "°/s"),
        ),
    ]
    mixed = note(f"Of the products only: {', '.join(q.mixtures)}") if q.mixtures else EMPTY
    legend = note(
        "● seen ◐ weak ○ not seen alone. Orange: how noise of ω′ spreads over its directions."
    )
    return rows(items) + tag("p", seen) + mixed + legend
