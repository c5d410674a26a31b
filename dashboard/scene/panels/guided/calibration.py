"""The guided calibration: which pose next, is it being taken, is it good enough, save. Orders are
for operators.
"""

import numpy as np
import viser

from dashboard.data.device import Device
from dashboard.scene.drawing.page import EMPTY, Markup, joined, note, rows, tag
from dashboard.scene.drawing.palette import AXES, GREEN, number, rgba
from dashboard.scene.panels.base import Snapshot
from dashboard.scene.panels.guided.guided import Guided, guidance, head, silent
from dashboard.scene.panels.guided.solid import Camera
from inertial.constants import MILLI_G
from messages.contract import gyrofree_pb2 as pb
from messages.text import counted

CAMERA = np.array([0.80, -0.52, 0.50])  # where the picture is seen from, in the frame whose z is up
ACTION = pb.EstimatorCommand
STATE = pb.CalibrationStatus
STATES = {
    STATE.STATE_IDLE: "not running",
    STATE.STATE_WAITING: "waiting for the pose",
    STATE.STATE_TAKING: "taking it",
    STATE.STATE_TURNING: "table turning",
    STATE.STATE_FITTED: "fitted",
    STATE.STATE_SAVED: "saved",
    STATE.STATE_FAILED: "failed",
}
BUTTONS = (  # label, order, icon, colour
    ("Start calibration", ACTION.ACTION_CALIBRATE_START, viser.Icon.PLAYER_PLAY, (30, 110, 165)),
    ("Fit now", ACTION.ACTION_CALIBRATE_FIT, viser.Icon.MATH_FUNCTION, "gray"),
    ("Save card and use it", ACTION.ACTION_CALIBRATE_SAVE, viser.Icon.DEVICE_FLOPPY, (0, 120, 90)),
    ("Cancel", ACTION.ACTION_CALIBRATE_CANCEL, viser.Icon.X, "gray"),
)


class Calibration(Guided):
    """Status, picture and four buttons; what they do is done by the estimator of the device."""

    title = "Calibrate"
    workspace = "calibrate"
    buttons = BUTTONS

    @classmethod
    def missing(cls, device: Device) -> str:
        if device.is_vehicle:
            return "boards of accelerometers alone are calibrated here"
        return "" if device.get("accel") else "no samples have come from this board yet"

    def update(self, s: Snapshot) -> None:
        self._device = s.device.name
        if s.device.is_vehicle:
            self._not_here("Boards of accelerometers are calibrated here.")
            return
        latest = s.device.get("calibration")
        m = latest.message if latest is not None else STATE()
        running = m.state not in (STATE.STATE_IDLE, STATE.STATE_SAVED)
        gone = silent(s, "calibration", running)
        self._status = self.html(content(m, gone, s.dark, self._card(s)), self._status)
        if not running:
            self._show({ACTION.ACTION_CALIBRATE_START})
        elif len(m.poses) < 4:
            self._show({ACTION.ACTION_CALIBRATE_CANCEL})
        else:
            self._show(
                {
                    ACTION.ACTION_CALIBRATE_FIT,
                    ACTION.ACTION_CALIBRATE_SAVE,
                    ACTION.ACTION_CALIBRATE_CANCEL,
                }
            )

    @staticmethod
    def _card(s: Snapshot) -> str:
        """Card that the estimates name."""
        for name in s.device.estimators("rate"):
            return s.device.get("rate", name).message.calibration
        return ""

    def _order(self, action: int) -> None:
        command = pb.EstimatorCommand(action=action, device=self._device)
        self.order_estimator("Calibration", command)


def content(m: pb.CalibrationStatus, gone: bool, dark: bool, card: str) -> Markup:
    """The panel's HTML."""
    items = [("card in use", card if card else "none: nominal scale and positions")]
    if m.state == STATE.STATE_IDLE:
        text = (
            "Set the body down in nine and more poses, let go each time; the page says which one"
            " next."
        )
        return note(text) + rows(items)
    if m.bias_sigma_mps2:
        items += [
            ("bias known to", number(max(m.bias_sigma_mps2) / MILLI_G, 2, "mg")),
            ("scale known to", number(max(m.scale_sigma) * 100, 3, "%")),
            ("residual of the fit", number(m.residual_mps2 / MILLI_G, 2, "mg")),
        ]
    if m.card:
        items.append(("saved as", m.card))
    good = (
        tag("b", "✓ good enough", style=f"color:{GREEN}")
        if m.good_enough
        else "not yet good enough"
    )
    first = head(
        STATES.get(m.state, ""), joined([f"{counted(len(m.poses), 'pose')} · ", good]), gone
    )
    wanted = np.array(m.next_up_b) if len(m.next_up_b) == 3 else None
    shown = wanted if m.state in (STATE.STATE_WAITING, STATE.STATE_FITTED) else None
    if m.state == STATE.STATE_TAKING and wanted is not None:
        shown = wanted
    drawing = picture(shown, dark) if shown is not None else EMPTY
    return first + guidance(m.instruction, drawing, m.progress, m.message) + rows(items, stale=gone)


def upright(up_b: np.ndarray) -> np.ndarray:
    """Rotation (3, 3) by the shortest way that turns up_b to z."""
    u = up_b / np.linalg.norm(up_b)
    if u[2] < -0.999999:
        return np.diag([1.0, -1.0, -1.0])
    axis = np.cross(u, [0.0, 0.0, 1.0])
    K = np.array([[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]])
    return np.eye(3) + K + K @ K / (1.0 + u[2])


def facing(up_b: np.ndarray, camera: np.ndarray) -> np.ndarray:
    """As upright(), turned about the vertical until as much as can be is seen of the faces that
    point up.
    """
    faces = [np.sign(up_b[k]) * np.eye(3)[k] for k in range(3) if abs(up_b[k]) > 0.3]
    first = upright(up_b)

    def turned(k: int) -> np.ndarray:
        c, s = np.cos(k * np.pi / 12.0), np.sin(k * np.pi / 12.0)
        return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ first

    def seen(k: int) -> float:
        return round(sum(np.sqrt(max(float(turned(k) @ face @ camera), 0.0)) for face in faces), 6)

    return turned(max(range(24), key=seen))


def picture(up_b: np.ndarray, dark: bool) -> Markup:
    """The cube as it should stand, an arrow up, as SVG: visible faces with the names of their
    axes.
    """
    camera = Camera.at(CAMERA, np.array([0.0, 0.0, 1.0]), (110.0, 112.0), 44.0)
    R = facing(np.asarray(up_b, dtype=float), camera.towards)
    line = "#e8e8e8" if dark else "#333333"
    lowest = min(
        float((R @ np.array([x, y, z]))[2]) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)
    )
    x, y = camera.screen(np.array([0.0, 0.0, lowest]))
    shadow = {"rx": 92, "ry": 30, "fill": "rgba(128,128,128,.22)"}
    parts = [tag("ellipse", cx=f"{x:.0f}", cy=f"{y:.0f}", **shadow)]
    edge = {"stroke": line, "stroke_width": 1.5, "stroke_linejoin": "round"}
    word = {"text_anchor": "middle", "font_size": 16, "font_weight": 700, "fill": "#000"}
    for face in camera.faces(R, np.ones(3)):
        u, v = face.middle
        name = f"{'+' if face.sign > 0 else '−'}{'xyz'[face.axis]}"
        parts += [
            tag("polygon", points=face.points, fill=rgba(AXES[face.axis], 0.85), **edge),
            tag("text", name, x=f"{u:.0f}", y=f"{v + 5:.0f}", **word),
        ]
    x, tip = 206.0, 40.0
    way = f"M{x},150 V{tip + 12} M{x - 8},{tip + 14} L{x},{tip} L{x + 8},{tip + 14}"
    parts += [
        tag("path", d=way, fill="none", stroke=line, stroke_width=4, stroke_linecap="round"),
        tag("text", "up", x=x, y=172, text_anchor="middle", font_size=13, fill=line),
    ]
    style = "display:block;margin:.2em auto"
    box = {"viewBox": "0 0 230 210", "width": 230, "height": 210}
    return tag("svg", *parts, class_="gf-pose", role="img", style=style, **box)
