"""Is a filter honest: innovations inside their 3-sigma, NIS inside the chi-square bounds of its
degrees of freedom.
"""

import numpy as np
import viser
from scipy.stats import chi2

from dashboard.data.device import Device
from dashboard.scene.drawing.drawn import Curve
from dashboard.scene.drawing.page import Markup, bad, joined, note, rows, sub, tag, term
from dashboard.scene.drawing.palette import AXES, GREY, estimator_title, number
from dashboard.scene.panels.base import Panel, Snapshot, estimator_curve
from inertial.layouts.layout import PRODUCTS
from sessions.report.nis import TOO_CAREFUL, TOO_SURE, nis_verdict

INSIDE = 0.95  # share of NIS values that an honest filter has between the two bounds


class Innovations(Panel):
    """NIS first, then the innovations; the table says how many values lie inside."""

    title = "NIS"
    workspace = "diagnose"
    _table = None

    @classmethod
    def missing(cls, device: Device) -> str:
        topic = "innovation" if device.is_vehicle else "rate"
        if device.estimators(topic):
            return ""
        return "no filter has corrected itself by a measurement yet"

    def __init__(self, client: viser.ClientHandle, folder: viser.GuiFolderHandle) -> None:
        super().__init__(client, folder)
        self._units: dict[
            str, str
        ] = {}  # of the last correction: a message without one does not name it

    def update(self, s: Snapshot) -> None:
        topic = "innovation" if s.device.is_vehicle else "rate"
        items = []
        for name in s.device.estimators(topic):
            message = s.device.get(topic, name).message
            if topic == "innovation":
                t, r = s.rows("innovation", name)
                nis, value, sigma = r["nis"], r["value"], r["sigma"]
                dof, labels, unit = message.dof, list(message.name), "m, m/s"
            else:
                t, r = s.rows("rate", name)
                nis, value, sigma = r["nis"], r["innovation"], r["innovation_sigma"]
                dof = r["nis_dof"]
                if message.innovation_unit:
                    self._units[name] = message.innovation_unit.replace("^2", "²")
                unit = self._units.get(name, "")
                labels = _PRODUCTS if value.shape[1] == 6 else []
            good = np.isfinite(nis)
            if not good.any():
                continue
            count = dof if topic == "innovation" else int(np.max(dof[good]))
            items += self._nis(s, topic, name, t[good], nis[good], count)
            self._innovations(s, topic, name, (t[good], value[good], sigma[good]), labels, unit)
        nothing = note("No corrections yet: a filter without measurements has no innovations.")
        self._table = self.html(rows(items) if items else nothing, self._table)

    def _nis(
        self, s: Snapshot, topic: str, name: str, t: np.ndarray, nis: np.ndarray, dof: int
    ) -> list:
        title = estimator_title(name)
        low, high = chi2.interval(INSIDE, max(dof, 1))
        curve = estimator_curve(s, topic, name, t, np.minimum(nis, 5 * high))
        ends = np.array([s.t0, s.t1])
        bounds = [
            Curve(f"χ² {label} %", GREY, ends, np.full(2, bound), dash=True, width=1.2)
            for label, bound in (("2.5", low), ("97.5", high))
        ]
        self.show(
            f"{name}nis",
            f"NIS, {title}",
            f"{dof} degrees of freedom",
            [curve, *bounds],
            s,
            height=200,
        )
        inside = float(np.mean((nis >= low) & (nis <= high)) * 100)
        return [
            (f"inside 95 % bounds, {title}", number(inside, 1, "%")),
            (
                joined(["mean ", term("NIS"), f", expected {dof}"]),
                joined([number(float(np.mean(nis)), 2), " · ", verdict(nis, dof)]),
            ),
        ]

    def _innovations(
        self, s: Snapshot, topic: str, name: str, data: tuple, labels: list[str], unit: str
    ) -> None:
        t, value, sigma = data
        for first in (0, 3):
            curves = [
                Curve(
                    labels[k] if k < len(labels) else str(k + 1),
                    AXES[k - first],
                    t,
                    value[:, k],
                    3 * sigma[:, k] if k == first else None,
                    stale=s.stale(topic, name),
                    about_zero=True,
                )
                for k in range(first, first + 3)
                if np.isfinite(value[:, k]).any()
            ]
            if curves:
                self.show(
                    f"{name}{first}",
                    f"Innovations {first + 1} to {first + len(curves)}",
                    unit,
                    curves,
                    s,
                    digits=2,
                )


def verdict(nis: np.ndarray, dof: int) -> Markup:
    """What values of NIS (n,) say of a filter, as it is shown."""
    said = nis_verdict(nis, dof)
    return bad(said) if said in (TOO_SURE, TOO_CAREFUL) else tag("span", said)


# The products w_i w_j in the estimators' order.
_PRODUCTS = [sub("ω", "xyz"[i]) + sub("ω", "xyz"[j]) for i, j in zip(*PRODUCTS, strict=True)]
