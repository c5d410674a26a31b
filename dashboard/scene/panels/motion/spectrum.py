"""Power spectral density and Allan deviation of one signal, of the window that is shown."""

import json
import math
import time
from collections.abc import Sequence
from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray

from dashboard.data.channels import Channel, channels, derived, sight_of
from dashboard.data.device import Device
from dashboard.scene.drawing.chart import AXIS
from dashboard.scene.drawing.page import Markup, alert, note, tag
from dashboard.scene.panels.base import Panel, Snapshot
from logs.figures.expression import read
from logs.figures.names import BLUE
from logs.figures.quantity import ExpressionError
from logs.figures.sight import vouched
from logs.figures.spectrum import density, unbroken
from sessions.report.stability import LEAST, allan_of

Array = NDArray[np.float64]
EVERY_S = 2.0  # between two computations
FIRST = "omega_z"  # what the table turns about, of the leading estimator
ORDER = {"psd": 2.0, "allan": 4.0}  # of the charts on the page
NEARLY = 1e-3  # of a decade: a period of 9.9999 ms is one of 10 ms
COLUMNS = ("omega_ib_b", "omega", "f_b", "f", "counts", "roll", "pitch")  # that have a spectrum


def signals(device: Device, lines: Sequence[str]) -> dict[str, Channel | str]:
    """What may be chosen, by its title: what a device measures, and what a person derives of that.
    Call under the store's lock.
    """
    found: dict[tuple, tuple[str, Channel]] = {}
    for one in channels(device).values():
        if one.column in COLUMNS:  # the shorter of two names stands last
            found[one.topic, one.estimator, one.column, one.part] = one
    titled = {f"{symbol(one.name)} · {one.who}": one for one in found.values()}
    return dict(sorted(titled.items())) | {line: line for line in lines}


def symbol(name: str) -> str:
    """A channel's name as it is written in a formula: omega_x is ωx."""
    word, _, part = name.rpartition("_")
    short = word.rsplit("_", 1)[-1]
    return {"omega": "ω", "f": "f"}.get(short, f"{word}_" if word else "") + part


def samples(s: Snapshot, signal: Channel | str) -> tuple[Array, Array, str]:
    """Times (n,) s, values (n,) and unit of what was chosen, in the window; NaN where an estimator
    does not vouch for it. Raises ExpressionError.
    """
    if isinstance(signal, str):
        drawn = derived(s.device, read(signal), s.t0, s.t1, channels(s.device))
        return drawn.t, vouched(drawn.y, drawn.sight), drawn.unit
    t, rows = s.rows(signal.topic, signal.estimator)
    return np.asarray(t), vouched(signal.of(rows), sight_of(signal, rows)), signal.unit


def _scales(x: Array) -> dict[str, Any]:
    """Logarithmic scales, x over whole decades.

    Left to itself the chart keeps its limits in shares of the data's span, and these lead to
    negative ones while the span grows; on a logarithmic axis the search for its ticks does not end
    then.
    """
    low = math.floor(math.log10(x[0]) + NEARLY)
    high = max(math.ceil(math.log10(x[-1]) - NEARLY), low + 1)
    across = {"time": False, "distr": 3, "auto": False, "range": (10.0**low, 10.0**high)}
    return {"x": across, "level": {"distr": 3}}


class Spectrum(Panel):
    """Welch's spectrum and the overlapping Allan deviation of the signal that is chosen."""

    title = "Spectrum"
    workspace = "diagnose"
    own_inputs = ("Signal",)
    _note = None
    _plots: dict[str, viser.GuiUplotHandle]

    def __init__(self, client: viser.ClientHandle, folder: viser.GuiFolderHandle) -> None:
        super().__init__(client, folder)
        self._plots, self._headings, self._at, self._of = {}, {}, 0.0, ""
        with folder:
            self._choice = client.gui.add_dropdown("Signal", ("–",), order=0.5)

    @classmethod
    def missing(cls, device: Device) -> str:
        return "" if signals(device, ()) else "no samples have come from this device yet"

    def update(self, s: Snapshot) -> None:
        known = signals(s.device, s.derived)
        if known and tuple(self._choice.options) != tuple(known):
            before = self._choice.value
            self._choice.options = tuple(known)
            leading = (title for title, one in known.items() if getattr(one, "name", "") == FIRST)
            first = next(leading, next(iter(known)))
            self._choice.value = before if before in known else first
        chosen, now = self._choice.value, time.monotonic()
        if chosen not in known or (self._of == chosen and now - self._at < EVERY_S):
            return
        self._of, self._at = chosen, now
        try:
            t, y, unit = samples(s, known[chosen])
        except ExpressionError as error:
            self._say(alert(str(error)))
            return
        y, period = unbroken(t, y)
        if len(y) < LEAST:
            self._say(note(f"{len(y)} samples without a hole; {LEAST} are needed: wait"))
            return
        rate = f"{len(y)} samples without a hole, {len(y) * period:.1f} s at {1 / period:.1f} Hz"
        self._say(note(rate))
        f, p = density(y, period)
        self._draw(
            "psd", f"Spectral density of {chosen}", f"{unit}/√Hz", "frequency, Hz", f, np.sqrt(p)
        )
        allan = allan_of(chosen, y, period)
        if allan is not None:
            title = f"Allan deviation, N = {allan.random_walk:.3g} {unit}·√s"
            self._draw("allan", title, unit, "τ, s", allan.tau, allan.deviation)

    def _say(self, words: Markup) -> None:
        self._note = self.html(words, self._note)

    def _draw(self, key: str, title: str, unit: str, across: str, x: Array, y: Array) -> None:
        order = ORDER[key]
        keep = (x > 0) & (y > 0)
        data = (x[keep].astype(float), y[keep].astype(float))
        if len(data[0]) < 2:
            return
        named = tag("span", title, " ", tag("em", f"{unit} over {across}"), class_="gf-title")
        told = json.dumps({"title": title, "unit": unit, "across": across}, ensure_ascii=False)
        heading = str(tag("div", named, class_="gf-chart", data_chart=told))
        if key not in self._plots:
            with self.folder:
                self._headings[key] = self.client.gui.add_html(heading, order=order)
                self._plots[key] = self._plot(data, order)
            return
        if self._headings[key].content != heading:
            self._headings[key].content = heading
        plot = self._plots[key]
        if plot.scales != (scales := _scales(data[0])):
            plot.scales = scales
        plot.data = data

    def _plot(self, data: tuple[Array, Array], order: float) -> viser.GuiUplotHandle:
        points = {"show": False}
        line = {"label": "level", "scale": "level", "stroke": BLUE, "width": 1.6, "points": points}
        return self.client.gui.add_uplot(
            data,
            series=({"label": "x"}, line),
            scales=_scales(data[0]),
            axes=(AXIS | {"size": 26}, AXIS | {"size": 62, "scale": "level"}),
            legend={"show": False},
            height=230,
            padding=(6, 10, 0, 0),
            order=order + 0.5,
        )
