"""Navigation without gyroscopes: a cube's own rate and specific force feed the same filters as any
IMU's.

A rate estimator's output is no gyro: between turns the products of the rate say nothing of a small
rate, and what it reports drifts by the integral of the readings' errors until a standstill. Its
error is modelled as a large, fast Gauss-Markov bias and, on top of it, noise that follows the
covariance the estimator states at every sample. Equations E-85 to E-88 of
docs/equations-gyro-free-navigation.md.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimator.devices.navigation import NavBoard, NavOutput
from estimator.devices.rate import RateOutput
from estimator.stream import every
from inertial.elementary import product
from inertial.navigation.error_model import ImuNoise
from inertial.navigation.navigation import NAVIGATORS, NavigatorConfig

Array = NDArray[np.float64]

PREFIX = "gyro-free-"  # before a filter's name: its inertial unit has no gyroscopes
NOISE = ImuNoise(
    accel=0.1,
    gyro=math.radians(0.6),
    sigma_bias_accel=0.1,
    sigma_bias_gyro=math.radians(6.0),
    tau=10.0,
    shake=0.0,
)
# of the estimates, not of the readings; 0.5 % of scale error under 1 g is such a rate error in a
# cube of 10 cm
CORRELATED = 1.0  # s, for how long the error that a covariance tells of is one and the same
LARGEST = math.radians(60.0)  # rad/s; a rate that is less certain than that is not known at all
SIGMA_RATE = math.radians(6.0)  # rad/s, of the rate's error when navigation begins
SIGMA_YAW = math.radians(10.0)


def config_of(config: NavigatorConfig) -> NavigatorConfig:
    """The same vehicle with a cube in it instead of an IMU."""
    alignment = replace(
        config.alignment, in_motion=False
    )  # without a standstill its rate knows no zero
    return replace(
        config,
        imu=NOISE,
        sigma_bias_gyro=SIGMA_RATE,
        sigma_yaw=SIGMA_YAW,
        sigma_bias_accel=0.2,
        alignment=alignment,
    )


def attitude_noise(P_omega: Array, C_nb: Array) -> Array:
    """Density (3,) of the attitude error's noise in n, rad^2/s, of a rate with covariance P_omega
    (3, 3), b (E-87).
    """
    P_n = product(product(C_nb, P_omega), C_nb.T)
    return NOISE.gyro**2 + 2.0 * CORRELATED * np.minimum(np.diag(P_n), LARGEST**2)


class GyroFreeBoard(NavBoard):
    """NavBoard of one device, its filters under the names that tell where their rate comes from."""

    def make(self, name: str) -> Any:
        """A navigator; see NavBoard.make."""
        return NAVIGATORS[name.removeprefix(PREFIX)](self.config)


class GyroFreeNavigation:
    """Takes what a rate estimator said, gives it to navigation filters."""

    def __init__(
        self,
        device: str,
        config: NavigatorConfig,
        names: list[str],
        limit_hz: float,
        rate: str,
        rate_limit_hz: float,
    ) -> None:
        """rate: the rate estimator that is believed; names: keys of NAVIGATORS; limits as of the
        boards.

        What the filters say is published under PREFIX + name.
        """
        self.names = [PREFIX + name for name in names]
        self.board = GyroFreeBoard(device, config_of(config), self.names, limit_hz)
        self._rate, self._rate_limit = rate, rate_limit_hz

    def feed(
        self, epoch: int, period_s: float, t_s: Array, said: Sequence[RateOutput]
    ) -> list[NavOutput]:
        """Outputs of a batch whose samples are at t_s (n,), s; those of other estimators are passed
        over.
        """
        mine = [o for o in said if o.estimator == self._rate]
        if not mine:
            return []
        step = every(period_s, self._rate_limit)  # one estimate in so many samples
        t = t_s[[o.row for o in mine]]
        f_b, omega_b = (
            np.array([o.state.f_b for o in mine]),
            np.array([o.state.omega_b for o in mine]),
        )
        self._believe(mine[-1].state.P)
        out = self.board.feed(epoch, mine[0].index // step, step * period_s, t, f_b, omega_b)
        return [NavOutput(mine[o.row].row, mine[o.row].index, o.estimator, o.what) for o in out]

    def _believe(self, P_omega: Array) -> None:
        """Let the filters' process noise be what the rate estimator says of itself now."""
        for navigator in self.board.navigators.values():
            if navigator.navigating:
                noise = attitude_noise(P_omega, navigator.nominal.C_nb)
                navigator.believe_attitude_noise(noise)
