"""Navigation filters against each other, beside the map: the race on unseen fixes, and the button
that takes GNSS away.
"""

import numpy as np
import viser

from dashboard.data.device import Device
from dashboard.scene.drawing.drawn import Curve
from dashboard.scene.drawing.page import (
    EMPTY,
    Markup,
    alert,
    explained,
    joined,
    note,
    rows,
    tag,
)
from dashboard.scene.drawing.palette import (
    GREY,
    GYRO_FREE,
    estimator_colour,
    estimator_title,
    number,
)
from dashboard.scene.panels.base import Input, Panel, Snapshot, estimator_curve
from dashboard.scene.panels.motion.innovations import verdict
from dashboard.scene.panels.navigation import drift
from messages.contract import gyrofree_pb2 as pb

OUTAGE_S = 30.0
HEAD = (Markup("<b>race</b>, horizontal RMS, m"), "unseen fix", "prediction", "fed fix", "NIS")
METRICS = (
    "Three metrics, not to be mixed up: error on fixes held back from the filter; its prediction"
    " against the next fix, before that is used; and what is left to a fix after it was used, which"
    " rewards a filter that just follows."
)


class Navigation(Panel):
    """Whoever is closest to the fixes that nobody saw leads the table."""

    title = "Map"
    workspace = "navigate"
    own_scene = True  # the page around the scene lays its map over it
    _top = None

    @classmethod
    def missing(cls, device: Device) -> str:
        if device.estimators("nav") or device.get("gnss"):
            return ""
        return (
            "nothing says where this device is: it needs a GNSS receiver, and to navigate a"
            " six-axis board, or a cube for which [estimator] gyro_free_navigation names filters"
        )

    def __init__(self, client: viser.ClientHandle, folder: viser.GuiFolderHandle) -> None:
        super().__init__(client, folder)
        self._device, self._muted = "", False
        with folder:
            self._button = client.gui.add_button(
                f"GNSS outage, {OUTAGE_S:.0f} s",
                icon=viser.Icon.SATELLITE_OFF,
                color="gray",
                order=2.0,
                visible=False,
                hint="Hold the fixes back from all filters, and see what they do without",
            )
        self._button.on_click(lambda _: self._order())

    @property
    def orders(self) -> tuple[Input, ...]:
        """The button: a viewer may not press it."""
        return (self._button,)

    def update(self, s: Snapshot) -> None:
        self._device = s.device.name
        names = s.device.estimators("nav")
        if not names:
            text = (
                "The receiver's fixes alone: no navigation filter runs for this device. It takes"
                " a six-axis board, or a cube for which [estimator] gyro_free_navigation names"
                " filters."
            )
            self._top = self.html(note(text), self._top)
            return
        messages = {name: s.device.get("nav", name).message for name in names}
        self._muted = any(m.gnss_muted for m in messages.values())
        label = "End the outage" if self._muted else f"GNSS outage, {OUTAGE_S:.0f} s"
        if self._button.label != label:
            self._button.label = label
        if not self._button.visible:
            self._button.visible = True
        alone = self._alone(s, names)
        drifted = rows(drift.table_of(alone)) if alone else EMPTY
        self._top = self.html(self._said(s, names) + self._race(s, names) + drifted, self._top)
        if alone:
            title = "Without fixes since it began to move: horizontal error"
            self.show("alone", title, "m", drift.curves_of(alone), s, height=170)
        curves = []
        for name in names:
            t, r = s.rows("nav", name)
            half = 3 * r["sigma_p_n"][:, 2] if name == names[0] else None
            curves.append(estimator_curve(s, "nav", name, t, -r["p_n"][:, 2], half))
        self.show("height", "Height above the origin", "m", curves, s, height=170, digits=2)
        curves = []
        for name in names:
            t, r = s.rows("innovation", name)
            error = np.hypot(r["error"][:, 0], r["error"][:, 1])
            unseen = np.isfinite(error)
            if unseen.any():
                curves.append(estimator_curve(s, "innovation", name, t[unseen], error[unseen]))
        ahead = (
            drift.outage(messages[names[0]], s.device.get("nav", names[0]).t)
            if self._muted
            else None
        )
        if ahead is not None:
            curves.append(Curve("equation (27), 1σ biases", GREY, *ahead, dash=True))
        if curves:
            self.show(
                "error", "Horizontal error on fixes held back", "m", curves, s, height=170, digits=2
            )

    @staticmethod
    def _alone(s: Snapshot, names: list[str]) -> drift.Unaided | None:
        """What the cube's own navigation does without fixes, where its rate feeds a filter."""
        rates = s.device.estimators("rate")
        lead = next((name for name in names if name.startswith(GYRO_FREE)), "")
        return drift.unaided(s, rates[0], lead) if rates and lead else None

    def _said(self, s: Snapshot, names: list[str]) -> Markup:
        """What holds the filters back; the map itself stands in the place of the scene."""
        alarm = alert("GNSS is muted: the filters go on without fixes.") if self._muted else EMPTY
        m = s.device.get("nav", names[0]).message
        waits = note(m.alignment) if m.mode != pb.NavSolution.MODE_NAVIGATING else EMPTY
        return alarm + waits

    def _race(self, s: Snapshot, names: list[str]) -> Markup:
        """Three metrics, which are not the same: see docs/navigation.md."""
        found = []
        for name in names:
            _, r = s.rows("innovation", name)
            error, ahead = r["error"][:, :2], r["ahead"][:, :2]
            unseen = np.isfinite(error[:, 0])
            fed = ~unseen & np.isfinite(ahead[:, 0])
            left = r["residual"][fed, :2]
            left = left[np.isfinite(left[:, 0])]
            found.append((_rms(error[unseen]), _rms(ahead[fed]), _rms(left), name, r["nis"][fed]))
        items = []
        for error, ahead, left, name, nis in sorted(
            found, key=lambda f: (np.nan_to_num(f[0], nan=1e9), f[3])
        ):
            dot = tag("span", "●", style=f"color:{estimator_colour(name, names)}")
            dof = s.device.get("innovation", name).message.dof
            honest = "–"
            if len(nis):
                honest = joined([number(float(np.mean(nis)), 1), " · ", verdict(nis, dof)])
            cells = [number(v, 3) for v in (error, ahead, left)] + [honest]
            title = joined([dot, " ", estimator_title(name)])
            items.append([title, *cells])
        body = (tag("tr", *(tag("td", explained(cell)) for cell in row)) for row in [HEAD, *items])
        return tag("table", *body, class_="gf-rows") + note(METRICS)

    def _order(self) -> None:
        seconds = 0.0 if self._muted else OUTAGE_S
        command = pb.EstimatorCommand(
            action=pb.EstimatorCommand.ACTION_MUTE_GNSS, device=self._device, seconds=seconds
        )
        self.order_estimator("GNSS outage", command)


def _rms(rows: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.sum(rows**2, axis=1)))) if len(rows) else float("nan")
