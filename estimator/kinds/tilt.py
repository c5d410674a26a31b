"""Tilt of a six-axis unit.

In: specific force and rate of an ImuBatch or, by an axis map, an AdcBatch.
Estimators: the attitude filters of [estimator] attitudes, side by side (devices/attitude.py).
Out: AttitudeEstimate.
"""

from estimator.convert.attitude import attitude_message
from estimator.convert.header import sample_header
from estimator.convert.samples import Array
from estimator.devices.attitude import AttitudeBoard
from estimator.kinds.common import Common
from estimator.kinds.navigation import Batch
from estimator.output import Output
from messages.contract.topics import ATTITUDE


class Tilt:
    """The attitude filters of one device."""

    def __init__(self, device: str, common: Common) -> None:
        settings = common.settings
        self._board = AttitudeBoard(device, settings.attitudes, settings.attitude_limit_hz)
        self._common = common

    def take(self, batch: Batch, f_b: Array, omega_b: Array) -> list[Output]:
        """Specific force and rate (n, 3), m/s^2 and rad/s."""
        header, out, common = batch.header, [], self._common
        self._board.limit_hz = common.limit_hz(header.device, common.settings.attitude_limit_hz)
        for o in self._board.feed(header.epoch, batch.first_index, batch.period_s, f_b, omega_b):
            then = sample_header(header, o.row * batch.period_s)
            message = attitude_message(then, batch, o.index, o.estimator, o.state)
            out.append(Output(ATTITUDE, header.device, o.estimator, message))
        return out
