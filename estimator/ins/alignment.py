"""Initial alignment: roll, pitch and gyro bias from standstill, heading from the course once the vehicle moves.

Equations E-35 and E-36 of docs/equations-ins.md (inmotion-alignment, section 10).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimator.ins.strapdown import dcm_to_euler, euler_to_dcm, exp

Array = NDArray[np.float64]


@dataclass(frozen=True)
class AlignmentSettings:
    """When a vehicle counts as standing, and as moving fast enough for its course to be its heading."""

    standstill: float = 10.0  # s of it, at least
    block: float = 1.0  # s, judged as a whole
    still_f: float = 0.35  # m/s^2, largest standard deviation of an axis in a block: idling engine passes
    still_w: float = math.radians(6.0)  # rad/s, the same for rates
    turn_w: float = math.radians(0.5)  # rad/s, largest change of a block's mean rate: slow turns are no standstill
    tilt_f: float = 0.15  # m/s^2, largest change of a block's mean force
    still_speed: float = 0.5  # m/s by GNSS, above which nothing is a standstill
    course_speed: float = 4.0  # m/s, the course is the heading above it
    longest_gap: float = 0.3  # s without samples, after which the standstill starts again


def level(f_b: Array) -> tuple[float, float]:
    """Roll and pitch, rad, from the mean specific force (3,) at standstill (E-35)."""
    return math.atan2(-f_b[1], -f_b[2]), math.atan2(f_b[0], math.hypot(f_b[1], f_b[2]))


class Alignment:
    """Takes samples and speeds until C_nb but for its heading, and the gyro bias, are known; then keeps them by gyro.

    A later standstill levels again, so that a long wait before the drive costs nothing.
    """

    def __init__(self, settings: AlignmentSettings) -> None:
        self.settings = settings
        self.levelled = False
        self.C = np.eye(3)  # C_nb with heading counted from an arbitrary start
        self.gyro_bias = np.zeros(3)  # rad/s, contains the Earth's rate, which a MEMS gyro hides
        self.mean_f = np.array([0.0, 0.0, -9.8])
        self.still_s = 0.0  # s of the standstill that lasts now
        self._t: float | None = None
        self._block: list[tuple[Array, Array]] = []
        self._block_start = 0.0
        self._sum_f = np.zeros(3)
        self._sum_w = np.zeros(3)
        self._count = 0

    def imu(self, t: float, f: Array, w: Array) -> None:
        """One sample: time s, specific force (3,) m/s^2, rate (3,) rad/s."""
        if self._t is not None and t - self._t > self.settings.longest_gap:
            self._interrupt()
        if self._t is not None and self.levelled:
            self.C = self.C @ exp((w - self.gyro_bias) * (t - self._t))
        self._t = t
        if not self._block:
            self._block_start = t
        self._block.append((f, w))
        if t - self._block_start >= self.settings.block:
            self._judge(t - self._block_start)

    def speed(self, speed: float) -> None:
        """Speed by GNSS, m/s: a smooth motorway must not pass for a standstill."""
        if speed > self.settings.still_speed:
            self._interrupt()

    def heading(self, C_then: Array, v_n: Array) -> Array | None:
        """C_nb (3, 3) with the heading of the course v_n (3,); C_then is C at that time. None: too slow (E-36)."""
        if not self.levelled or math.hypot(v_n[0], v_n[1]) < self.settings.course_speed:
            return None
        roll, pitch, _ = dcm_to_euler(C_then)
        return euler_to_dcm(roll, pitch, math.atan2(v_n[1], v_n[0]))

    def _judge(self, length: float) -> None:
        f = np.array([sample[0] for sample in self._block])
        w = np.array([sample[1] for sample in self._block])
        self._block = []
        s = self.settings
        still = f.std(axis=0).max() < s.still_f and w.std(axis=0).max() < s.still_w
        if still and self._count:
            still = (
                np.abs(f.mean(axis=0) - self._sum_f / self._count).max() < s.tilt_f
                and np.abs(w.mean(axis=0) - self._sum_w / self._count).max() < s.turn_w
            )
        if not still:
            self._interrupt()
            return
        self._sum_f += f.sum(axis=0)
        self._sum_w += w.sum(axis=0)
        self._count += len(f)
        self.still_s += length
        if self.still_s >= s.standstill:
            self.mean_f = self._sum_f / self._count
            self.gyro_bias = self._sum_w / self._count
            self.C = euler_to_dcm(*level(self.mean_f), dcm_to_euler(self.C)[2])
            self.levelled = True

    def _interrupt(self) -> None:
        self._block = []
        self._sum_f = np.zeros(3)
        self._sum_w = np.zeros(3)
        self._count = 0
        self.still_s = 0.0
