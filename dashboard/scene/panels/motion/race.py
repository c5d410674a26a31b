"""The estimators side by side: error against the tachometer over the window, honesty, and what a
step costs.
"""

import numpy as np

from dashboard.scene.drawing.palette import escape, estimator_colour, estimator_title, number
from dashboard.scene.panels.base import DEG, Panel, Snapshot

HEAD = (
    "<tr><td><b>estimator</b></td><td>RMS ω<sub>z</sub>, °/s</td><td>NIS over its"
    " freedom</td><td>µs per step</td><td>state</td></tr>"
)
NOTE = (
    "RMS of ω<sub>z</sub> against the tachometer over the window shown; NIS over its degrees of"
    " freedom is 1 for a filter whose innovations are as large as it says."
)


class Race(Panel):
    """One row for each rate estimator, the best first. Others than the default ones: [estimator]
    rate.
    """

    title = "Race"
    _table = None

    def update(self, s: Snapshot) -> None:
        names = s.device.estimators("rate")
        if not names:
            self._table = self.html(
                '<p class="gf-note">No rate estimators run for this device.</p>', self._table
            )
            return
        found = sorted((_error(s, name), name) for name in names)
        body = "".join(_row(s, name, error) for error, name in found)
        self._table = self.html(
            f'<table class="gf-rows">{HEAD}{body}</table><p class="gf-note">{NOTE}</p>', self._table
        )


def _error(s: Snapshot, name: str) -> float:
    """RMS against the tachometer, deg/s; infinite without one, and for an estimate that the
    tachometer itself aided.

    Without a direction channel: of the magnitudes.
    """
    latest = s.device.get("tacho")
    if _aid(s, name):
        return float("inf")
    true_t, true = s.rows("tacho")
    t, rows = s.rows("rate", name)
    if latest is None or len(true_t) < 2 or not len(t):
        return float("inf")
    inside = (t >= true_t[0]) & (t <= true_t[-1])
    omega, reference = rows["omega_ib_b"][inside, 2], np.interp(t[inside], true_t, true["omega"])
    if not latest.message.direction_known:
        omega, reference = np.abs(omega), np.abs(reference)
    return (
        float(np.sqrt(np.nanmean((omega - reference) ** 2)) * DEG) if inside.any() else float("inf")
    )


def _aid(s: Snapshot, name: str) -> str:
    """What the newest estimate was aided by; empty: nothing."""
    newest = s.device.get("rate", name)
    return newest.message.aid if newest else ""


def _row(s: Snapshot, name: str, error: float) -> str:
    _, rows = s.rows("rate", name)
    ratio = rows["nis"] / np.maximum(rows["nis_dof"], 1.0)
    ratio = ratio[np.isfinite(ratio)]
    status = s.device.get("estimator", name)
    cost = status.message.us_per_sample if status else float("nan")
    state = escape(status.message.state) if status else "–"
    aid = _aid(s, name)
    score = f"not scored: aided by the {escape(aid)}" if aid else number(error, 2)
    stale = ' class="gf-stale"' if s.stale("rate", name) else ""
    colour = estimator_colour(name, s.device.estimators("rate"))
    return (
        f'<tr{stale}><td><span style="color:{colour}">■</span> {escape(estimator_title(name))}</td>'
        f"<td>{score}</td><td>{number(float(ratio.mean()) if len(ratio) else None, 2)}</td>"
        f"<td>{number(cost, 0)}</td><td>{state}</td></tr>"
    )
