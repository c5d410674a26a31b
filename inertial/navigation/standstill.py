"""When a vehicle counts as standing, as moving, and what a standstill tells: gravity and the gyro's
bias. E-115.
"""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from inertial.elementary import norm
from inertial.navigation.alignment_motion import MotionSettings

Array = NDArray[np.float64]


@dataclass(frozen=True)
class AlignmentSettings:
    """When a vehicle counts as standing, and as moving fast enough for its course to be its
    heading.
    """

    standstill: float = 10.0  # s of it, at least
    block: float = 1.0  # s, judged as a whole
    still_f: float = (
        0.35  # m/s^2, largest standard deviation of an axis in a block: idling engine passes
    )
    still_w: float = math.radians(6.0)  # rad/s, the same for rates
    turn_w: float = math.radians(
        0.5
    )  # rad/s, largest change of a block's mean rate: slow turns are no standstill
    tilt_f: float = 0.15  # m/s^2, largest change of a block's mean force
    bias_w: float = math.radians(
        8.0
    )  # rad/s, largest rate that can be a gyro's bias: more is a steady turn
    # m/s^2, largest difference from 1 g that can be an accelerometer's: more is acceleration
    bias_f: float = 0.6
    still_speed: float = 0.5  # m/s by GNSS, above which nothing is a standstill
    course_speed: float = 4.0  # m/s, the course is the heading above it
    sigma_course: float = math.radians(4.0)  # rad, of the course against x_b in a car
    # s in motion below course_speed, after which the heading is looked for without the course
    patience: float = 15.0
    look: float = 1.0  # s between two looks for it
    disagree: float = 3.0  # sigmas by which the felt heading may differ from the course
    longest_gap: float = 0.3  # s without samples, after which the standstill starts again
    in_motion: bool = True  # a vehicle that never stands is aligned under way
    motion: MotionSettings = field(default_factory=MotionSettings)


class Standstill:
    """Takes samples; counts the seconds of a standstill that lasts, and averages over it.

    A standstill during which the board moves is not used: it begins again, and `disturbed` says
    why.
    """

    def __init__(self, settings: AlignmentSettings) -> None:
        self.settings = settings
        self.seconds = 0.0  # of the standstill that lasts now
        self.disturbed = ""  # what ended the last one, for people
        self._block: list[tuple[Array, Array]] = []
        self._block_start = 0.0
        self._sum_f = np.zeros(3)
        self._sum_w = np.zeros(3)
        self._count = 0

    def imu(self, t: float, f: Array, w: Array) -> tuple[Array, Array] | None:
        """One sample: s, (3,) m/s^2, (3,) rad/s. Mean force and mean rate, (3,) each, whenever a
        block ends a standstill that is long enough.
        """
        if not self._block:
            self._block_start = t
        self._block.append((f, w))
        length = t - self._block_start
        if length < self.settings.block:
            return None
        moved = self._take_block()
        if moved:
            self.interrupt(moved)
            return None
        self.seconds += length
        if self.seconds < self.settings.standstill:
            return None
        self.disturbed = ""
        return self._sum_f / self._count, self._sum_w / self._count

    def interrupt(self, why: str, tell: bool = True) -> None:
        """It begins again; `tell`: and people hear why."""
        if self.seconds > 0.0 and tell:
            self.disturbed = f"{why} after {self.seconds:.0f} s"
        self._block = []
        self._sum_f = np.zeros(3)
        self._sum_w = np.zeros(3)
        self._count = 0
        self.seconds = 0.0

    def _take_block(self) -> str:
        """Adds a block of samples; what speaks against a standstill in it, in words."""
        f = np.array([sample[0] for sample in self._block])
        w = np.array([sample[1] for sample in self._block])
        self._block = []
        moved = self._movement(f, w)
        if not moved:
            self._sum_f += f.sum(axis=0)
            self._sum_w += w.sum(axis=0)
            self._count += len(f)
        return moved

    def _movement(self, f: Array, w: Array) -> str:
        """What speaks against a standstill in a block of samples (n, 3), in words; empty when
        nothing does.
        """
        s = self.settings
        if f.std(axis=0).max() >= s.still_f:
            return f"the board shakes by {f.std(axis=0).max():.2f} m/s^2"
        if w.std(axis=0).max() >= s.still_w:
            return f"the board shakes by {math.degrees(w.std(axis=0).max()):.1f} °/s"
        size = float(norm(f.mean(axis=0)))
        if abs(size - 9.81) > s.bias_f:
            return f"the board feels {size:.2f} m/s^2, which is not 1 g"
        if np.abs(w.mean(axis=0)).max() > s.bias_w:
            return (
                f"the board turns steadily ({math.degrees(np.abs(w.mean(axis=0)).max()):.1f} °/s)"
            )
        if self._count:
            tilted = np.abs(f.mean(axis=0) - self._sum_f / self._count).max()
            turned = np.abs(w.mean(axis=0) - self._sum_w / self._count).max()
            if tilted >= s.tilt_f:
                return f"the board tilted or was pushed ({tilted:.2f} m/s^2)"
            if turned >= s.turn_w:
                return f"the board turned ({math.degrees(turned):.1f} °/s)"
        return ""
