"""Everything a navigator is told beforehand."""

import math
from dataclasses import dataclass

from inertial.navigation.alignment import AlignmentSettings
from inertial.navigation.error_model import ImuNoise
from inertial.navigation.fix import FixSettings


@dataclass(frozen=True)
class NavigatorConfig:
    """SI units and radians."""

    lever_arm_b: tuple[float, float, float] = (0.0, 0.0, 0.0)  # m, IMU to antenna
    imu: ImuNoise = ImuNoise()
    fix: FixSettings = FixSettings()
    alignment: AlignmentSettings = AlignmentSettings()
    sigma_tilt: float = math.radians(1.0)  # at the start of navigation
    sigma_yaw: float = math.radians(4.0)
    sigma_v: tuple[float, float, float] = (0.3, 0.3, 0.4)  # m/s, or the fix's where that is more
    sigma_p: tuple[float, float, float] = (2.0, 2.0, 4.0)  # m, or the fix's where that is less
    sigma_bias_accel: float = 0.15  # m/s^2
    sigma_bias_gyro: float = math.radians(0.08)  # rad/s
    # s after a fix's arrival until it is used, so that order on the bus does not matter
    settle: float = 0.05
    # s without samples that the filter bridges; after more the heading is found again
    longest_gap: float = 0.3
