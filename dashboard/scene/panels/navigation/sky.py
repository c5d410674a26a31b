"""The satellites that the receiver sees: where they stand, how well they are heard, which are
used.
"""

from dashboard.data.device import Device
from dashboard.scene.drawing.page import alert, tag
from dashboard.scene.drawing.sky import legend, said, sky_svg, table
from dashboard.scene.panels.base import Panel, Snapshot

WANTED = "switch on NMEA GSV and GSA, or UBX NAV-SAT"


class SkyPanel(Panel):
    """Sky plot and a table of the systems."""

    title = "Sky"
    workspace = "navigate"
    _top = None

    @classmethod
    def missing(cls, device: Device) -> str:
        if device.get("sky"):
            return ""
        if device.get("gnss"):
            return f"the receiver does not say which satellites it sees: {WANTED}"
        return "no GNSS receiver speaks of this device"

    def update(self, s: Snapshot) -> None:
        latest = s.device.get("sky")
        if latest is None:
            self._top = self.html(alert(f"{self.missing(s.device)}."), self._top)
            return
        seen, stale = latest.message.satellites, s.stale("sky")
        late = alert(f"The receiver last said this {latest.age(s.now):.0f} s ago.") if stale else ""
        title = tag("p", f"{said(seen)} (by {latest.message.talker})", class_="gf-title")
        drawing = tag("div", sky_svg(seen, s.dark), class_="gf-stale" if stale else None)
        self._top = self.html(title + late + drawing + legend() + table(seen, stale), self._top)
