"""Curves of a person's own: expressions over what the device sends, typed in the page around the
scene.
"""

import time
from functools import partial

from dashboard.data.channels import Channel, Drawn, channels, derived
from dashboard.data.device import Device
from dashboard.scene.drawing.drawn import Curve
from dashboard.scene.drawing.page import Markup, alert, joined, note, tag
from dashboard.scene.panels.base import Panel, Snapshot, shades_of
from logs.figures.expression import read
from logs.figures.names import BLUE, OCHRE, OLIVE, PURPLE, TEAL, VIOLET
from logs.figures.quantity import ExpressionError

COLOURS = (VIOLET, TEAL, OCHRE, PURPLE, OLIVE, BLUE)
SHARE = 0.1  # of the time, at most, is spent on the expressions of one browser


class Derived(Panel):
    """A chart for each expression; a list of what may be named while there is none."""

    title = "Derived"
    workspace = "watch"
    _top = None

    @classmethod
    def missing(cls, device: Device) -> str:
        return "" if channels(device) else "no samples have come from this device yet"

    def update(self, s: Snapshot) -> None:
        if not s.derived:
            self._last = None
            self._top = self.html(_offer(channels(s.device)), self._top)
            return
        now, asked = time.monotonic(), (s.derived, s.device.name, s.cursors, s.dark)
        last = getattr(self, "_last", None)
        if last is not None and last[0] == asked and now < last[1]:
            self._shown |= last[2]  # as it is; it was dear to compute
            return
        named, faults = channels(s.device), []
        for k, line in enumerate(s.derived):
            try:
                expression = read(line)
                drawn = derived(s.device, expression, s.t0, s.t1, named)
            except ExpressionError as error:
                faults.append(alert(tag("b", line), ": ", str(error)))
                continue
            self._draw(s, k, expression.text, drawn)
        self._top = self.html(joined(faults), self._top)
        cost = time.monotonic() - now
        self._last = (asked, now + cost / SHARE, set(self._shown))

    def _draw(self, s: Snapshot, k: int, text: str, drawn: Drawn) -> None:
        stale = any(s.stale(one.topic, one.estimator) for one in drawn.of)
        curve = Curve(text, COLOURS[k % len(COLOURS)], drawn.t, drawn.y, stale=stale)
        curve.sight = drawn.sight
        shades = partial(shades_of, drawn.t, drawn.sight)
        self.show(f"derived{k}", text, drawn.unit, [curve], s, shades, height=190, digits=3)


def _offer(named: dict[str, Channel]) -> Markup:
    """What may be named, by whom it comes; of two names of one thing the shorter."""
    guide = note(
        "Type an expression under ƒ in the row above, like ",
        tag("b", "norm(omega_x, omega_y, omega_z)"),
        ". It is drawn here, kept with your view, and part of its link. These channels have names,"
        " which are offered as you type:",
    )
    shortest = {(one.topic, one.estimator, one.column, one.part): one for one in named.values()}
    of: dict[str, dict[str, list[str]]] = {}
    for one in shortest.values():
        who = "axes" if one.topic == "accel" else one.who
        stem, _, part = one.name.rpartition("_") if one.part is not None else (one.name, "", "")
        of.setdefault(who, {}).setdefault(stem, []).append(f"_{part}" if part else "")
    lines = [note(tag("b", who), ": ", _names(stems)) for who, stems in of.items()]
    return joined([guide, *lines])


def _names(stems: dict[str, list[str]]) -> Markup:
    """`omega_x _y _z` for the three of them."""
    return joined(
        [tag("span", stem + " ".join(parts), class_="gf-channel") for stem, parts in stems.items()],
        " ",
    )
