"""The estimators side by side: error against the tachometer over the window, honesty, and what a
step costs.
"""

import numpy as np

from dashboard.data.device import Device
from dashboard.scene.drawing.page import Markup, explained, joined, note, sub, tag, term
from dashboard.scene.drawing.palette import estimator_colour, estimator_title, number
from dashboard.scene.panels.base import DEG, NO_RATE, Panel, Snapshot, rms, rms_text
from dashboard.scene.panels.motion.innovations import verdict

HEAD = (
    tag("b", "estimator"),
    joined(["RMS ", sub("ω", "z"), ", °/s"]),
    "NIS over its freedom",
    "µs per step",
    "state",
)
NOTE = joined(
    [
        "RMS of ",
        sub("ω", "z"),
        " against the tachometer over the window shown, of what is ",
        term("valid"),
        "; ",
        term("NIS"),
        " over its degrees of freedom is 1 for a filter whose innovations are as large as it says.",
    ]
)


class Race(Panel):
    """One row for each rate estimator, the best first. Others than the default ones: [estimator]
    rate.
    """

    title = "Race"
    workspace = "watch"
    _table = None

    @classmethod
    def missing(cls, device: Device) -> str:
        if device.estimators("rate"):
            return ""
        if device.is_vehicle:
            return "rate estimators are for boards without gyroscopes; this one measures its rate"
        return NO_RATE

    def update(self, s: Snapshot) -> None:
        names = s.device.estimators("rate")
        if not names:
            self._table = self.html(note("No rate estimators run for this device."), self._table)
            return
        found = sorted((*_error(s, name), name) for name in names)
        body = (_row(s, name, score) for _, score, name in found)
        head = tag("tr", *(tag("td", explained(cell)) for cell in HEAD))
        table = tag("table", head, *body, class_="gf-rows")
        self._table = self.html(table + note(NOTE), self._table)


def _error(s: Snapshot, name: str) -> tuple[float, str]:
    """RMS against the tachometer, deg/s, to sort by, and as it is shown; infinite and a dash
    without one, and for an estimate that the tachometer itself aided.

    Without a direction channel: of the magnitudes.
    """
    unscored = float("inf"), "–"
    latest = s.device.get("tacho")
    if _aid(s, name):
        return unscored
    true_t, true = s.rows("tacho")
    t, rows = s.rows("rate", name)
    if latest is None or len(true_t) < 2 or not len(t):
        return unscored
    inside = (t >= true_t[0]) & (t <= true_t[-1])
    omega, reference = rows["omega_ib_b"][inside, 2], np.interp(t[inside], true_t, true["omega"])
    if not latest.message.direction_known:
        omega, reference = np.abs(omega), np.abs(reference)
    if not inside.any():
        return unscored
    error, sight = (omega - reference) * DEG, rows["sight"][inside, 2]
    value = rms(error, sight)
    return value if np.isfinite(value) else float("inf"), rms_text(error, sight)


def _aid(s: Snapshot, name: str) -> str:
    """What the newest estimate was aided by; empty: nothing."""
    newest = s.device.get("rate", name)
    return newest.message.aid if newest else ""


def _row(s: Snapshot, name: str, score: str) -> Markup:
    _, rows = s.rows("rate", name)
    known = np.isfinite(rows["nis"])
    nis, dof = rows["nis"][known], np.maximum(rows["nis_dof"][known], 1.0)
    status = s.device.get("estimator", name)
    cost = status.message.us_per_sample if status else float("nan")
    state = status.message.state if status else "–"
    aid = _aid(s, name)
    score = f"not scored: aided by the {aid}" if aid else score
    colour = estimator_colour(name, s.device.estimators("rate"))
    title = joined([tag("span", "■", style=f"color:{colour}"), " ", estimator_title(name)])
    honest = "–"
    if len(nis):
        honest = joined([number(float(np.mean(nis / dof)), 2), " · ", verdict(nis, dof)])
    cells = (tag("td", cell) for cell in (title, explained(score), honest, number(cost, 0), state))
    return tag("tr", *cells, class_="gf-stale" if s.stale("rate", name) else "")
