"""The estimator process: samples in, motion out. A shell; the thinking is in the modules beside it.

Pipeline is the whole service without the bus: what it returns is a function of the messages given
to it, in their order, and of nothing else, so that a recording sent through it again gives the same
bytes. Only EstimatorStatus carries a measured duration and is left out of such a comparison.
"""

import logging
import threading
import time
from collections.abc import Callable
from importlib import metadata
from typing import Any, NamedTuple

import numpy as np
from google.protobuf.message import Message

from estimator import convert
from estimator.choice import (
    UnknownEstimator,
    beliefs,
    check_names,
    load_card,
    make_layout,
    rate_estimators,
)
from estimator.cost import Cost
from estimator.devices.attitude import AttitudeBoard
from estimator.devices.gyro_free import GyroFreeNavigation
from estimator.devices.navigation import NavBoard, NavOutput
from estimator.devices.rate import RateBoard, RateOutput, WrongAxes
from estimator.orders import wiring as wiring_orders
from estimator.orders.calibration import CalibrationDesk
from estimator.orders.mute import MuteDesk
from estimator.rate_messages import BoardMessages, RateMessages
from estimator.settings import EstimatorSettings
from estimator.stream import Stream, every
from inertial.attitude.axis_map import MapError
from inertial.attitude.filters import ATTITUDES
from inertial.calibration.card import CardError
from inertial.navigation.navigation import NAVIGATORS, Correction, NavigatorConfig
from messages.bus.session import BusSettings
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import (
    ATTITUDE,
    AXES,
    CALIBRATION,
    ESTIMATOR,
    INNOVATION,
    MUTE,
    NAV,
    PIPELINE_INPUTS,
    PIPELINE_ORDERS,
    POSE,
    RATE,
    WIRING,
    Topic,
)

log = logging.getLogger(__name__)

POSE_HZ = 20.0
VERSION = metadata.version("gyrofree")  # once: it reads files
Batch = pb.AccelBatch | pb.ImuBatch | pb.AdcBatch

__all__ = ["Output", "Pipeline", "UnknownEstimator", "make_layout", "run"]


class Output(NamedTuple):
    """One message to publish."""

    topic: Topic
    device: str
    estimator: str
    message: Message


class Pipeline:
    """All estimators of all devices."""

    def __init__(
        self, settings: EstimatorSettings, clock: Callable[[], int] = time.perf_counter_ns
    ) -> None:
        """`clock` (ns) measures the cost per sample for EstimatorStatus and touches nothing else.

        Raises UnknownEstimator for settings that name one that does not exist.
        """
        check_names("rate", settings.rate, rate_estimators())
        check_names("navigators", settings.navigators, NAVIGATORS)
        check_names("attitudes", settings.attitudes, ATTITUDES)
        check_names("gyro_free_navigation", settings.gyro_free_navigation, NAVIGATORS)
        if settings.gyro_free_navigation:
            check_names("gyro_free_rate", [settings.believed_rate], dict.fromkeys(settings.rate))
        for layout in (settings.layout, *settings.layouts.values()):
            if layout.file:  # a wrong file is refused at the start, not at the first sample
                make_layout(layout)
        for path in filter(None, (settings.calibration, *settings.calibrations.values())):
            load_card(path)
        self._settings = settings
        self._clock = clock
        self._boards: dict[str, RateBoard] = {}
        self._messages: dict[str, BoardMessages] = {}
        self._vehicles: dict[str, NavBoard] = {}
        self._gyro_free: dict[str, GyroFreeNavigation] = {}
        self._attitudes: dict[str, AttitudeBoard] = {}
        self._mutes = MuteDesk()
        self._clock_offset: dict[str, float] = {}
        self._desk = CalibrationDesk(settings.cards)
        self._axes = wiring_orders.load(settings)
        self._cost = Cost()
        self._second: dict[tuple[str, str], int] = {}

    def on(self, topic: Topic, message: Message) -> list[Output]:
        """Take one message of any topic; raises convert.BadMessage for one that cannot be used."""
        handler = (
            getattr(self, f"on_{topic.name}")
            if topic in PIPELINE_INPUTS or topic in PIPELINE_ORDERS
            else None
        )
        return handler(message) if handler else []

    def order(self, command: pb.EstimatorCommand) -> tuple[pb.Reply, list[Output]]:
        """Do what a person asked the estimator of a device for; never raises for an order that
        cannot be followed.
        """
        if command.action == pb.EstimatorCommand.ACTION_MUTE_GNSS:
            offset = self._clock_offset.get(command.device, 0.0)
            reply, mute = self._mutes.order(command, self._navigating(command.device), offset)
            return reply, [] if mute is None else [Output(MUTE, command.device, "", mute)]
        if command.action in wiring_orders.ACTIONS:
            return self._wire(command)
        device, before = command.device, self._desk.used.get(command.device)
        reply, status = self._desk.order(command, make_layout(self._settings.layout_of(device)))
        if (
            self._desk.used.get(device) is not before
            or command.action == pb.EstimatorCommand.ACTION_USE_CARD
        ):
            self._boards.pop(device, None)  # the estimators begin anew with the other card
        return reply, [] if status is None else [Output(CALIBRATION, device, "", status)]

    def _wire(self, command: pb.EstimatorCommand) -> tuple[pb.Reply, list[Output]]:
        device, before = command.device, self._axes.used.get(command.device)
        reply, status = self._axes.order(command)
        if self._axes.used.get(device) is not before:  # the filters begin anew with the other axes
            self._vehicles.pop(device, None)
            self._attitudes.pop(device, None)
        return reply, [] if status is None else [Output(WIRING, device, "", status)]

    def on_mute(self, message: pb.GnssMute) -> list[Output]:
        """An outage that was ordered when the recording was made."""
        self._mutes.take(message)
        return []

    def on_tacho(self, message: pb.TachoRate) -> list[Output]:
        """A report of the tachometer: table runs of a guided calibration need it."""
        self._desk.tacho(message)
        if (
            self._settings.tacho_aid
            and (board := self._boards.get(message.header.device)) is not None
        ):
            board.tacho(*convert.tacho_report(message))
        return []

    def on_accel(self, batch: pb.AccelBatch) -> list[Output]:
        """Rate estimates, poses and, once per second of data, the health of each estimator."""
        samples = convert.accel_samples(batch)
        device = batch.header.device
        board = self._boards.get(device)
        if board is None:
            board = self._boards[device] = self._board(device)
            self._messages[device] = BoardMessages(device, board.layout)
        started = self._clock()
        try:
            states = board.feed(
                batch.header.epoch,
                batch.first_index,
                batch.period_s,
                samples.t_s,
                samples.values,
                batch.stale_mask,
            )
        except WrongAxes as error:
            raise convert.BadMessage(str(error)) from None
        self._cost.add(device, self._clock() - started, len(samples.t_s))
        out = self._estimates(batch, board, states)
        last_s = float(samples.t_s[-1])
        axes_due, due = (
            self._new_second(device, "axes", AXES.rate * last_s),
            self._new_second(device, "accel", last_s),
        )
        if axes_due or due:
            header = convert.sample_header(batch.header, (len(samples.t_s) - 1) * batch.period_s)
        if axes_due:
            out.append(
                Output(AXES, device, "", self._messages[device].axes(header, board.health, last_s))
            )
        if due:
            for name in self._settings.rate:
                out.append(Output(ESTIMATOR, device, name, self._rate_status(header, board, name)))
        status = self._desk.feed(batch, samples, board.wiring)
        if status is not None:
            out.append(Output(CALIBRATION, device, "", status))
        self._clock_offset[device] = batch.header.utc_ns * 1e-9 - batch.header.device_us * 1e-6
        navigation = self._gyro_free.get(device)
        if navigation is not None:
            said = navigation.feed(batch.header.epoch, batch.period_s, samples.t_s, states)
            out += self._navigated(batch, samples, navigation.board, said, navigation.names)
        return out

    def _estimates(
        self, batch: pb.AccelBatch, board: RateBoard, states: list[RateOutput]
    ) -> list[Output]:
        """States as messages, and poses now and then."""
        device, step, out = board.device, every(batch.period_s, POSE_HZ), []
        shared = self._messages[device]
        estimates = RateMessages(batch, "" if board.card is None else board.card.id, shared.shared)
        for row, index, name, state in states:
            out.append(Output(RATE, device, name, estimates.estimate(row, index, name, state)))
            if index % step == step - 1:
                utc_ns = out[-1].message.header.utc_ns
                out.append(Output(POSE, device, name, shared.pose(name, utc_ns, state.q_nb)))
        return out

    def _board(self, device: str) -> RateBoard:
        """Rate estimators of a device, with its calibration card; raises convert.BadMessage for
        another layout's.
        """
        s, path = self._settings, self._settings.card_of(device)
        card = self._desk.used.get(device, load_card(path) if path is not None else None)
        layout = make_layout(s.layout_of(device))
        try:
            return RateBoard(device, layout, s.rate, s.rate_limit_hz, card, beliefs(s))
        except CardError as error:
            raise convert.BadMessage(f"{device}: {error}") from None

    def on_imu(self, batch: pb.ImuBatch) -> list[Output]:
        """What the filters make of a batch, by the axis map in use; a map of the converter's inputs
        leaves it out.
        """
        samples, rates = convert.imu_samples(batch)
        device = batch.header.device
        if device not in self._axes.used and not self._axes.wants(device, "imu"):
            return self._inertial(batch, samples, rates)
        columns = np.hstack([samples.values, rates])
        out = self._watch(batch, "imu", columns)
        if device in self._axes.used:
            return out + self._mapped(batch, samples.t_s, columns, "imu")
        return out + self._inertial(batch, samples, rates)

    def on_adc(self, batch: pb.AdcBatch) -> list[Output]:
        """Counts of an analogue board: for a guided detection, and for the filters where a map of
        inputs is used.
        """
        if not self._axes.wants(batch.header.device, "adc"):
            return []
        samples = convert.adc_samples(batch)
        out = self._watch(batch, "adc", samples.values)
        return out + self._mapped(batch, samples.t_s, samples.values, "adc")

    def _watch(self, batch: Batch, source: str, values: Any) -> list[Output]:
        status = self._axes.feed(batch, source, values)
        return [] if status is None else [Output(WIRING, batch.header.device, "", status)]

    def _mapped(self, batch: Batch, t_s: Any, values: Any, source: str) -> list[Output]:
        used = self._axes.used.get(batch.header.device)
        if used is None or used.source != source:
            return []
        try:
            force, rates = used.apply(values)
        except MapError as error:
            raise convert.BadMessage(f"{batch.header.device}: {error}") from None
        return self._inertial(batch, convert.Samples(t_s, force), rates)

    def _inertial(self, batch: Batch, samples: convert.Samples, rates: Any) -> list[Output]:
        """Solutions, poses, corrections that became due and, once per second of data, the health of
        each filter.
        """
        device = batch.header.device
        board = self._vehicles.get(device)
        if board is None:
            config = NavigatorConfig(lever_arm_b=self._settings.vehicle_of(device).lever_arm_b_m)
            board = NavBoard(device, config, self._settings.navigators, self._settings.nav_limit_hz)
            self._vehicles[device] = self._mutes.attend(device, board)
        self._clock_offset[device] = batch.header.utc_ns * 1e-9 - batch.header.device_us * 1e-6
        started = self._clock()
        said = board.feed(
            batch.header.epoch,
            batch.first_index,
            batch.period_s,
            samples.t_s,
            samples.values,
            rates,
        )
        self._cost.add(device, self._clock() - started, len(samples.t_s))
        out = self._navigated(batch, samples, board, said, self._settings.navigators)
        return out + self._tilt(batch, samples.values, rates)

    def _navigated(
        self,
        batch: Batch,
        samples: convert.Samples,
        board: NavBoard,
        said: list[NavOutput],
        names: list[str],
    ) -> list[Output]:
        """What navigation filters said, as messages; once per second of data their health."""
        device, out = batch.header.device, []
        for o in said:
            if isinstance(o.what, Correction):
                header = convert.sample_header(batch.header, o.what.fix.t - samples.t_s[0])
                out.append(
                    Output(
                        INNOVATION,
                        device,
                        o.estimator,
                        convert.innovation_message(header, o.estimator, o.what),
                    )
                )
                continue
            header = convert.sample_header(batch.header, o.row * batch.period_s)
            nav = convert.nav_message(
                header, batch, o.index, o.estimator, o.what, board.muted(o.what.t)
            )
            out.append(Output(NAV, device, o.estimator, nav))
            pose = convert.pose_message(header, o.estimator, o.what.p_ned, o.what.q_nb)
            out.append(Output(POSE, device, o.estimator, pose))
        if board.navigators and self._new_second(device, "nav", samples.t_s[-1]):
            header = convert.sample_header(batch.header, (len(samples.t_s) - 1) * batch.period_s)
            for name in names:
                out.append(Output(ESTIMATOR, device, name, self._nav_status(header, board, name)))
        return out

    def _tilt(self, batch: pb.ImuBatch, f_b: Any, omega_b: Any) -> list[Output]:
        """Attitude of every tilt filter."""
        header, device = batch.header, batch.header.device
        if device not in self._attitudes:
            self._attitudes[device] = AttitudeBoard(
                device, self._settings.attitudes, self._settings.attitude_limit_hz
            )
        out = []
        for o in self._attitudes[device].feed(
            header.epoch, batch.first_index, batch.period_s, f_b, omega_b
        ):
            then = convert.sample_header(header, o.row * batch.period_s)
            message = convert.attitude_message(then, batch, o.index, o.estimator, o.state)
            out.append(Output(ATTITUDE, device, o.estimator, message))
        return out

    def on_gnss(self, message: pb.GnssFix) -> list[Output]:
        """Keep the fix; its corrections come out of on_imu, when samples have passed its
        arrival.
        """
        device = message.header.device
        if (
            device in self._boards
            and device not in self._gyro_free
            and self._settings.gyro_free_navigation
        ):
            self._gyro_free[device] = self._gyro_free_navigation(device)
            self._mutes.attend(device, self._gyro_free[device].board)
        board = self._navigating(device)
        if board is not None and device in self._clock_offset:
            fix = convert.fix_of(message, self._settings.use_every_fix, self._clock_offset[device])
            board.fix(fix)
        return []

    def _navigating(self, device: str) -> NavBoard | None:
        """Where fixes of a device go: its inertial unit, else its accelerometers where that is
        asked for.
        """
        gyro_free = self._gyro_free.get(device)
        return self._vehicles.get(device, gyro_free.board if gyro_free else None)

    def _gyro_free_navigation(self, device: str) -> GyroFreeNavigation:
        s = self._settings
        config = NavigatorConfig(lever_arm_b=s.vehicle_of(device).lever_arm_b_m)
        names = s.gyro_free_navigation
        return GyroFreeNavigation(
            device, config, names, s.nav_limit_hz, s.believed_rate, s.rate_limit_hz
        )

    def _nav_status(self, header: pb.Header, board: NavBoard, name: str) -> pb.EstimatorStatus:
        return convert.navigator_state(
            self._status(header, board.stream, name), board.navigators[name]
        )

    def _new_second(self, device: str, what: str, t_s: float) -> bool:
        second = int(t_s)
        changed = self._second.get((device, what)) != second
        self._second[device, what] = second
        return changed

    def _rate_status(self, header: pb.Header, board: RateBoard, name: str) -> pb.EstimatorStatus:
        status = convert.rate_state(self._status(header, board.stream, name), board.last[name])
        status.layout, status.us_per_sample = board.layout.name, board.cost_us(name)
        return status

    def _status(self, header: pb.Header, stream: Stream, name: str) -> pb.EstimatorStatus:
        return convert.status_message(
            header, stream, name, self._cost.take(header.device, name), VERSION
        )


def run(settings: EstimatorSettings, bus: BusSettings, stop: threading.Event) -> None:
    """Estimate on the bus until `stop` is set; raises what made the worker fail."""
    from estimator.live import run as live  # it needs the pipeline of this module

    live(settings, bus, stop)
