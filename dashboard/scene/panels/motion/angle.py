"""The angle turned about z since the start; a vehicle's heading."""

import numpy as np

from dashboard.data.device import Device
from dashboard.scene.drawing.drawn import Curve
from dashboard.scene.drawing.palette import truth_colour
from dashboard.scene.panels.base import (
    DEG,
    NO_RATE,
    Panel,
    Snapshot,
    estimator_curve,
    from_zero,
)


class Angle(Panel):
    """Angles and, where the truth is known, how far they are off."""

    title = "Angle"
    workspace = "watch"

    @classmethod
    def missing(cls, device: Device) -> str:
        if device.is_vehicle:
            why = "no navigation filter runs for this device, so there is no heading"
            return "" if device.estimators("nav") else why
        return "" if device.estimators("rate") else NO_RATE

    def update(self, s: Snapshot) -> None:
        if s.device.is_vehicle:
            curves = []
            for name in s.device.estimators("nav"):
                t, rows = s.rows("nav", name)
                curves.append(estimator_curve(s, "nav", name, t, np.unwrap(rows["yaw"]) * DEG))
            self.show("yaw", "Heading from north, unwrapped", "°", curves, s, height=230)
            return
        true_t, true_rows = s.rows("truth")
        angles, errors = [], []
        for name in s.device.estimators("rate"):
            t, rows = s.rows("rate", name)
            angle, sight = rows["angle_z"] * DEG, rows["sight"][:, 2]
            angles.append(estimator_curve(s, "rate", name, t, angle, sight=sight))
            if len(true_t) > 1:
                true = np.interp(t, true_t, true_rows["angle_z"] * DEG)
                errors.append(estimator_curve(s, "rate", name, t, angle - true, sight=sight))
        if len(true_t):
            y = true_rows["angle_z"] * DEG
            angles.append(Curve("truth", truth_colour(s.dark), true_t, y, width=1.0))
        starts = (from_zero(s.device, name) for name in s.device.estimators("rate"))
        since = ", ".join(dict.fromkeys(start for start in starts if start))
        title = f"Angle about z, {since}" if since else "Angle about z"
        self.show("angle", title, "°", angles, s, height=230)
        if errors:
            self.show("error", "Angle error against truth", "°", errors, s, height=190)
