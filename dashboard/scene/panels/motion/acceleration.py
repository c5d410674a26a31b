"""Specific force of the body's centre in body axes, from the field of all sensors."""

from dashboard.data.device import Device
from dashboard.scene.drawing.drawn import Curve
from dashboard.scene.drawing.page import joined, sub
from dashboard.scene.drawing.palette import AXES, truth_colour
from dashboard.scene.panels.base import NO_RATE, Panel, Snapshot, estimator_curve


class Acceleration(Panel):
    """One chart per body axis; a vehicle shows its accelerometer's three axes together."""

    title = "Accel."
    workspace = "watch"

    @classmethod
    def missing(cls, device: Device) -> str:
        if device.is_vehicle:
            return "" if device.get("imu") else "no inertial samples have come from this board yet"
        return "" if device.estimators("rate") else NO_RATE

    def update(self, s: Snapshot) -> None:
        if s.device.is_vehicle:
            t, rows = s.rows("imu")
            curves = [
                Curve(f"f{axis}", AXES[k], t, rows["f_b"][:, k], stale=s.stale("imu"))
                for k, axis in enumerate("xyz")
            ]
            self.show("imu", "Specific force, body", "m/s²", curves, s, height=230, digits=2)
            return
        for k, axis in enumerate("xyz"):
            curves = []
            for name in s.device.estimators("rate"):
                t, rows = s.rows("rate", name)
                curves.append(estimator_curve(s, "rate", name, t, rows["f_b"][:, k]))
            if s.device.get("truth"):
                t, rows = s.rows("truth")
                curves.append(Curve("truth", truth_colour(s.dark), t, rows["f_b"][:, k], width=1.0))
            self.show(
                axis,
                joined(["Specific force ", sub("f", axis), " of the centre"]),
                "m/s²",
                curves,
                s,
                digits=2,
            )
