"""Which stretch of time the charts of one browser show: the newest data, a frozen moment of them,
or a zoom that stays where it is while data come in.
"""

from dataclasses import dataclass

from dashboard.data.device import Device
from dashboard.scene.shared import Shared

WINDOWS = {"10": 10.0, "30": 30.0, "60": 60.0, "300": 300.0, "600": 600.0}  # s
LEAST_S = 0.01  # of a zoom


@dataclass
class Span:
    """The window that follows the data, unless it is paused or zoomed."""

    window: str = "30"  # key of WINDOWS
    paused_at: float | None = None  # s on the device's axis
    zoom: tuple[float, float] | tuple[()] = ()  # UTC, s: so that a link means the same moment

    def ask(self, window: str | None, zoom: tuple[float, float] | tuple[()] | None) -> None:
        """What a person asks for; None: as it is."""
        self.window = window or self.window
        self.zoom = self.zoom if zoom is None else zoom

    def limits(self, device: Device) -> tuple[float, float]:
        """From and until, s on the device's axis."""
        if self.zoom:
            utc0 = device.utc0_ns * 1e-9
            return self.zoom[0] - utc0, max(self.zoom[1], self.zoom[0] + LEAST_S) - utc0
        t1 = device.t_newest if self.paused_at is None else self.paused_at
        t0 = max(t1 - WINDOWS[self.window], device.t_first)
        return t0, max(t1, t0 + 1.0)

    def in_round(self, device: Device, shared: Shared) -> tuple[float, float]:
        """Likewise, for all browsers of one round: data that come meanwhile wait for the next."""
        key = (device.name, device.generation, self.window, self.paused_at, self.zoom)
        return shared.once(key, lambda: self.limits(device))

    def stated(self, device: Device | None) -> dict[str, object]:
        """For the page around the scene; `kept`: data of the zoom are still held here."""
        if device is None:
            return {"utc0": 0.0, "zoom": list(self.zoom), "kept": True}
        t0, t1 = self.limits(device)
        oldest = [ring.rows()["t"][0] for ring in device.rings.values() if ring.count]
        kept = t1 >= min(oldest, default=t0) and t0 <= device.t_newest
        return {"utc0": device.utc0_ns * 1e-9, "zoom": list(self.zoom), "kept": kept}
