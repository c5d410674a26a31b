"""Health of the accelerometer axes: one row each, how well it fits the others, and since when it
does not.
"""

from dashboard.scene.drawing.axis_arrows import BAD, residual_colour
from dashboard.scene.drawing.palette import age, escape, number
from dashboard.scene.panels.base import Panel, Snapshot
from messages.contract import gyrofree_pb2 as pb

WORDS = {
    pb.AxisHealth.STATE_GOOD: "good",
    pb.AxisHealth.STATE_STUCK: "stuck",
    pb.AxisHealth.STATE_SATURATED: "saturated",
    pb.AxisHealth.STATE_SWAPPED: "swapped",
    pb.AxisHealth.STATE_FLIPPED: "sign flipped",
    pb.AxisHealth.STATE_SPIKING: "spiking",
    pb.AxisHealth.STATE_BIASED: "biased",
    pb.AxisHealth.STATE_STALE: "not fresh",
    pb.AxisHealth.STATE_SUSPECT: "suspect",
}
FULL = 2.0 * BAD  # sigmas that fill a bar


class Health(Panel):
    """Parity of the axes: residual of each against all others and the rigid-body field."""

    title = "Health"
    _table = None

    def update(self, s: Snapshot) -> None:
        latest = s.device.get("axes")
        if latest is None:
            text = (
                "No axis health: this device has no accelerometer axes, or its estimator has not"
                " spoken yet."
            )
            self._table = self.html(f'<p class="gf-note">{text}</p>', self._table)
            return
        m = latest.message
        alert = f'<p class="gf-alert">{escape(m.message)}</p>' if m.message else ""
        used = sum(not axis.excluded for axis in m.axes)
        ratio = number(m.chi2, 1) if m.dof else "–"
        head = (
            f'<p class="gf-title">{escape(m.layout)}: {used} of {len(m.axes)} axes in use · '
            f"χ² {ratio}, {m.dof} conditions</p>"
        )
        body = "".join(_row(axis, m.header.utc_ns) for axis in m.axes)
        stale = " gf-stale" if s.stale("axes") else ""
        note = (
            '<p class="gf-note">Bar: residual against the other axes over its σ, full at 8 σ; gate'
            " at 4 σ.</p>"
        )
        table = f'<table class="gf-rows{stale}">{_HEAD}{body}</table>'
        self._table = self.html(alert + head + table + note, self._table)


_HEAD = "<tr><td><b>axis</b></td><td>state</td><td>residual, m/s²</td><td></td><td>since</td></tr>"


def _row(axis: pb.AxisHealth.Axis, now_ns: int) -> str:
    colour = residual_colour(axis)
    sigma = axis.residual_sigma_mps2
    ratio = abs(axis.residual_mps2) / sigma if sigma > 0.0 else 0.0
    width = round(100.0 * min(ratio / FULL, 1.0))
    bar = (
        '<div style="width:64px;height:8px;border:1px solid #8C8C8C;border-radius:2px">'
        f'<div style="width:{width}%;height:100%;background:{colour}"></div></div>'
    )
    word = WORDS.get(axis.state, "unknown")
    good = axis.state == pb.AxisHealth.STATE_GOOD
    state = word if good else f'<b class="gf-bad">{word}{", not used" if axis.excluded else ""}</b>'
    since = "" if good else age(max(0.0, (now_ns - axis.since_utc_ns) * 1e-9))
    residual = number(axis.residual_mps2, 3, sign=True)
    row = (
        f"<tr><td>{escape(axis.name)}</td><td>{state}</td><td>{residual}</td>"
        f"<td>{bar}</td><td>{since}</td></tr>"
    )
    text = (
        f'<tr><td></td><td colspan="4"><small>{escape(axis.text)}</small></td></tr>'
        if axis.text
        else ""
    )
    return row + text
