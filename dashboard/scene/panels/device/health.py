"""Health of the accelerometer axes: one row each, how well it fits the others, and since when it
does not.
"""

from dashboard.data.alarms import AXIS_WORDS, axis_good
from dashboard.data.device import Device
from dashboard.scene.drawing.axis_arrows import BAD, residual_colour
from dashboard.scene.drawing.page import Markup, alert, bad, joined, note, tag
from dashboard.scene.drawing.palette import age, number
from dashboard.scene.panels.base import Panel, Snapshot
from messages.contract import gyrofree_pb2 as pb
from messages.text import counted

MOST = 64  # axes in the table
FULL = 2.0 * BAD  # sigmas that fill a bar


class Health(Panel):
    """Parity of the axes: residual of each against all others and the rigid-body field."""

    title = "Health"
    workspace = "diagnose"
    _table = None

    @classmethod
    def missing(cls, device: Device) -> str:
        if device.get("axes"):
            return ""
        if device.is_vehicle:
            return "one accelerometer alone has nothing to be compared with"
        return "no estimator has judged the axes of this board yet"

    def update(self, s: Snapshot) -> None:
        latest = s.device.get("axes")
        if latest is None:
            text = (
                "No axis health: this device has no accelerometer axes, or its estimator has not"
                " spoken yet."
            )
            self._table = self.html(note(text), self._table)
            return
        m = latest.message
        bad_ones = [
            f"{axis.name} {AXIS_WORDS.get(axis.state, 'unknown')}"
            for axis in m.axes
            if not axis_good(axis)
        ]
        good = ", ".join([f"{len(m.axes) - len(bad_ones)} of {len(m.axes)} good", *bad_ones])
        ratio = number(m.chi2, 1) if m.dof else "–"
        words = f"layout {m.layout}: {good}"
        fit = f"Misfit of all axes together: χ² {ratio} with {counted(m.dof, 'condition')}."
        body = (_row(axis, m.header.utc_ns) for axis in m.axes[:MOST])
        kind = "gf-rows gf-stale" if s.stale("axes") else "gf-rows"
        table = tag("table", _HEAD, *body, class_=kind)
        more = (
            note(f"and {counted(len(m.axes) - MOST, 'axis', 'axes')} more")
            if len(m.axes) > MOST
            else ""
        )
        bar = note("Bar: residual against the other axes over its σ, full at 8 σ; gate at 4 σ.")
        said = alert(m.message) if m.message != f"axes: {good}" else ""
        parts = [said, tag("p", words, class_="gf-title"), table, more, bar, note(fit)]
        self._table = self.html(joined(parts), self._table)


_HEAD = Markup(
    "<tr><td><b>axis</b></td><td>state</td><td>residual, m/s²</td><td></td><td>since</td></tr>"
)


def _row(axis: pb.AxisHealth.Axis, now_ns: int) -> Markup:
    colour = residual_colour(axis)
    sigma = axis.residual_sigma_mps2
    ratio = abs(axis.residual_mps2) / sigma if sigma > 0.0 else 0.0
    width = round(100.0 * min(ratio / FULL, 1.0)) if ratio == ratio else 0
    filled = tag("div", style=f"width:{width}%;height:100%;background:{colour}")
    frame = "width:64px;height:8px;border:1px solid #8C8C8C;border-radius:2px"
    bar = tag("div", filled, style=frame)
    word = AXIS_WORDS.get(axis.state, "unknown")
    good = axis.state == pb.AxisHealth.STATE_GOOD
    state = word if good else bad(word, ", not used" if axis.excluded else "")
    since = "" if good else age(max(0.0, (now_ns - axis.since_utc_ns) * 1e-9))
    residual = number(axis.residual_mps2, 3, sign=True)
    row = tag("tr", *(tag("td", cell) for cell in (axis.name, state, residual, bar, since)))
    if not axis.text:
        return row
    return row + tag("tr", tag("td"), tag("td", tag("small", axis.text), colspan=4))
