"""What the scene is built of: ground, table, cube with its twelve axes, vehicle.

Each function adds its nodes to a scene and puts the handles of those that change later into
`nodes`, by their names.
"""

import numpy as np
from viser import SceneApi

from dashboard.scene.drawing import geometry as geo
from dashboard.scene.drawing.palette import GREY, ORANGE, YELLOW, estimator_title, rgb

Nodes = dict[str, object]  # handles by name

GROUND_BELOW = (
    1.0  # m below a vehicle, so that fixes scattered in height are not cut by the grid's lines
)
BOARD = (1.5, 1.0, 0.12)  # half a tilt board, drawn as large as the cube
LABEL_CORNERS = (
    (1, 1, 1.1),
    (-1, -1, 1.35),
    (1, -1, 1.6),
    (-1, 1, 1.85),
)  # apart, so that names do not hide another


def ground(scene: SceneApi, nodes: Nodes, vehicle: bool, dark: bool) -> None:
    """The grid: 10 m cells below a vehicle, half-side cells below the cube's table."""
    size = 10.0 if vehicle else 1.0
    nodes["/world/ground"] = scene.add_grid(
        "/world/ground",
        infinite_grid=True,
        cell_size=size,
        section_size=5 * size,
        cell_color=(48, 50, 54) if dark else (222, 222, 222),
        section_color=(74, 78, 84) if dark else (196, 196, 196),
        fade_distance=600.0 if vehicle else 26.0,
        fade_strength=1.5,
        shadow_opacity=0.0,
        position=(0.0, 0.0, GROUND_BELOW if vehicle else 1.42),
    )


def table(scene: SceneApi, nodes: Nodes, dark: bool) -> None:
    """The disc below the cube, with marks at its rim so that its turning is seen; in body axes,
    half sides.
    """
    nodes["/world/table"] = scene.add_frame("/world/table", show_axes=False)
    vertices, faces = geo.disc(2.3, 0.14, 96)
    scene.add_mesh_simple(
        "/world/table/disc",
        vertices,
        faces,
        color=(52, 60, 70) if dark else (205, 210, 216),
        flat_shading=True,
        side="double",
        cast_shadow=False,
        receive_shadow=False,
        position=(0.0, 0.0, -1.12),
    )
    angle = np.radians(np.arange(0, 360, 15))
    inner = np.where(np.arange(len(angle)) % 6 == 0, 1.85, 2.1)
    rim = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(len(angle))])
    marks = np.stack([rim * inner[:, None], rim * 2.26], axis=1) + [0, 0, -1.11]
    scene.add_line_segments(
        "/world/table/marks",
        marks.astype(np.float32),
        rgb(GREY),
        thickness=2.0,
        thickness_units="screen",
    )


def cube(scene: SceneApi, nodes: Nodes, body: str, colour: str, name: str, index: int) -> None:
    """One estimator's cube below the frame `body`; number 0 is the main one and carries axes and
    rate arrow.
    """
    main = index == 0
    scene.add_line_segments(
        f"{body}/edges",
        geo.box_edges((1, 1, 1)),
        rgb(colour),
        thickness=3.0,
        thickness_units="screen",
    )
    if main:
        scene.add_box(
            f"{body}/faces",
            color=rgb(colour),
            dimensions=(2.0, 2.0, 2.0),
            opacity=0.3,
            side="double",
            cast_shadow=False,
            receive_shadow=False,
        )
    nodes[f"{body}/label"] = scene.add_label(
        f"{body}/label",
        estimator_title(name),
        position=LABEL_CORNERS[index % len(LABEL_CORNERS)],
        anchor="bottom-center",
        font_screen_scale=0.8,
    )
    if main:
        _rate_arrow(scene, nodes, body)


def board(scene: SceneApi, nodes: Nodes, body: str, colour: str, name: str, index: int) -> None:
    """One filter's tilt board below the frame `body`, forward-right-down; number 0 is filled and
    shows its nose.
    """
    scene.add_line_segments(
        f"{body}/edges", geo.box_edges(BOARD), rgb(colour), thickness=3.0, thickness_units="screen"
    )
    if index == 0:
        scene.add_box(
            f"{body}/faces",
            color=rgb(colour),
            dimensions=tuple(2.0 * half for half in BOARD),
            opacity=0.5,
            cast_shadow=False,
            receive_shadow=False,
        )
        scene.add_arrows(
            f"{body}/nose",
            np.array([[[BOARD[0], 0, 0], [BOARD[0] + 0.7, 0, 0]]], dtype=np.float32),
            rgb(ORANGE),
            shaft_radius=0.05,
            head_radius=0.13,
            head_length=0.3,
        )
    x, y, z = LABEL_CORNERS[index % len(LABEL_CORNERS)]
    nodes[f"{body}/label"] = scene.add_label(
        f"{body}/label",
        estimator_title(name),
        position=(x * BOARD[0], y * BOARD[1], -z * 0.6),
        anchor="bottom-center",
        font_screen_scale=0.8,
    )


def _rate_arrow(scene: SceneApi, nodes: Nodes, body: str) -> None:
    """The arrow of omega; where it points is set with each update."""
    path = f"{body}/rate"
    points = np.array([[[0, 0, 0], [0, 0, 0.01]]], dtype=np.float32)
    nodes[path] = scene.add_arrows(
        path, points, rgb(ORANGE), shaft_radius=0.045, head_radius=0.11, head_length=0.24
    )
    nodes[f"{path}_label"] = scene.add_label(
        f"{path}_label", "", anchor="center-left", font_screen_scale=0.9
    )


def vehicle(scene: SceneApi, nodes: Nodes, body: str, colour: str, name: str, index: int) -> None:
    """A car, its heading and its estimator's name below the frame `body`, forward-right-down, m;
    number 0 is filled.
    """
    scene.add_line_segments(
        f"{body}/edges", geo.vehicle_edges(), rgb(colour), thickness=3.0, thickness_units="screen"
    )
    if index == 0:
        scene.add_box(
            f"{body}/faces",
            color=rgb(colour),
            dimensions=(4.4, 1.8, 0.6),
            position=(0.0, 0.0, -0.6),
            opacity=0.9,
            cast_shadow=False,
            receive_shadow=False,
        )
    nodes[f"{body}/heading"] = scene.add_arrows(
        f"{body}/heading",
        np.array([[[2.2, 0, -0.6], [12.0, 0, -0.6]]], dtype=np.float32),
        rgb(YELLOW),  # not the fixes' colour
        shaft_radius=0.35,
        head_radius=1.1,
        head_length=3.0,
    )
    nodes[f"{body}/label"] = scene.add_label(
        f"{body}/label",
        estimator_title(name),
        position=(0.0, 0.0, -5.0),
        anchor="bottom-center",
        font_screen_scale=0.8,
    )
