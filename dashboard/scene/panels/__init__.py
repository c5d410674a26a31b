"""One module per panel. PAGES are the pages of charts in the order of their tabs; the others stand
on the left.
"""

from dashboard.scene.panels.acceleration import Acceleration
from dashboard.scene.panels.angle import Angle
from dashboard.scene.panels.axes import Axes
from dashboard.scene.panels.base import Panel, Snapshot
from dashboard.scene.panels.board import Board
from dashboard.scene.panels.calibration import Calibration
from dashboard.scene.panels.devices import Devices
from dashboard.scene.panels.errors import Errors
from dashboard.scene.panels.health import Health
from dashboard.scene.panels.horizon import Horizon
from dashboard.scene.panels.innovations import Innovations
from dashboard.scene.panels.layout import LayoutBench
from dashboard.scene.panels.link import Link
from dashboard.scene.panels.navigation import Navigation
from dashboard.scene.panels.position import Position
from dashboard.scene.panels.race import Race
from dashboard.scene.panels.rates import Rates
from dashboard.scene.panels.record import Record
from dashboard.scene.panels.tilt import Tilt
from dashboard.scene.panels.timeline import Timeline
from dashboard.scene.panels.wiring import Wiring

PAGES: tuple[type[Panel], ...] = (
    Rates,
    Axes,
    Acceleration,
    Angle,
    Position,
    Navigation,
    Horizon,
    Errors,
    Innovations,
    Link,
    Board,
    Health,
    LayoutBench,
    Calibration,
    Wiring,
    Tilt,
    Race,
)

__all__ = ["PAGES", "Devices", "Panel", "Position", "Record", "Snapshot", "Tilt", "Timeline"]
