"""Velocities for the alignment from a receiver that gives positions only.

The mean velocity between two positions some seconds apart, for the moment half-way. Its sigma is
that of the part of their error that is new in each, over the time between. E-84a.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inertial.earth import ned_between
from inertial.navigation.fix import Fix

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Walked:
    """A velocity, at time t (s), the middle of the way."""

    t: float
    v_n: Array  # (3,) m/s
    sigma_v: Array  # (3,) m/s


@dataclass
class Positions:
    """Takes fixes in order, gives a velocity when they are far enough apart."""

    shortest: float = 2.0  # s between the two
    longest: float = 12.0  # s; after more it begins again
    white: float = 0.65  # of a receiver's sigma is new in every fix, see drag
    bend: float = 0.3  # m/s, by which the mean differs from the velocity half-way
    _last: Fix | None = None

    def take(self, fix: Fix) -> Walked | None:
        """The velocity since the fix before; None while there is none."""
        last = self._last
        if last is None or not 0.0 < fix.t - last.t <= self.longest:
            self._last = fix
            return None
        length = fix.t - last.t
        if length < self.shortest:
            return None
        self._last = fix
        way = ned_between(
            (last.latitude, last.longitude, last.height), (fix.latitude, fix.longitude, fix.height)
        )
        new = self.white * np.sqrt(last.sigma_p**2 + fix.sigma_p**2) / length
        return Walked(
            0.5 * (fix.t + last.t), np.array(way) / length, np.hypot(new, math.fabs(self.bend))
        )
