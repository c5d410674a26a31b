"""What the devices of one pipeline share: settings, clocks, cost, orders to hold GNSS back."""

from collections.abc import Callable

from estimator.convert.status import status_message
from estimator.cost import Cost
from estimator.orders.mute import MuteDesk
from estimator.settings import EstimatorSettings
from estimator.stream import Stream
from inertial.navigation.navigation import NavigatorConfig
from inertial.navigation.standstill import AlignmentSettings
from messages.contract import gyrofree_pb2 as pb


def navigator_config(settings: EstimatorSettings, device: str) -> NavigatorConfig:
    """What the navigation filters of a device are told of its vehicle."""
    vehicle = settings.vehicle_of(device)
    alignment = AlignmentSettings(
        standstill=vehicle.align_standstill_s, course_speed=vehicle.align_speed_mps
    )
    return NavigatorConfig(lever_arm_b=vehicle.lever_arm_b_m, alignment=alignment)


class Common:
    """Shared by all kinds; `clock` (ns) measures the cost per sample and touches nothing else."""

    def __init__(self, settings: EstimatorSettings, clock: Callable[[], int], version: str) -> None:
        self.settings = settings
        self.clock = clock
        self.cost = Cost()
        self.mutes = MuteDesk()
        self.clock_offset: dict[str, float] = {}  # s, UTC minus the board's clock, by device
        self._version = version
        self._limits: dict[str, float] = {}  # Hz, by device, where fewer are published than set
        self._second: dict[tuple[str, str], int] = {}

    def heard(self, header: pb.Header) -> None:
        """A batch of samples came: how far the board's clock is from UTC."""
        self.clock_offset[header.device] = header.utc_ns * 1e-9 - header.device_us * 1e-6

    def limit(self, device: str, hz: float) -> None:
        """Publish at most so many estimates of a device per second; 0: as the settings say."""
        if hz > 0.0:
            self._limits[device] = hz
        else:
            self._limits.pop(device, None)

    def limit_hz(self, device: str, usual_hz: float) -> float:
        """How many estimates of a device may be published per second, by the settings usual_hz."""
        return min(usual_hz, self._limits.get(device, usual_hz))

    def new_second(self, device: str, what: str, t_s: float) -> bool:
        """Whether t_s is in another second than the last time for the same device and `what`."""
        second = int(t_s)
        changed = self._second.get((device, what)) != second
        self._second[device, what] = second
        return changed

    def status(self, header: pb.Header, stream: Stream, name: str) -> pb.EstimatorStatus:
        """Health of one estimator, without its state."""
        us = self.cost.take(header.device, name)
        return status_message(header, stream, name, us, self._version)
