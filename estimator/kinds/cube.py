"""Accelerometers on a rigid body without gyroscopes, mostly the cube.

In: AccelBatch; TachoRate where the tachometer aids; fixes for navigation without gyroscopes.
Estimators: the rate estimators of [estimator] rate, side by side (devices/rate.py), the axis health
monitor, a guided calibration while one runs, and navigation on the cube's own rate where it is
asked for (devices/gyro_free.py).
Out: RateBatch, pose, AxisHealth, CalibrationStatus, EstimatorStatus, and the messages of
kinds/navigation.py.
"""

import math
from typing import Any

from estimator.choice import beliefs, load_card, make_layout
from estimator.convert.header import moment, sample_header
from estimator.convert.samples import (
    MICRO,
    BadMessage,
    Samples,
    accel_samples,
    tacho_report,
)
from estimator.convert.status import rate_state
from estimator.devices.gyro_free import GyroFreeNavigation
from estimator.devices.navigation import NavBoard
from estimator.devices.rate import RateBoard, RateOutput, WrongAxes, thinned
from estimator.kinds.common import Common, navigator_config
from estimator.kinds.navigation import navigated
from estimator.orders.calibration import CalibrationDesk
from estimator.output import Output
from estimator.rate_messages import BoardMessages, rate_batch
from estimator.stream import every
from inertial.calibration.card import CardError
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import AXES, CALIBRATION, ESTIMATOR, POSE, RATE

POSE_HZ = 20.0
SETTINGS = "settings: "  # begins the message of a status that doubts one


class Cube:
    """One device."""

    def __init__(self, device: str, common: Common, desk: CalibrationDesk) -> None:
        self._device, self._common, self._desk = device, common, desk
        self._board: RateBoard | None = None
        self._messages: BoardMessages | None = None
        self._gyro_free: GyroFreeNavigation | None = None

    def begin_anew(self) -> None:
        """Another calibration file is in use: the estimators begin anew with the next batch."""
        self._board = None

    @property
    def navigation(self) -> NavBoard | None:
        """Where fixes of this device go; None where it does not navigate."""
        return None if self._gyro_free is None else self._gyro_free.board

    def take(self, batch: pb.AccelBatch) -> list[Output]:
        """Estimates and poses of a batch and, once per second of data, the health of each
        estimator; raises convert.samples.BadMessage.
        """
        samples = accel_samples(batch)
        board, messages = self._ready()
        states = self._feed(board, batch, samples)
        out = self._estimates(batch, board, messages, states)
        out += self._health(batch, samples, board, messages)
        status = self._desk.feed(batch, samples, board.wiring)
        if status is not None:
            out.append(Output(CALIBRATION, self._device, "", status))
        self._common.heard(batch.header)
        if self._gyro_free is not None:
            navigation = self._gyro_free
            usual_hz = self._common.settings.nav_limit_hz
            navigation.board.limit_hz = self._common.limit_hz(self._device, usual_hz)
            said = navigation.feed(batch.header.epoch, batch.period_s, samples.t_s, states)
            out += navigated(self._common, batch, samples, navigation.board, said, navigation.names)
        return out

    def tacho(self, message: pb.TachoRate) -> None:
        """Watch the settings by the tachometer and, where it aids, correct the rate by it; raises
        convert.samples.BadMessage.
        """
        if self._board is None:
            return
        if self._common.settings.tacho_aid:
            self._board.tacho(*tacho_report(message))
        if math.isfinite(message.omega_radps):
            t_s = message.header.device_us * MICRO
            self._board.heard_tacho(t_s, message.omega_radps, message.pulses)

    def expect_fixes(self) -> None:
        """The device has GNSS: navigate on its own rate from now on, where that is asked for."""
        s = self._common.settings
        if self._board is None or self._gyro_free is not None or not s.gyro_free_navigation:
            return
        self._gyro_free = GyroFreeNavigation(
            self._device,
            navigator_config(s, self._device),
            s.gyro_free_navigation,
            s.nav_limit_hz,
            s.believed_rate,
            s.rate_limit_hz,
        )
        self._common.mutes.attend(self._device, self._gyro_free.board)

    def _ready(self) -> tuple[RateBoard, BoardMessages]:
        """The rate estimators with the calibration file in use; raises BadMessage for a card of
        another layout.
        """
        if self._board is None or self._messages is None:
            s, device = self._common.settings, self._device
            path = s.card_of(device)
            card = self._desk.used.get(device, load_card(path) if path is not None else None)
            layout = make_layout(s.layout_of(device))
            try:
                self._board = RateBoard(device, layout, s.rate, s.rate_limit_hz, card, beliefs(s))
            except CardError as error:
                raise BadMessage(f"{device}: {error}") from None
            self._messages = BoardMessages(device, self._board.layout)
        return self._board, self._messages

    def _feed(self, board: RateBoard, batch: pb.AccelBatch, samples: Samples) -> list[RateOutput]:
        common = self._common
        started = common.clock()
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
            raise BadMessage(str(error)) from None
        board.began_utc_ns = board.began_utc_ns or max(0, batch.header.utc_ns)
        common.cost.add(self._device, common.clock() - started, len(samples.t_s))
        return states

    def _estimates(
        self,
        batch: pb.AccelBatch,
        board: RateBoard,
        messages: BoardMessages,
        states: list[RateOutput],
    ) -> list[Output]:
        """A message of each estimator, and poses now and then."""
        device, out = self._device, []
        card = "" if board.card is None else board.card.id
        limit_hz = self._common.limit_hz(device, self._common.settings.rate_limit_hz)
        few = (thinned(said, batch.period_s, limit_hz) for said in states)
        for said in (said for said in few if said is not None):
            step = every(batch.period_s, POSE_HZ) if limit_hz > POSE_HZ else said.step
            message = rate_batch(batch, card, said)
            out.append(Output(RATE, device, said.estimator, message))
            for k in range(len(said.columns)):
                if (said.index + k * said.step) % step == step - 1:
                    row = said.row + k * said.step
                    _, utc_ns = moment(0, batch.header.utc_ns, row * batch.period_s)
                    pose = messages.pose(said.estimator, utc_ns, said.columns.q_nb[k])
                    out.append(Output(POSE, device, said.estimator, pose))
        return out

    def _health(
        self, batch: pb.AccelBatch, samples: Samples, board: RateBoard, messages: BoardMessages
    ) -> list[Output]:
        """Of the axes, a few times per second of data, and of each estimator, once."""
        common, device, out = self._common, self._device, []
        last_s = float(samples.t_s[-1])
        axes_due = common.new_second(device, "axes", AXES.rate * last_s)
        due = common.new_second(device, "accel", last_s)
        if not (axes_due or due):
            return []
        header = sample_header(batch.header, (len(samples.t_s) - 1) * batch.period_s)
        if axes_due:
            out.append(Output(AXES, device, "", messages.axes(header, board.health, last_s)))
        if due:
            doubts = board.doubts(last_s)
            for k, name in enumerate(common.settings.rate):
                status = self._status(header, board, name)
                status.message = f"{SETTINGS}{doubts}" if doubts and k == 0 else ""
                out.append(Output(ESTIMATOR, device, name, status))
        return out

    def _status(self, header: pb.Header, board: RateBoard, name: str) -> pb.EstimatorStatus:
        status: Any = self._common.status(header, board.stream, name)
        status = rate_state(status, board.newest(name))
        status.began_utc_ns = board.began_utc_ns
        status.layout, status.us_per_sample = board.layout.name, board.cost_us(name)
        return status
