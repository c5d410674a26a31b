"""Angular rate: every estimator with its 3-sigma band over the tachometer; a vehicle's gyroscope."""

from dashboard.scene.chart import Curve
from dashboard.scene.palette import AXES, REFERENCE, truth_colour
from dashboard.scene.panels.base import DEG, Panel, Snapshot, estimator_curve
from dashboard.scene.store import RATE_OMEGA, RATE_SIGMA, TRUTH_OMEGA


class Rates(Panel):
    """omega_z with the tachometer first, because it is what the table turns about; then omega_x and omega_y."""

    title = "Rates"

    def update(self, s: Snapshot) -> None:
        if s.device.is_vehicle:
            t, rows = s.rows("imu")
            curves = [
                Curve(f"ω{axis}", AXES[k], t, rows[:, 3 + k] * DEG, stale=s.stale("imu"))
                for k, axis in enumerate("xyz")
            ]
            self.show("imu", "Measured rate, body", "°/s", curves, s, height=230)
            return
        for k, axis in ((2, "z"), (0, "x"), (1, "y")):
            curves = self._estimates(s, k)
            if k == 2 and s.device.get("tacho"):
                t, rows = s.rows("tacho")
                known = s.device.get("tacho").message.direction_known
                label = "tachometer" if known else "tachometer |ω|"
                curves.append(Curve(label, REFERENCE, t, rows[:, 0] * DEG, stale=s.stale("tacho"), dash=True))
            if s.device.get("truth"):
                t, rows = s.rows("truth")
                line = Curve("truth", truth_colour(s.dark), t, rows[:, TRUTH_OMEGA][:, k] * DEG, width=1.0)
                curves.append(line)
            self.show(f"omega{axis}", f"ω<sub>{axis}</sub> with 3σ", "°/s", curves, s, height=215 if k == 2 else 150)

    @staticmethod
    def _estimates(s: Snapshot, k: int) -> list[Curve]:
        curves = []
        for name in s.device.estimators("rate"):
            t, rows = s.rows("rate", name)
            sigma = rows[:, RATE_SIGMA][:, k] * DEG
            curves.append(estimator_curve(s, "rate", name, t, rows[:, RATE_OMEGA][:, k] * DEG, 3 * sigma))
        return curves
