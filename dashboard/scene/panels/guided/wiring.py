"""Guided detection of axes and signs: which way to turn the board next, what was found. Orders are
for operators.
"""

import numpy as np
import viser
from scipy.spatial.transform import Rotation

from dashboard.data.device import Device
from dashboard.scene.drawing.page import EMPTY, Markup, joined, note, rows, tag
from dashboard.scene.drawing.palette import AXES, GREEN, GREY, VERMILLION, number, rgba
from dashboard.scene.panels.base import DEG, Snapshot
from dashboard.scene.panels.guided.guided import Guided, guidance, head, silent
from dashboard.scene.panels.guided.solid import Camera
from messages.contract import gyrofree_pb2 as pb

ACTION = pb.EstimatorCommand
STATUS = pb.WiringStatus
STATES = {
    STATUS.STATE_IDLE: "not running",
    STATUS.STATE_WAITING: "waiting for you",
    STATUS.STATE_MOVING: "it moves",
    STATUS.STATE_FOUND: "found",
    STATUS.STATE_SAVED: "saved and in use",
}
BUTTONS = (  # label, order, icon, colour
    (
        "Find axes and signs",
        ACTION.ACTION_WIRING_START,
        viser.Icon.ROTATE_RECTANGLE,
        (30, 110, 165),
    ),
    ("Save map and use it", ACTION.ACTION_WIRING_SAVE, viser.Icon.DEVICE_FLOPPY, (0, 120, 90)),
    ("Cancel", ACTION.ACTION_WIRING_CANCEL, viser.Icon.X, "gray"),
    ("Use the board's own axes again", ACTION.ACTION_USE_MAP, viser.Icon.ARROW_BACK_UP, "gray"),
)
CAMERA = np.array(
    [-0.78, 0.42, -0.47]
)  # from behind, right, above; n north-east-down, the nose points north
HALF = np.array([1.15, 0.75, 0.12])  # of the board drawn
QUARTER = np.pi / 2.0
TURNS = {  # rotation vector of each pose against level, b
    STATUS.POSE_LEVEL: (0.0, 0.0, 0.0),
    STATUS.POSE_NOSE_UP: (0.0, QUARTER, 0.0),
    STATUS.POSE_RIGHT_DOWN: (QUARTER, 0.0, 0.0),
    STATUS.POSE_TURNED_RIGHT: (0.0, 0.0, QUARTER),
}


class Wiring(Guided):
    """Status, two pictures (level, and the pose wanted) and four buttons; the estimator of the
    device does the rest.
    """

    title = "Wiring"
    workspace = "calibrate"
    buttons = BUTTONS

    @classmethod
    def missing(cls, device: Device) -> str:
        if device.get("imu") is not None or device.get("adc") is not None:
            return ""
        return "for boards with accelerometers and gyroscopes, of any wiring"

    def update(self, s: Snapshot) -> None:
        self._device = s.device.name
        if s.device.get("imu") is None and s.device.get("adc") is None:
            self._not_here("For boards with accelerometers and gyroscopes, of any wiring.")
            return
        latest = s.device.get("wiring")
        m = latest.message if latest is not None else STATUS()
        running = m.state in (STATUS.STATE_WAITING, STATUS.STATE_MOVING, STATUS.STATE_FOUND)
        self._status = self.html(content(m, silent(s, "wiring", running), s.dark), self._status)
        wanted = {ACTION.ACTION_WIRING_CANCEL} if running else {ACTION.ACTION_WIRING_START}
        wanted |= {ACTION.ACTION_WIRING_SAVE} if running and m.complete else set()
        wanted |= {ACTION.ACTION_USE_MAP} if m.map and not running else set()
        self._show(wanted)

    def _order(self, action: int) -> None:
        self.order_estimator("Wiring", pb.EstimatorCommand(action=action, device=self._device))


def content(m: pb.WiringStatus, gone: bool, dark: bool) -> Markup:
    """The panel's HTML."""
    used = [("axis map in use", m.map if m.map else "none: the board's own axes")]
    if m.state == STATUS.STATE_IDLE:
        text = (
            "Which input is which axis, and with which sign: tip the board nose up, right side down"
            " and turn it to the right, each time from level; this page says when. What is found"
            " can be saved and is used at once."
        )
        return note(text) + rows(used)
    first = head(
        STATES.get(m.state, ""),
        f"{len(m.turns)} turns · {_found(m)} of {len(m.inputs)} inputs known",
        gone,
    )
    drawing = (
        picture(m.pose, dark) if m.state in (STATUS.STATE_WAITING, STATUS.STATE_MOVING) else EMPTY
    )
    saved = m.state == STATUS.STATE_SAVED
    todo = EMPTY if saved else guidance(m.instruction, drawing, m.progress, m.message)
    return first + todo + _inputs(m, gone) + _turns(m) + rows(used)


def _found(m: pb.WiringStatus) -> int:
    return sum(bool(one.axis) for one in m.inputs)


def _inputs(m: pb.WiringStatus, stale: bool) -> Markup:
    """What every input reads now and what it was found to be."""
    items = []
    for one in m.inputs:
        digits = 3 if one.unit == "V" else 1
        found: object = tag("span", "unused", style="opacity:.6") if one.unused else "–"
        if one.axis:
            axis = "xyz".find(one.axis[-1])  # -1 is grey: an estimator of another version
            mark = tag("b", "■", style=f"color:{(*AXES, GREY)[axis]}")
            found = joined([mark, " −" if one.inverted else " +", f" {one.axis}"])
        reading = number(one.reading, digits, one.unit)
        items.append((one.name, joined([reading, "\u00a0 ", found])))
    return rows(items, stale)


def _turns(m: pb.WiringStatus) -> Markup:
    """The same angle by both sensors: a wrong sensitivity is seen here."""
    items = []
    for turn in m.turns:
        by_rate, by_force = (
            number(turn.by_rate_rad * DEG, 1, "°"),
            number(turn.by_force_rad * DEG, 1, "°"),
        )
        off = (
            turn.by_force_rad == turn.by_force_rad
            and abs(turn.by_rate_rad / (turn.by_force_rad or 1.0) - 1.0) > 0.15
        )
        mark = tag("b", " ≠ ", style=f"color:{VERMILLION}") if off else " · "
        both = joined([by_rate, mark, by_force])
        items.append((f"turn about {turn.about}: gyro · accelerometer", both))
    return rows(items) if items else EMPTY


def picture(pose: int, dark: bool) -> Markup:
    """The board level, an arrow, and as it should lie, as SVG; only level where that is wanted."""
    line = "#e8e8e8" if dark else "#333333"
    if pose == STATUS.POSE_LEVEL:
        inner = _board(np.eye(3), 170.0, line)
    else:
        way = "M152,82 H184 M174,72 L186,82 L174,92"
        ink = {"stroke": line, "stroke_width": 3, "stroke_linecap": "round"}
        arrow = tag("path", d=way, fill="none", **ink)
        inner = (
            _board(np.eye(3), 78.0, line)
            + arrow
            + _board(Rotation.from_rotvec(TURNS[pose]).as_matrix(), 264.0, line)
        )
    return tag(
        "svg",
        inner,
        class_="gf-pose",
        viewBox="0 0 352 160",
        width="100%",
        role="img",
        aria_label="the board as it should lie",
        style="display:block;margin:.2em auto;max-width:420px",
    )


def _board(R: np.ndarray, middle: float, line: str) -> Markup:
    """A flat board with its nose marked, at the horizontal place `middle` of the picture; R turns b
    into n.
    """
    camera = Camera.at(CAMERA, np.array([0.0, 0.0, -1.0]), (middle, 84.0), 46.0)
    parts = []
    for face in camera.faces(R, HALF):
        shade = {(2, -1.0): rgba(GREEN, 0.85), (2, 1.0): "rgba(128,128,128,.85)"}.get(
            (face.axis, face.sign), rgba(GREEN, 0.5)
        )
        edge = {"stroke": line, "stroke_width": 1.5, "stroke_linejoin": "round"}
        parts.append(tag("polygon", points=face.points, fill=shade, **edge))
    screen = camera.screen
    nose = [screen(R @ np.array(p)) for p in ((1.6, 0.0, 0.0), (1.2, 0.28, 0.0), (1.2, -0.28, 0.0))]
    corners = " ".join(f"{u:.1f},{v:.1f}" for u, v in nose)
    parts.append(tag("polygon", points=corners, fill=AXES[0]))
    u, v = screen(R @ np.array([1.75, 0.0, 0.0]))
    word = {"text_anchor": "middle", "font_size": 12, "fill": line}
    parts.append(tag("text", "nose", x=f"{u:.0f}", y=f"{v:.0f}", **word))
    return joined(parts)
