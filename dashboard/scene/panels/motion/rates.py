"""Angular rate: every estimator with its 3-sigma band over the tachometer; a vehicle's
gyroscope.
"""

from functools import partial

import numpy as np

from dashboard.data.device import Device
from dashboard.scene.drawing.drawn import Curve, Shade
from dashboard.scene.drawing.page import joined, note, sub
from dashboard.scene.drawing.palette import (
    AXES,
    GREY,
    REFERENCE,
    truth_colour,
)
from dashboard.scene.panels.base import DEG, NO_RATE, Panel, Snapshot, estimator_curve, shades_of

TITLES = {axis: joined([sub("ω", axis), " with 3σ"]) for axis in "xyz"}


class Rates(Panel):
    """omega_z with the tachometer first, because it is what the table turns about; then omega_x and
    omega_y.
    """

    title = "Rates"
    workspace = "watch"
    _note = None

    @classmethod
    def missing(cls, device: Device) -> str:
        if device.is_vehicle:
            return "" if device.get("imu") else "no inertial samples have come from this board yet"
        return "" if device.estimators("rate") else NO_RATE

    def update(self, s: Snapshot) -> None:
        if s.device.is_vehicle:
            t, rows = s.rows("imu")
            curves = [
                Curve(f"ω{axis}", AXES[k], t, rows["omega_ib_b"][:, k] * DEG, stale=s.stale("imu"))
                for k, axis in enumerate("xyz")
            ]
            self.show("imu", "Measured rate, body", "°/s", curves, s, height=230)
            return
        self._say_why(s)
        for k, axis in ((2, "z"), (0, "x"), (1, "y")):
            self.show(
                f"omega{axis}",
                TITLES[axis],
                "°/s",
                partial(self._curves, s, k),
                s,
                height=215 if k == 2 else 150,
                shades=partial(_sight, s, k),
            )

    def _curves(self, s: Snapshot, k: int) -> list[Curve]:
        curves = self._estimates(s, k)
        if k == 2 and s.device.get("tacho"):
            t, rows = s.rows("tacho")
            known = s.device.get("tacho").message.direction_known
            label = "tachometer" if known else "tachometer |ω|"
            stale, omega = s.stale("tacho"), rows["omega"] * DEG
            curves.append(Curve(label, REFERENCE, t, omega, stale=stale, dash=True))
        if s.device.get("truth"):
            t, rows = s.rows("truth")
            omega = rows["omega_ib_b"][:, k] * DEG
            curves.append(Curve("truth", truth_colour(s.dark), t, omega, width=1.0))
        return curves

    def _say_why(self, s: Snapshot) -> None:
        """The best filter's reason where it does not vouch for a component."""
        first = _best(s)
        latest = s.device.get("rate", first) if first else None
        reason = latest.message.sight_reason if latest else ""
        self._note = self.html(note(reason), self._note)

    @staticmethod
    def _estimates(s: Snapshot, k: int) -> list[Curve]:
        curves = []
        for name in s.device.estimators("rate"):
            t, rows = s.rows("rate", name)
            sigma = rows["sigma"][:, k] * DEG
            omega, sight = rows["omega_ib_b"][:, k] * DEG, rows["sight"][:, k]
            curves.append(estimator_curve(s, "rate", name, t, omega, 3 * sigma, sight))
        curves += _bound(s, k)
        return curves


def _best(s: Snapshot) -> str:
    """The estimator whose sight and bound are shown: the one that has a bound, else the first."""
    names = list(s.device.estimators("rate"))
    with_bound = [
        name for name in names if len(s.device.get("rate", name).message.bound_sigma_radps)
    ]
    return (with_bound or names or [""])[0]


def _sight(s: Snapshot, k: int) -> list[Shade]:
    """Where a component is ambiguous or blind (docs/estimators.md)."""
    name = _best(s)
    if not name:
        return []
    t, rows = s.rows("rate", name)
    return shades_of(t, rows["sight"][:, k])


def _bound(s: Snapshot, k: int) -> list[Curve]:
    """The Cramer-Rao bound, 3 sigma about the estimate."""
    name = _best(s)
    if not name:
        return []
    t, rows = s.rows("rate", name)
    bound = 3 * rows["bound"][:, k] * DEG
    known = np.isfinite(bound)
    if not known.any():
        return []
    t, bound, omega = t[known], bound[known], rows["omega_ib_b"][known, k] * DEG
    return [
        Curve("3σ bound", GREY, t, omega + bound, dash=True, width=1.0, live=False),
        Curve("", GREY, t, omega - bound, dash=True, width=1.0, live=False),
    ]
