"""Navigation without gyroscopes: a cube's own rate and specific force feed the same filters as any IMU's.

A rate estimator's output is no gyro: between turns the products of the rate say nothing of a small rate, and what it
reports drifts by the integral of the readings' errors until a standstill. So its error is modelled as a large, fast
Gauss-Markov bias and not as a MEMS gyro's. Equations E-85 and E-86 of docs/equations-in-motion.md.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from estimator.ins.board import NavBoard, NavOutput
from estimator.ins.error_model import ImuNoise
from estimator.ins.navigation import NavigatorConfig
from estimator.rate.board import RateOutput
from estimator.stream import every

Array = NDArray[np.float64]

NOISE = ImuNoise(
    accel=0.1, gyro=math.radians(0.6), sigma_bias_accel=0.1, sigma_bias_gyro=math.radians(3.0), tau=20.0
)  # of the estimates, not of the readings
SIGMA_RATE = math.radians(2.0)  # rad/s, of the rate's error when navigation begins
SIGMA_YAW = math.radians(10.0)


def config_of(config: NavigatorConfig) -> NavigatorConfig:
    """The same vehicle with a cube in it instead of an IMU."""
    alignment = replace(config.alignment, in_motion=False)  # without a standstill its rate knows no zero
    return replace(
        config, imu=NOISE, sigma_bias_gyro=SIGMA_RATE, sigma_yaw=SIGMA_YAW, sigma_bias_accel=0.2, alignment=alignment
    )


def position_error(b_mps2: Array, d_radps: Array, t_s: Array, g: float = 9.80665) -> Array:
    """Position error (n, 3) in m of unaided navigation after t_s (n,) s from rest, level: the closed form (27) (E-86).

    b (3,) is the accelerometers' equivalent bias in n, d (3,) the equivalent drift of the rate.
    """
    t = np.asarray(t_s, dtype=np.float64)[:, None]
    return 0.5 * np.asarray(b_mps2) * t**2 + np.cross(d_radps, [0.0, 0.0, -g]) * t**3 / 6.0


class GyroFreeNavigation:
    """Takes what a rate estimator said, gives it to navigation filters."""

    def __init__(
        self, device: str, config: NavigatorConfig, names: list[str], limit_hz: float, rate: str, rate_limit_hz: float
    ) -> None:
        """rate: the rate estimator that is believed; names: keys of NAVIGATORS; limits as of the boards."""
        self.board = NavBoard(device, config_of(config), names, limit_hz)
        self._rate, self._rate_limit = rate, rate_limit_hz

    def feed(self, epoch: int, period_s: float, t_s: Array, said: Sequence[RateOutput]) -> list[NavOutput]:
        """Outputs of a batch whose samples are at t_s (n,), s; those of other estimators are passed over."""
        mine = [o for o in said if o.estimator == self._rate]
        if not mine:
            return []
        step = every(period_s, self._rate_limit)  # one estimate in so many samples
        t = t_s[[o.row for o in mine]]
        f_b, omega_b = np.array([o.state.f_b for o in mine]), np.array([o.state.omega_b for o in mine])
        out = self.board.feed(epoch, mine[0].index // step, step * period_s, t, f_b, omega_b)
        return [NavOutput(mine[o.row].row, mine[o.row].index, o.estimator, o.what) for o in out]
