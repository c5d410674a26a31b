"""The raw axes: the four triads of the cube, or the accelerometer of a six-axis board."""

import numpy as np

from dashboard.data.device import Device
from dashboard.scene.drawing.drawn import Curve
from dashboard.scene.drawing.palette import AXES
from dashboard.scene.panels.base import Panel, Snapshot


class Axes(Panel):
    """Specific force along each sensor axis, as read, nominal scale. An axis marked stale by the
    board is greyed.
    """

    title = "Axes"
    workspace = "diagnose"

    @classmethod
    def missing(cls, device: Device) -> str:
        heard = device.get("imu") if device.is_vehicle else device.get("accel")
        return "" if heard else "no inertial samples have come from this board yet"

    def update(self, s: Snapshot) -> None:
        if s.device.is_vehicle:
            t, rows = s.rows("imu")
            for k, name in enumerate(("forward", "right", "down")):
                curve = Curve(f"f{'xyz'[k]}", AXES[k], t, rows["f_b"][:, k], stale=s.stale("imu"))
                self.show(name, f"Accelerometer, {name}", "m/s²", [curve], s, digits=2)
            return
        accel = s.device.get("accel")
        t, rows = s.rows("accel")
        mask = accel.message.stale_mask if accel else 0
        axes = accel.message.axes if accel else 12
        for first in range(0, axes, 3):
            curves = []
            for column in range(first, min(first + 3, axes)):
                k, stale = column - first, s.stale("accel") or bool(mask >> column & 1)
                label = f"a{first // 3 + 1}{k + 1}"
                f = rows["f"]
                y = f[:, column] if f.shape[1] > column else np.full(len(t), np.nan)
                curves.append(Curve(label, AXES[k], t, y, stale=stale))
            title = (
                f"Triad {first // 3 + 1}"
                if axes == 12
                else f"Axes {first + 1} to {first + len(curves)}"
            )
            self.show(f"triad{first}", title, "m/s²", curves, s, height=150, digits=2)
