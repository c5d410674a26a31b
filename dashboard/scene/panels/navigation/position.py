"""Position in north, east, down with its 3-sigma band, and the numbers of a trajectory."""

import math

import numpy as np

from dashboard.data.device import Device
from dashboard.scene.drawing.drawn import Curve
from dashboard.scene.drawing.geometry import MODES
from dashboard.scene.drawing.page import Markup, note, rows
from dashboard.scene.drawing.palette import FIX, estimator_title, number
from dashboard.scene.panels.base import DEG, Panel, Snapshot, estimator_curve
from logs.figures.sight import word
from messages.contract import gyrofree_pb2 as pb
from messages.contract import rates

NAMES = ("North", "East", "Down")


class Position(Panel):
    """A vehicle: fused solution over the fixes. The cube: unaided inertial navigation from the
    start.
    """

    title = "Position"
    workspace = "navigate"
    _table = None

    @classmethod
    def missing(cls, device: Device) -> str:
        if device.navigates or any(
            len(device.get("rate", name).message.p_n_m) for name in device.estimators("rate")
        ):
            return ""
        return "no estimator says where this device is"

    def update(self, s: Snapshot) -> None:
        vehicle = s.device.navigates
        self._table = self.html(self._numbers(s) if vehicle else _cube_note(s), self._table)
        for k, axis in enumerate(NAMES):
            curves = []
            for name in s.device.estimators("nav" if vehicle else "rate"):
                if vehicle:
                    t, r = s.rows("nav", name)
                    half = 3 * r["sigma_p_n"][:, k]
                    curves.append(estimator_curve(s, "nav", name, t, r["p_n"][:, k], half))
                else:
                    t, r = s.rows("rate", name)
                    sight = r["sight"].max(axis=1)  # the way is no better known than the turns
                    curves.append(estimator_curve(s, "rate", name, t, r["p_n"][:, k], sight=sight))
            if vehicle and s.device.get("gnss"):
                t, r = s.rows("gnss")
                curves.append(
                    Curve("GNSS", FIX, t, r["p_n"][:, k], stale=s.stale("gnss"), dash=True)
                )
            self.show(axis, axis, "m", curves, s, height=150, digits=2)

    @staticmethod
    def _numbers(s: Snapshot) -> Markup:
        names = s.device.estimators("nav")
        if not names:
            return rows([("solution", "none yet")], stale=True)
        m = s.device.get("nav", names[0]).message
        v = np.asarray(m.v_n_mps) if len(m.v_n_mps) == 3 else np.full(3, np.nan)
        sigma = np.asarray(m.sigma[6:9]) if len(m.sigma) >= 9 else np.full(3, np.nan)
        t, r = s.rows("nav", names[0])
        travelled = (
            float(np.sum(np.linalg.norm(np.diff(r["p_n"][:, :2], axis=0), axis=1)))
            if len(t) > 1
            else 0.0
        )
        course = float(np.degrees(np.arctan2(v[1], v[0]))) % 360
        items = [
            ("mode", MODES.get(m.mode, "unknown")),
            ("alignment", m.alignment or "–"),
            (
                "latitude, longitude",
                f"{number(m.latitude_deg, 7, '°')}, {number(m.longitude_deg, 7, '°')}",
            ),
            ("height", height_text(m)),
            ("speed over ground", number(float(np.hypot(v[0], v[1])) * 3.6, 1, "km/h")),
            ("course", number(course, 1, "°") if np.hypot(v[0], v[1]) > 0.5 else "standing"),
            ("1σ north, east, down", " · ".join(number(float(x), 2) for x in sigma) + " m"),
            ("1σ heading", number(float(m.sigma[2]) * DEG if len(m.sigma) > 2 else None, 2, "°")),
            ("last fix used", f"{number(m.fix_age_s, 1, 's')} ago"),
            ("way in the window", number(travelled, 0, "m")),
        ]
        return rows(items, s.stale("nav", names[0]))


def height_text(m: pb.NavSolution | pb.GnssFix) -> str:
    """The height and what it counts from, or why there is none."""
    if not math.isfinite(m.height_m):
        return "– (the receiver gives no height)"
    if m.height_reference == pb.HEIGHT_REFERENCE_SEA_LEVEL:
        return f"{number(m.height_m, 2, 'm')} above sea level (no geoid: ± 110 m)"
    return number(m.height_m, 2, "m")


def _cube_note(s: Snapshot) -> Markup:
    names = s.device.estimators("rate")
    items = []
    for name in names:
        m = rates.row(s.device.get("rate", name).message, -1)
        if len(m.p_n_m) == 3:
            far = number(float(np.linalg.norm(m.p_n_m)), 1, "m")
            items.append(
                (f"distance, {estimator_title(name)}", word(max(m.sight, default=0)) or far)
            )
    text = "Inertial navigation from the start without any aid: it drifts by nature."
    return note(text) + rows(items)
