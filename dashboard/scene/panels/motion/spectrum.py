"""Power spectral density and Allan deviation of one signal, of the window that is shown."""

import math
import time
from dataclasses import dataclass
from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray
from scipy.signal import welch

from dashboard.data.device import Device
from dashboard.scene.drawing.page import Markup, note, tag
from dashboard.scene.panels.base import DEG, Panel, Snapshot
from logs.figures.names import BLUE, RATE_UNIT, line_title
from sessions.report.stability import LEAST, allan_of

Array = NDArray[np.float64]
EVERY_S = 2.0  # between two computations
SEGMENTS = 8  # of Welch's method, half over one another, at least; more average more
HOLE = 1.6  # usual periods; a longer pause ends a stretch
# topic, column, unit, factor to it, names of the parts
SOURCES = (
    ("rate", "omega_ib_b", RATE_UNIT, DEG, "xyz"),
    ("rate", "f_b", "m/s²", 1.0, "xyz"),
    ("imu", "omega_ib_b", RATE_UNIT, DEG, "xyz"),
    ("imu", "f_b", "m/s²", 1.0, "xyz"),
    ("tacho", "omega", RATE_UNIT, DEG, ""),
    ("accel", "f", "m/s²", 1.0, ""),
)
SYMBOLS = {"omega_ib_b": "ω", "omega": "ω", "f_b": "f", "f": "a"}


@dataclass(frozen=True)
class Signal:
    """One component of a table."""

    title: str
    topic: str
    estimator: str
    column: str
    part: int | None
    unit: str
    factor: float


def signals(device: Device) -> dict[str, Signal]:
    """What a device has, by its title. Call under the store's lock."""
    found: dict[str, Signal] = {}
    for (topic, estimator), ring in device.rings.items():
        for source, column, unit, factor, parts in SOURCES:
            if source != topic or column not in (ring.dtype.names or ()):
                continue
            width = (ring.dtype[column].shape or (0,))[0]
            for k in range(width) if width else (None,):
                axis = "" if k is None else parts[k] if parts else f"{k // 3 + 1}{k % 3 + 1}"
                who = line_title(estimator or topic)
                title = f"{SYMBOLS[column]}{axis} · {who}"
                found[title] = Signal(title, topic, estimator, column, k, unit, factor)
    return dict(sorted(found.items()))


def unbroken(t: Array, y: Array) -> tuple[Array, float]:
    """The longest stretch of y (n,) without a hole, and its period, s; empty where there is none.

    A value that is not finite is a hole. A spectrum over a hole would be one of the hole.
    """
    good = np.isfinite(y)
    t, y = t[good], y[good]
    if len(t) < 3:
        return y[:0], 0.0
    steps = np.diff(t)
    period = float(np.median(steps))
    cuts = np.concatenate([[0], np.flatnonzero(steps > HOLE * period) + 1, [len(t)]])
    longest = int(np.argmax(np.diff(cuts)))
    at = slice(cuts[longest], cuts[longest + 1])
    count = len(t[at])
    return y[at], float(t[at][-1] - t[at][0]) / max(1, count - 1)


def density(y: Array, period: float) -> tuple[Array, Array]:
    """Frequency, Hz, and one-sided power spectral density, unit²/Hz, by Welch's method (Hann, half
    over one another); without the frequency 0.
    """
    length = max(16, 2 * len(y) // (SEGMENTS + 1))
    f, p = welch(y, fs=1.0 / period, nperseg=min(length, len(y)), detrend="linear")
    return f[1:], p[1:]


def _scales(x: Array) -> dict[str, Any]:
    """Logarithmic scales, x over whole decades.

    Left to itself the chart keeps its limits in shares of the data's span, and these lead to
    negative ones while the span grows; on a logarithmic axis the search for its ticks does not end
    then.
    """
    low = math.floor(math.log10(x[0]))
    high = max(math.ceil(math.log10(x[-1])), low + 1)
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
        return "" if signals(device) else "no samples have come from this device yet"

    def update(self, s: Snapshot) -> None:
        known = signals(s.device)
        if known and tuple(self._choice.options) != tuple(known):
            before = self._choice.value
            self._choice.options = tuple(known)
            self._choice.value = before if before in known else next(iter(known))
        chosen, now = self._choice.value, time.monotonic()
        if chosen not in known or (self._of == chosen and now - self._at < EVERY_S):
            return
        self._of, self._at = chosen, now
        signal = known[chosen]
        t, rows = s.rows(signal.topic, signal.estimator)
        y = rows[signal.column] if signal.part is None else rows[signal.column][:, signal.part]
        y, period = unbroken(np.asarray(t), np.asarray(y) * signal.factor)
        if len(y) < LEAST:
            self._say(note(f"{len(y)} samples without a hole; {LEAST} are needed: wait"))
            return
        rate = f"{len(y)} samples without a hole, {len(y) * period:.1f} s at {1 / period:.1f} Hz"
        self._say(note(rate))
        f, p = density(y, period)
        self._draw("psd", "Spectral density", f"{signal.unit}/√Hz over Hz", f, np.sqrt(p), 2.0)
        allan = allan_of(chosen, y, period)
        if allan is not None:
            title = f"Allan deviation, N = {allan.random_walk:.3g} {signal.unit}·√s"
            self._draw("allan", title, f"{signal.unit} over s", allan.tau, allan.deviation, 4.0)

    def _say(self, words: Markup) -> None:
        self._note = self.html(words, self._note)

    def _draw(self, key: str, title: str, unit: str, x: Array, y: Array, order: float) -> None:
        keep = (x > 0) & (y > 0)
        data = (x[keep].astype(float), y[keep].astype(float))
        if len(data[0]) < 2:
            return
        named = tag("span", title, " ", tag("em", unit), class_="gf-title")
        heading = str(tag("div", named, class_="gf-chart"))
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
            axes=({"size": 26}, {"size": 62, "scale": "level"}),
            legend={"show": False},
            height=230,
            padding=(6, 10, 0, 0),
            order=order + 0.5,
        )
