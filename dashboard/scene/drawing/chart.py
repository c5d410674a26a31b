"""One uPlot chart of one browser."""

from collections.abc import Sequence

import numpy as np
import viser

from dashboard.scene.drawing.drawn import LATE_HEIGHT, Curve, Drawn, Name, drawn
from dashboard.scene.drawing.page import Markup

# uPlot's own ticks are as long and as strong as the numbers beside them
AXIS = {
    "font": "11px sans-serif",
    "ticks": {"size": 4, "width": 1, "stroke": "#8c8c8c80"},
    "gap": 3,
}


class Chart:
    """A chart inside a container of a client's GUI; show() builds it again only when its set of
    curves changes.
    """

    def __init__(
        self,
        client: viser.ClientHandle,
        folder,
        order: float,
        title: str | Markup,
        unit: str,
        height: int = 190,
        digits: int = 1,
    ) -> None:
        self._client, self._folder, self._order = client, folder, order
        self.name, self._height = Name(title, unit, digits), height
        self._signature: tuple = ()
        self._plot: viser.GuiUplotHandle | None = None
        with folder:
            self._heading = client.gui.add_html("", order=order)

    def clear(self) -> None:
        """Nothing is shown."""
        if self._heading.content:
            self._heading.content = ""
        if self._plot is not None and self._plot.visible:
            self._plot.visible = False

    def draw(self, drawn: Drawn) -> None:
        """Bring this browser's chart to that."""
        if self._heading.content != drawn.heading:
            self._heading.content = drawn.heading
        if not drawn.data:
            if self._plot is not None and self._plot.visible:
                self._plot.visible = False
            return
        if self._plot is None:
            self._build(drawn)
        elif drawn.signature != self._signature:
            # Changed in place: a browser that is behind would complain of an update of a chart
            # already removed.
            self._plot.series, self._plot.bands = drawn.lines, drawn.bands
            _send(self._plot, drawn.data)
        elif not _same(self._plot.data, drawn.data):
            _send(self._plot, drawn.data)
        self._signature = drawn.signature
        if not self._plot.visible:
            self._plot.visible = True

    def show(self, curves: Sequence[Curve], t0: float, t1: float, dark: bool, **options) -> None:
        """Draw the window [t0, t1] of curves; see drawn()."""
        self.draw(drawn(self.name, curves, t0, t1, dark, **options))

    def _build(self, drawn: Drawn) -> None:
        with self._folder:
            self._plot = self._client.gui.add_uplot(
                drawn.data,
                series=drawn.lines,
                bands=drawn.bands,
                scales={
                    "x": {"time": False},
                    "y": {},
                    "gap": {"range": (0, 1)},
                    "strip": {"range": (0, 1 / LATE_HEIGHT)},
                },
                axes=(
                    AXIS | {"size": 42},  # with the origin below the numbers
                    AXIS | {"size": 46},
                ),
                legend={"show": False},
                height=self._height,
                padding=(6, 10, 0, 0),
                order=self._order + 0.5,
            )


def _send(plot: viser.GuiUplotHandle, data: tuple[np.ndarray, ...]) -> None:
    """Set the data in the types that they have: viser's own setter makes 64 bits of each value,
    which its page does not ask for, and which doubles what a browser receives.
    """
    plot._impl.props.data = data
    plot._queue_update("data", data)


def _same(before: Sequence[np.ndarray], now: Sequence[np.ndarray]) -> bool:
    """Is there nothing new to send?"""
    return len(before) == len(now) and all(map(np.array_equal, before, now))
