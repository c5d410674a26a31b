"""Where the panels of one browser stand, by the width of its page."""

import math

import viser

from dashboard.scene.style import LEFT_WIDTH

# px, of the summary and of the charts: phone, tablet upright, tablet across, desk
WIDTHS = {"s": (300.0, 470.0), "n": (340.0, 340.0), "m": (270.0, 380.0), "l": (LEFT_WIDTH, 470.0)}
MOVED_S = 0.8  # after which the browser has moved its panels, and the scene has its new shape


class Fitting:
    """A phone has one sheet over the lower part of the scene; a narrow page has one column beside
    the scene, the summary above the charts; others have a panel at either side.
    """

    def __init__(self, client: viser.ClientHandle, panel: viser.PanelHandle) -> None:
        """panel: of the charts. It is docked as on a desk."""
        self._client, self._panel, self.size = client, panel, "l"
        self._moved_at = math.inf
        panel.dock_right()
        panel.set_width(WIDTHS["l"][1])

    @property
    def sheet(self) -> bool:
        """Do panels lie over the scene?"""
        return self.size == "s"

    def become(self, size: str, now: float) -> None:
        """Fit a page of this size; now: monotonic, s."""
        if size not in WIDTHS or size == self.size:
            return
        summary, charts = self._client.gui.main_panel, self._panel
        if "n" in (size, self.size):
            charts.dock_right()
            if size == "n":
                summary.dock_above(charts)
            else:
                summary.dock_left()
        for panel, width in zip((summary, charts), WIDTHS[size], strict=True):
            panel.set_width(width)
        if size == "s":
            charts.expand()
        self.size, self._moved_at = size, now + MOVED_S

    def moved(self, now: float) -> bool:
        """Once, when the scene has its new shape."""
        if now < self._moved_at:
            return False
        self._moved_at = math.inf
        return True
