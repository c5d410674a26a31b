"""What every panel gets and must do."""

import logging
import math
import re
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime

import numpy as np
import viser

from dashboard.data.device import Device
from dashboard.data.store import Store
from dashboard.desk import Desk
from dashboard.scene.drawing.chart import Chart
from dashboard.scene.drawing.drawn import Curve, Drawn, Name, Range, Shade, drawn
from dashboard.scene.drawing.page import Markup, html
from dashboard.scene.drawing.palette import (
    VERMILLION,
    YELLOW,
    estimator_colour,
    estimator_title,
    number,
)
from dashboard.scene.shared import Made, Shared
from logs.figures.sight import WORDS, vouched, worst
from messages.bus.orders import OrderError
from messages.contract import gyrofree_pb2 as pb
from messages.text import plain

log = logging.getLogger(__name__)

DEG = 180.0 / np.pi
CHARTS = 36  # of one page
CURVES = 16  # of one chart
COARSE_S = 0.5  # between two samples of a preview: a stretch of it is named
NO_RATE = "no rate estimator speaks of this device: is `gyrofree estimator` running?"

Input = viser.GuiInputHandle | viser.GuiButtonHandle | viser.GuiButtonGroupHandle


@dataclass(frozen=True)
class Snapshot:
    """One update of a view: the chosen device and the time window of its charts. Valid under the
    store's lock.
    """

    store: Store
    device: Device
    t0: float  # s on the device's axis
    t1: float
    now: float  # time.monotonic(), s; of a replay that is paused, when it was
    dark: bool
    cursors: tuple[float, float] | tuple[()] = ()  # s, of the stretch that is measured
    derived: tuple[str, ...] = ()  # expressions of this browser, as people typed them
    shared: Shared = field(default_factory=Shared)  # with the browsers that show the same

    def once(self, key: Hashable, make: Callable[[], Made]) -> Made:
        """The result of make(), which is the same for every browser that shows this stretch."""
        device = self.device
        mine = (device.name, device.generation, self.t0, self.t1, self.dark, self.cursors)
        return self.shared.once((*mine, self.derived, key), make)

    def rows(self, topic: str, estimator: str = "") -> tuple[np.ndarray, np.ndarray]:
        """Times (n,) s and rows (n,) of a topic inside the window; columns by name (tables.py)."""
        return self.device.window(topic, estimator, self.t0, self.t1)

    def stale(self, topic: str, estimator: str = "") -> bool:
        """True when the newest message is too old."""
        return self.device.stale(topic, estimator, self.now)


class Panel:
    """A page of charts and tables in a folder of one client's GUI; update() is called only while it
    is visible.
    """

    title = ""
    workspace = ""  # key of one of dashboard.scene.workspaces.WORKSPACES
    desk: Desk  # set by the view: how a panel gives orders
    user = ""  # set by the view: who is signed in, as the relay says
    own_inputs: tuple[str, ...] = ()  # labels of inputs that change this browser's own view only
    own_scene = False  # True: the page shows something else than the device in 3-D

    def __init__(self, client: viser.ClientHandle, folder: viser.GuiFolderHandle) -> None:
        self.client, self.folder = client, folder
        self._charts: dict[str, Chart] = {}
        self._shown: set[str] = set()  # of them, since the last tidy
        self._place = 0.0

    @classmethod
    def key(cls) -> str:
        """Its name in links and orders."""
        return re.sub(r"[^a-z0-9]+", "-", cls.title.lower()).strip("-")

    @classmethod
    def missing(cls, device: Device) -> str:
        """Why there is nothing to see here of a device, for people; empty: there is. Call under
        the store's lock.
        """
        return ""

    def order_estimator(self, title: str, command: pb.EstimatorCommand) -> None:
        """Give the order and show the person who pressed the button what came of it."""
        try:
            reply = self.desk.estimator(command)
            text, good = reply.message, reply.ok
        except OrderError as error:  # shown to the person who pressed the button
            log.warning("%s: %s", title, error)
            text, good = str(error), False
        title = title if good else "The estimator did not do it"
        self.client.add_notification(
            title, plain(text), color="teal" if good else "red", auto_close_seconds=8.0
        )

    def chart(self, key: str, title: str, unit: str, height: int = 170, digits: int = 1) -> Chart:
        """The chart of this key, made at first use below the ones before it; where there are
        CHARTS of them, one that nobody shows any more.
        """
        found = self._charts.get(key)
        if found is None and len(self._charts) >= CHARTS:
            old = next((one for one in self._charts if one not in self._shown), None)
            if old is not None:
                found = self._charts[key] = self._charts.pop(old)
        if found is None:
            self._place += 2.0
            found = Chart(self.client, self.folder, self._place, title, unit, height, digits)
            self._charts[key] = found
        found.name = Name(title, unit, digits)
        return found

    def show(
        self,
        key: str,
        title: str,
        unit: str,
        curves: Sequence[Curve] | Callable[[], Sequence[Curve]],
        s: Snapshot,
        shades: Callable[[], Sequence[Shade]] = tuple,
        **options,
    ) -> None:
        """Draw a chart for the window of the snapshot; one too many is left out, as are curves.

        Curves and shades that are given as functions are asked for once for all browsers that show
        the same.
        """
        if key not in self._shown and len(self._shown) >= CHARTS:
            return
        self._shown.add(key)
        chart = self.chart(key, title, unit, **options)

        def made() -> Drawn:
            return drawn(
                chart.name,
                (curves() if callable(curves) else curves)[:CURVES],
                s.t0,
                s.t1,
                s.dark,
                late=s.device.late,
                thin=s.device.thin,
                ranges=ranges(s.device),
                cursors=s.cursors,
                origin=f"s since {when(s.device.utc0_ns)} UTC",
                shades=shades(),
            )

        # what a person has chosen on this page may change its charts
        chart.draw(made() if self.own_inputs else s.once((type(self), key), made))

    def html(self, content: Markup, handle: viser.GuiHtmlHandle | None) -> viser.GuiHtmlHandle:
        """Set an HTML element's content when it changed; make it at first use. What is no Markup is
        shown as text.
        """
        content = str(html(content))
        if handle is None:
            with self.folder:
                return self.client.gui.add_html(content, order=1.0)  # above the charts
        if handle.content != content:
            handle.content = content
        return handle

    @property
    def orders(self) -> tuple[Input, ...]:
        """Inputs that do more than change this browser's own view: a viewer may not use them."""
        return ()

    @property
    def always(self) -> tuple[Input, ...]:
        """Of the orders, those that an operator may give whoever has the command."""
        return ()

    def update(self, s: Snapshot) -> None:
        """Bring the page to the state of the snapshot."""
        raise NotImplementedError

    def tidy(self) -> None:
        """Empty the charts that the last update did not show: of another device, of a filter that
        is gone.
        """
        for key, chart in self._charts.items():
            if key not in self._shown:
                chart.clear()
        self._shown.clear()

    def hide(self) -> None:
        """Another page was opened."""


def when(utc_ns: int) -> str:
    """A moment for people, UTC."""
    moment = datetime.fromtimestamp(utc_ns * 1e-9, UTC) if 0 <= utc_ns < 1 << 62 else None
    return "?" if moment is None else f"{moment:%Y-%m-%d %H:%M:%S}"


def from_zero(device: Device, name: str) -> str:
    """What the angle of a rate estimator counts from, in words; empty where nobody says."""
    status = device.get("estimator", name)
    began_ns = 0 if status is None else status.message.began_utc_ns
    return f"from 0 at {when(began_ns)[11:]} UTC" if began_ns else ""


def shades_of(t: np.ndarray, sight: np.ndarray) -> list[Shade]:
    """Where an estimator does not vouch for a component (docs/estimators.md)."""
    colours = {"ambiguous": YELLOW, "blind": VERMILLION}
    return [Shade(word, colours[word], t, sight == WORDS.index(word)) for word in colours]


def rms(error: np.ndarray, sight: np.ndarray | None = None) -> float:
    """Of the errors (n,) of what the estimator vouches for; NaN without any."""
    known = vouched(error, sight)
    known = known[np.isfinite(known)]
    return float(np.sqrt(np.mean(known**2))) if len(known) else float("nan")


def rms_text(error: np.ndarray, sight: np.ndarray, unit: str = "") -> str:
    """Root mean square of the errors (n,) of what the estimator vouches for, and how much of it
    that is; a word where it vouches for nothing.
    """
    there = np.isfinite(error)
    unsure = worst(sight[there])
    share = float(np.mean(~(sight[there] > 0))) if there.any() else 0.0
    if unsure and not share:
        return unsure
    shown = number(rms(error, sight), 2, unit)
    return f"{shown} · {math.floor(100 * share)} % valid" if unsure else shown


def ranges(device: Device) -> list[Range]:
    """Notes, what was filled in, and the steps of a procedure that runs, on the device's axis."""
    found = [Range(at, at, text[:60]) for at, text in device.marks]
    found += [Range(begin, end, "filled in", "late") for begin, end in device.late]
    found += [
        Range(begin, end, f"coarse: one sample in {every_s:.3g} s", "coarse")
        for begin, end, every_s in device.thin
        if every_s >= COARSE_S
    ]
    procedure = device.get("procedure")
    for step in procedure.message.steps if procedure is not None else ():
        if step.from_utc_ns and step.until_utc_ns >= step.from_utc_ns:
            begin, end = (
                (at - device.utc0_ns) * 1e-9 for at in (step.from_utc_ns, step.until_utc_ns)
            )
            found.append(Range(begin, end, step.name[:60], "step"))
    return found + alarm_ranges(device)


def alarm_ranges(device: Device) -> list[Range]:
    """What is wrong, or was within the last minutes."""
    heard, found = device.get("alarm"), []
    for one in heard.message.alarms if heard is not None else ():
        begin = (one.raised_utc_ns - device.utc0_ns) * 1e-9
        until = (one.returned_utc_ns - device.utc0_ns) * 1e-9
        end = until if one.returned_utc_ns else max(begin, device.t_newest)
        if one.raised_utc_ns and end >= begin:
            found.append(Range(begin, end, plain(one.title, 60), "alarm"))
    return found


def estimator_curve(
    s: Snapshot,
    topic: str,
    name: str,
    t: np.ndarray,
    y: np.ndarray,
    half: np.ndarray | None = None,
    sight: np.ndarray | None = None,
) -> Curve:
    """A curve in the colour and under the title of an estimator."""
    colour = estimator_colour(name, s.device.estimators(topic))
    stale = s.stale(topic, name)
    return Curve(estimator_title(name), colour, t, y, half, stale=stale, sight=sight)
