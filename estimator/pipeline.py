"""The whole service without the bus: messages in, messages out, by device.

What a Pipeline returns is a function of the messages given to it, in their order, and of nothing
else, so that a recording sent through it again gives the same bytes. Only EstimatorStatus carries a
measured duration and is left out of such a comparison. What happens to a message is said by the
file of the device's kind: kinds/cube.py, kinds/six_axis.py, kinds/vehicle.py, kinds/tilt.py.
"""

import time
from collections.abc import Callable
from importlib import metadata

from google.protobuf.message import Message

from estimator.choice import check_settings, make_layout
from estimator.convert.samples import fix_of
from estimator.devices.navigation import NavBoard
from estimator.kinds.common import Common
from estimator.kinds.cube import Cube
from estimator.kinds.six_axis import SixAxis
from estimator.orders import wiring as wiring_orders
from estimator.orders.calibration import CalibrationDesk
from estimator.output import Output
from estimator.settings import EstimatorSettings
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import (
    CALIBRATION,
    MUTE,
    PIPELINE_INPUTS,
    PIPELINE_ORDERS,
    WIRING,
    Topic,
)

VERSION = metadata.version("gyrofree")  # once: it reads files


class Pipeline:
    """All estimators of all devices."""

    def __init__(
        self, settings: EstimatorSettings, clock: Callable[[], int] = time.perf_counter_ns
    ) -> None:
        """`clock` (ns) measures the cost per sample for EstimatorStatus and touches nothing else.

        Raises UnknownEstimator for settings that name one that does not exist.
        """
        check_settings(settings)
        self._settings = settings
        self._common = Common(settings, clock, VERSION)
        self._calibrations = CalibrationDesk(settings.cards)
        self._axes = wiring_orders.load(settings)
        self._cubes: dict[str, Cube] = {}
        self._six_axes: dict[str, SixAxis] = {}

    def on(self, topic: Topic, message: Message) -> list[Output]:
        """Take one message of any topic; raises BadMessage for one that cannot be used."""
        if topic not in PIPELINE_INPUTS and topic not in PIPELINE_ORDERS:
            return []
        return getattr(self, f"on_{topic.name}")(message)

    def on_accel(self, batch: pb.AccelBatch) -> list[Output]:
        """Readings of a cube's axes."""
        device = batch.header.device
        if device not in self._cubes:
            self._cubes[device] = Cube(device, self._common, self._calibrations)
        return self._cubes[device].take(batch)

    def on_imu(self, batch: pb.ImuBatch) -> list[Output]:
        """Specific force and rate of a six-axis board."""
        return self._six_axis(batch.header.device).imu(batch)

    def on_adc(self, batch: pb.AdcBatch) -> list[Output]:
        """Counts of an analogue six-axis board."""
        return self._six_axis(batch.header.device).adc(batch)

    def forget(self, device: str) -> None:
        """Begin a device anew with its next message."""
        self._cubes.pop(device, None)
        self._six_axes.pop(device, None)

    def limit(self, device: str, hz: float) -> None:
        """Publish at most so many estimates of a device per second from now on; 0: as the settings
        say. Filters go on taking every sample.
        """
        self._common.limit(device, hz)

    def _six_axis(self, device: str) -> SixAxis:
        if device not in self._six_axes:
            self._six_axes[device] = SixAxis(device, self._common, self._axes)
        return self._six_axes[device]

    def on_tacho(self, message: pb.TachoRate) -> list[Output]:
        """A report of the tachometer: table runs of a guided calibration need it, what watches the
        settings, and the rate where it aids.
        """
        self._calibrations.tacho(message)
        cube = self._cubes.get(message.header.device)
        if cube is not None:
            cube.tacho(message)
        return []

    def on_gnss(self, message: pb.GnssFix) -> list[Output]:
        """Keep the fix; its corrections come out with the samples that pass its arrival."""
        device, offsets = message.header.device, self._common.clock_offset
        cube = self._cubes.get(device)
        if cube is not None:
            cube.expect_fixes()
        board = self._navigation(device)
        if board is not None and device in offsets:
            board.fix(fix_of(message, self._settings.use_every_fix, offsets[device]))
        return []

    def on_mute(self, message: pb.GnssMute) -> list[Output]:
        """An outage that was ordered when the recording was made."""
        self._common.mutes.take(message)
        return []

    def order(self, command: pb.EstimatorCommand) -> tuple[pb.Reply, list[Output]]:
        """Do what a person asked the estimator of a device for; never raises for an order that
        cannot be followed.
        """
        if command.action == pb.EstimatorCommand.ACTION_MUTE_GNSS:
            return self._mute(command)
        if command.action in wiring_orders.ACTIONS:
            return self._wire(command)
        return self._calibrate(command)

    def _mute(self, command: pb.EstimatorCommand) -> tuple[pb.Reply, list[Output]]:
        device, common = command.device, self._common
        offset = common.clock_offset.get(device, 0.0)
        reply, mute = common.mutes.order(command, self._navigation(device), offset)
        return reply, [] if mute is None else [Output(MUTE, device, "", mute)]

    def _wire(self, command: pb.EstimatorCommand) -> tuple[pb.Reply, list[Output]]:
        device, before = command.device, self._axes.used.get(command.device)
        reply, status = self._axes.order(command)
        if self._axes.used.get(device) is not before and device in self._six_axes:
            self._six_axes[device].begin_anew()
        return reply, [] if status is None else [Output(WIRING, device, "", status)]

    def _calibrate(self, command: pb.EstimatorCommand) -> tuple[pb.Reply, list[Output]]:
        device, desk = command.device, self._calibrations
        before = desk.used.get(device)
        reply, status = desk.order(command, make_layout(self._settings.layout_of(device)))
        changed = desk.used.get(device) is not before
        use = command.action == pb.EstimatorCommand.ACTION_USE_CARD
        if (changed or use) and device in self._cubes:
            self._cubes[device].begin_anew()
        return reply, [] if status is None else [Output(CALIBRATION, device, "", status)]

    def _navigation(self, device: str) -> NavBoard | None:
        """Where fixes of a device go: its inertial unit, else its accelerometers where that is
        asked for.
        """
        six_axis, cube = self._six_axes.get(device), self._cubes.get(device)
        board = None if six_axis is None else six_axis.navigation
        return board if board is not None or cube is None else cube.navigation
