"""One module per panel. PAGES are the pages of the workspaces in the order of their tabs; the
others stand on the left.
"""

from dashboard.scene.panels.base import Panel, Snapshot
from dashboard.scene.panels.device.board import Board
from dashboard.scene.panels.device.devices import Devices
from dashboard.scene.panels.device.health import Health
from dashboard.scene.panels.device.layout import LayoutBench
from dashboard.scene.panels.device.link import Link
from dashboard.scene.panels.guided.calibration import Calibration
from dashboard.scene.panels.guided.procedure import ProcedurePanel
from dashboard.scene.panels.guided.wiring import Wiring
from dashboard.scene.panels.motion.acceleration import Acceleration
from dashboard.scene.panels.motion.angle import Angle
from dashboard.scene.panels.motion.axes import Axes
from dashboard.scene.panels.motion.derived import Derived
from dashboard.scene.panels.motion.errors import Errors
from dashboard.scene.panels.motion.innovations import Innovations
from dashboard.scene.panels.motion.race import Race
from dashboard.scene.panels.motion.rates import Rates
from dashboard.scene.panels.motion.spectrum import Spectrum
from dashboard.scene.panels.motion.tilt import Tilt
from dashboard.scene.panels.navigation.filters import Navigation
from dashboard.scene.panels.navigation.horizon import Horizon
from dashboard.scene.panels.navigation.position import Position
from dashboard.scene.panels.navigation.sky import SkyPanel
from dashboard.scene.panels.session.record import Record
from dashboard.scene.panels.session.timeline import Timeline

PAGES: tuple[type[Panel], ...] = (
    Rates,
    Acceleration,
    Angle,
    Tilt,
    Race,
    Derived,
    ProcedurePanel,
    Axes,
    Health,
    Innovations,
    Spectrum,
    Link,
    Board,
    Calibration,
    Wiring,
    LayoutBench,
    Position,
    Navigation,
    SkyPanel,
    Horizon,
    Errors,
)

__all__ = ["PAGES", "Devices", "Panel", "Record", "Snapshot", "Timeline"]
