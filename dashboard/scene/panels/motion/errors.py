"""How far the estimates are off: against the truth, else against the tachometer; a vehicle against
unseen fixes.
"""

import numpy as np

from dashboard.data.device import Device
from dashboard.scene.drawing.drawn import Curve
from dashboard.scene.drawing.page import joined, note, rows, sub
from dashboard.scene.drawing.palette import AXES, estimator_title, number
from dashboard.scene.panels.base import DEG, Panel, Snapshot, estimator_curve, rms_text


class Errors(Panel):
    """Error with the 3-sigma the filter claims for it, and its RMS over the window."""

    title = "Errors"
    workspace = "navigate"
    _table = None

    @classmethod
    def missing(cls, device: Device) -> str:
        if device.is_vehicle:
            return "" if device.estimators("innovation") else "no fix has been used yet"
        if device.get("truth") or device.get("tacho"):
            return ""
        return "nothing to compare with: neither truth nor tachometer is known"

    def update(self, s: Snapshot) -> None:
        if s.device.is_vehicle:
            self._vehicle(s)
        else:
            self._cube(s)

    def _cube(self, s: Snapshot) -> None:
        true_t, truth = s.rows("truth")
        reference, true_omega = "truth", truth["omega_ib_b"]
        axes = ((2, "z"), (0, "x"), (1, "y"))
        if not len(true_t):
            true_t, tacho = s.rows("tacho")
            known = s.device.get("tacho") and s.device.get("tacho").message.direction_known
            reference = "tachometer" if known else "tachometer, magnitudes"
            axes = axes[:1]  # it turns about z only
        rms = []
        for k, axis in axes:
            curves = []
            for name in s.device.estimators("rate"):
                t, r = s.rows("rate", name)
                if len(true_t) < 2 or not len(t):
                    continue
                if (
                    reference != "truth" and s.device.get("rate", name).message.aid
                ):  # it would be scored by its own aid
                    rms.append(
                        (
                            joined(["RMS ", sub("ω", axis), ", ", estimator_title(name)]),
                            "aided by the tachometer",
                        )
                    )
                    continue
                omega = r["omega_ib_b"][:, k]
                if reference == "truth":
                    true = np.interp(t, true_t, true_omega[:, k])
                else:
                    true = np.interp(t, true_t, tacho["omega"])
                    omega = omega if reference == "tachometer" else np.abs(omega)
                inside = (t >= true_t[0]) & (t <= true_t[-1])
                error, half = (omega - true)[inside] * DEG, 3 * r["sigma"][inside, k] * DEG
                sight = r["sight"][inside, k]
                curve = estimator_curve(s, "rate", name, t[inside], error, half, sight)
                curve.about_zero = True
                curves.append(curve)
                if len(error):
                    rms.append(
                        (
                            joined(["RMS ", sub("ω", axis), ", ", estimator_title(name)]),
                            rms_text(error, sight, "°/s"),
                        )
                    )
            title = joined(["Error of ", sub("ω", axis), f" against {reference}"])
            self.show(
                f"error{axis}", title, "°/s", curves, s, height=215 if k == 2 else 150, digits=2
            )
        self._table = self.html(
            rows(rms) if rms else note("no reference yet: neither truth nor tachometer"),
            self._table,
        )

    def _vehicle(self, s: Snapshot) -> None:
        items = []
        for name in s.device.estimators("innovation"):
            t, r = s.rows("innovation", name)
            error = r["error"]
            held_out = np.isfinite(error[:, 0])
            if held_out.any():
                t, error = t[held_out], error[held_out]
                half, what = _three_sigma(s, name, t), "navigation minus unseen fix"
            # before it is used, each fix is unseen too: the innovation is the error of the
            # prediction
            else:
                error, half = (
                    -r["value"][:, :3],
                    [3 * r["sigma"][:, k] for k in range(3)],
                )
                what = "prediction minus the fix about to be used"
            for k, axis in enumerate(("North", "East", "Down")):
                curve = Curve(
                    axis,
                    AXES[k],
                    t,
                    error[:, k],
                    half[k],
                    stale=s.stale("innovation", name),
                    about_zero=True,
                )
                self.show(f"{name}{k}", f"{axis}: {what}", "m", [curve], s, height=150, digits=2)
            if len(error):
                horizontal = float(np.sqrt(np.nanmean(error[:, 0] ** 2 + error[:, 1] ** 2)))
                items += [(f"RMS horizontal, {estimator_title(name)}", number(horizontal, 2, "m"))]
                known = error[np.isfinite(error[:, 2]), 2]
                height = float(np.sqrt(np.mean(known**2))) if len(known) else None
                items += [("RMS height", number(height, 2, "m"))]
                items += [("fixes in the window", str(len(error)))]
        self._table = self.html(rows(items) if items else note("no fixes yet"), self._table)


def _three_sigma(s: Snapshot, name: str, t: np.ndarray) -> list[np.ndarray | None]:
    """What the filter claims for north, east, down, m, at times t (n,); the fix's own error comes
    on top.
    """
    at, r = s.rows("nav", name)
    if len(at) < 2:
        return [None] * 3
    return [3 * np.interp(t, at, r["sigma_p_n"][:, k]) for k in range(3)]
