"""The moving horizon: how many fixes it looks back, and which memberships of the fuzzy sets decided
that.
"""

import numpy as np

from dashboard.data.device import Device
from dashboard.scene.drawing.drawn import Curve
from dashboard.scene.drawing.page import EMPTY, Markup, note, rows, tag
from dashboard.scene.drawing.palette import AXES, estimator_title, number
from dashboard.scene.panels.base import Panel, Snapshot, estimator_curve
from inertial.navigation.fuzzy import MEMBERSHIPS, RULES, membership

WIDTH, HEIGHT = 170, 90
UNITS = ("m/s²", "rad/s")


def sets_svg(points: tuple[float, float, float], value: float, unit: str) -> Markup:
    """The three sets over their input, and where the input is now."""
    span = points[2] - points[0]
    low, high = points[0] - 0.25 * span, points[2] + 0.25 * span
    xs = np.array([low, *points, high])
    lines = ["", "", ""]
    for x in xs:
        out = membership(float(x), points)
        for k in range(3):
            y = HEIGHT - 18 - out[k] * (HEIGHT - 26)
            lines[k] += f"{(x - low) / (high - low) * WIDTH:.1f},{y:.1f} "
    parts = [
        tag("polyline", points=lines[k], fill="none", stroke=AXES[k], stroke_width=1.6)
        for k in range(3)
    ]
    x = float(np.clip((value - low) / (high - low), 0.0, 1.0)) * WIDTH
    parts += [
        tag("path", d=f"M{x:.1f} 4V{HEIGHT - 18}", stroke="#8C8C8C", stroke_width=2),
        tag("text", number(value, 2, unit), x=4, y=HEIGHT - 4, font_size=11, fill="#8C8C8C"),
    ]
    size = f"0 0 {WIDTH} {HEIGHT}"
    return tag("svg", *parts, viewBox=size, width="48%", role="img", aria_label="fuzzy sets")


class Horizon(Panel):
    """N over time; the sets as they are, with the input on them."""

    title = "Horizon"
    workspace = "navigate"
    _top = None

    @classmethod
    def missing(cls, device: Device) -> str:
        names = device.estimators("nav")
        if any(device.get("nav", name).message.HasField("horizon") for name in names):
            return ""
        return "no moving horizon runs: add fpe-fuzzy or mhe-robust to [estimator] navigators"

    def update(self, s: Snapshot) -> None:
        names = [
            n
            for n in s.device.estimators("nav")
            if s.device.get("nav", n).message.HasField("horizon")
        ]
        if not names:
            text = "No moving horizon runs: add fpe-fuzzy or mhe-robust to [estimator] navigators."
            self._top = self.html(note(text), self._top)
            return
        items, drawing = [], EMPTY
        curves = []
        for name in names:
            m = s.device.get("nav", name).message.horizon
            items.append(
                (
                    estimator_title(name),
                    f"{m.n} fixes" + (f" (from {number(m.crisp, 2)})" if m.inputs else ""),
                )
            )
            t, r = s.rows("nav", name)
            curves.append(estimator_curve(s, "nav", name, t, r["horizon"]))
            if len(m.inputs) == 2 and not drawing:
                drawing = sets_svg(RULES.force, m.inputs[0], UNITS[0]) + sets_svg(
                    RULES.rate, m.inputs[1], UNITS[1]
                )
                self._fuzzy(s, name)
        if drawing:
            drawing += note("small · medium · high in the colours below; grey: the vehicle now")
        self._top = self.html(drawing + rows(items, s.stale("nav", names[0])), self._top)
        self.show("n", "Fixes looked back", "N", curves, s, height=170, digits=0)

    def _fuzzy(self, s: Snapshot, name: str) -> None:
        t, r = s.rows("nav", name)
        known = np.isfinite(r["crisp"])
        if not known.any():
            return
        t, r = t[known], r[known]
        for first, title in (
            (0, "Memberships of the specific force |f|"),
            (3, "Memberships of the rate |ω|"),
        ):
            curves = [
                Curve(MEMBERSHIPS[k].split(" ")[1], AXES[k - first], t, r["membership"][:, k])
                for k in range(first, first + 3)
            ]
            self.show(title, title, "0 to 1", curves, s, height=150, digits=2)
        for k, (title, unit) in enumerate(
            (("|f| as the rules see it", "m/s²"), ("|ω| as the rules see it", "rad/s"))
        ):
            self.show(
                title,
                title,
                unit,
                [Curve(unit, AXES[2], t, r["inputs"][:, k])],
                s,
                height=130,
                digits=2,
            )
