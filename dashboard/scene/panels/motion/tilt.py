"""Tilt of a six-axis board: an artificial horizon, and every filter's roll and pitch side by
side.
"""

from dashboard.data.device import Device
from dashboard.data.pose import roll_pitch
from dashboard.scene.drawing.horizon import between, horizon_svg
from dashboard.scene.drawing.page import Markup, note, rows
from dashboard.scene.drawing.palette import estimator_title, number
from dashboard.scene.panels.base import DEG, Panel, Snapshot, estimator_curve

BEST = "vqf"  # drawn as the horizon where it runs


class Tilt(Panel):
    """A fixed-weight filter beside a modern one: what the weight costs is seen, not told."""

    title = "Tilt"
    workspace = "watch"
    _top = None

    @classmethod
    def missing(cls, device: Device) -> str:
        if device.estimators("attitude"):
            return ""
        if device.is_vehicle:
            return "no tilt filter runs for this board: [estimator] attitude names them"
        return "tilt needs a board with accelerometers and gyroscopes; this one has no gyroscopes"

    def update(self, s: Snapshot) -> None:
        names = sorted(s.device.estimators("attitude"), key=lambda name: (name != BEST, name))
        self._top = self.html(self._head(s, names), self._top)
        for column, title in (("roll", "Roll: right side down"), ("pitch", "Pitch: nose up")):
            curves = []
            for name in names:
                t, r = s.rows("attitude", name)
                if len(t):
                    curves.append(estimator_curve(s, "attitude", name, t, r[column] * DEG))
            if curves:
                self.show(column, title, "°", curves, s, height=190, digits=1)

    @staticmethod
    def _head(s: Snapshot, names: list[str]) -> Markup:
        if not names:
            return note("No tilt yet: it needs a board with accelerometers and gyroscopes.")
        latest = {name: s.device.get("attitude", name).message for name in names}
        first = latest[names[0]]
        items = []
        for name, m in latest.items():
            roll, pitch = roll_pitch(m.q_nb)
            items.append(
                (
                    f"{estimator_title(name)}: roll, pitch",
                    f"{number(roll * DEG, 1, '°')}, {number(pitch * DEG, 1, '°')}",
                )
            )
            if name != names[0]:
                items.append(
                    ("\u00a0 off the first by", number(between(m.q_nb, first.q_nb) * DEG, 2, "°"))
                )
        bias = first.bias_omega_b_radps
        if len(bias) == 3:
            items.append(
                ("gyro bias x, y, z", " · ".join(number(b * DEG, 2) for b in bias) + " °/s")
            )
        items.append(("at rest", "yes" if first.resting else "no"))
        stale = s.stale("attitude", names[0])
        return horizon_svg(*roll_pitch(first.q_nb), stale) + rows(items, stale)
