"""A six-axis unit with GNSS.

In: specific force and rate of an ImuBatch or, by an axis map, an AdcBatch; fixes go to `board`.
Estimators: the INS/GNSS filters of [estimator] navigators, side by side (devices/navigation.py).
Out: NavSolution, pose, Innovation, EstimatorStatus (kinds/navigation.py).
"""

from estimator.convert.samples import Array, Samples
from estimator.devices.navigation import NavBoard
from estimator.kinds.common import Common, navigator_config
from estimator.kinds.navigation import Batch, navigated
from estimator.output import Output


class Vehicle:
    """The navigation filters of one device."""

    def __init__(self, device: str, common: Common) -> None:
        settings = common.settings
        config = navigator_config(settings, device)
        board = NavBoard(device, config, settings.navigators, settings.nav_limit_hz)
        self.board = common.mutes.attend(device, board)
        self._common = common

    def take(self, batch: Batch, samples: Samples, omega_b: Array) -> list[Output]:
        """Specific force in `samples`, rate (n, 3), rad/s."""
        header, common = batch.header, self._common
        common.heard(header)
        self.board.limit_hz = common.limit_hz(header.device, common.settings.nav_limit_hz)
        started = common.clock()
        said = self.board.feed(
            header.epoch, batch.first_index, batch.period_s, samples.t_s, samples.values, omega_b
        )
        common.cost.add(header.device, common.clock() - started, len(samples.t_s))
        return navigated(common, batch, samples, self.board, said, common.settings.navigators)
