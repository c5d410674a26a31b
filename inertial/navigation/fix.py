"""A GNSS fix as a navigation filter takes it: numbers, their trust, and the reasons to refuse
it.
"""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from inertial.core import navigation as core

Array = NDArray[np.float64]

NONE, AUTONOMOUS, DIFFERENTIAL, RTK_FLOAT, RTK_FIXED, DEAD_RECKONING = range(
    6
)  # GnssFix.Quality of the bus

# What stands for a height or a vertical speed that a receiver does not give, where the mathematics
# wants a number: nothing in the air or on the ground is further from it.
UNKNOWN_HEIGHT_SIGMA = 1e4  # m, about the ellipsoid
UNKNOWN_CLIMB_SIGMA = 100.0  # m/s, about level

# 1-sigma north, east, up (m) and of velocity (m/s) by quality, for receivers that do not give their
# own
TYPICAL = {
    AUTONOMOUS: ((1.6, 1.6, 3.2), (0.1, 0.1, 0.2)),
    DIFFERENTIAL: ((0.8, 0.8, 1.6), (0.1, 0.1, 0.2)),
    RTK_FLOAT: ((0.3, 0.3, 0.6), (0.07, 0.07, 0.12)),
    RTK_FIXED: ((0.02, 0.02, 0.03), (0.05, 0.05, 0.08)),
}


@dataclass(frozen=True)
class Fix:
    """One GNSS epoch on the samples' clock."""

    t: float  # s, the instant it is for
    arrival: float  # s, when its first byte came
    latitude: float  # rad
    longitude: float  # rad
    height: float  # m above the ellipsoid; NaN: unknown
    quality: int
    sigma_p: Array  # (3,) m, north east up
    v_n: Array | None = None  # (3,) m/s; down may be NaN: unknown
    sigma_v: Array | None = None  # (3,) m/s, with v_n
    # m, 1-sigma of an offset that all its heights have alike: they are above sea level, and how
    # far that is from the ellipsoid nobody said
    datum: float = 0.0
    withheld: bool = False  # only to score the filter with
    muted: bool = False  # withheld, because an operator asked for an outage
    key: int = 0  # whatever the caller needs to know it by
    yaw: float | None = None  # rad, heading by two antennas
    sigma_yaw: float = 0.01  # rad, with yaw
    # m/s, by which its position walks off its own velocity; then sigma_p is raised, see drag
    drag: float = 0.0

    def due(self, settle: float) -> float:
        """When it is used, s."""
        return max(self.t, self.arrival + settle)

    def vector(self) -> Array:
        """(6,) as fix_residual takes it."""
        v = self.v_n if self.v_n is not None else np.zeros(3)
        return np.array([self.latitude, self.longitude, self.height, *v])

    @property
    def has_height(self) -> bool:
        """Whether the receiver gives a height at all."""
        return math.isfinite(self.height)

    def beside(self, datum: float | None) -> "Fix":
        """Without its height where that counts from the sea and those used so far (their datum, m;
        None: there were none) from the ellipsoid: the two are tens of metres apart.
        """
        return replace(self, height=math.nan) if self.datum and datum == 0.0 else self

    def filled(self) -> "Fix":
        """With numbers, and sigmas that say that they mean nothing, for what is unknown: for those
        who cannot leave a component out.
        """
        height, sigma_p = self.height, np.array(self.sigma_p)
        if not self.has_height:
            height, sigma_p[2] = 0.0, UNKNOWN_HEIGHT_SIGMA
        if self.v_n is None or self.sigma_v is None:
            return replace(self, height=height, sigma_p=sigma_p)
        v_n, sigma_v = np.array(self.v_n), np.array(self.sigma_v)
        if not math.isfinite(v_n[2]):
            v_n[2], sigma_v[2] = 0.0, UNKNOWN_CLIMB_SIGMA
        return replace(self, height=height, sigma_p=sigma_p, v_n=v_n, sigma_v=sigma_v)


@dataclass(frozen=True)
class FixSettings:
    """How far a receiver is believed."""

    floor_p: tuple[float, float, float] = (
        0.02,
        0.02,
        0.03,
    )  # m: no fix is better, whatever its receiver says
    floor_v: tuple[float, float, float] = (
        0.1,
        0.1,
        0.15,
    )  # m/s: a receiver's velocity lags in turns
    floor_yaw: float = 0.005  # rad, of a heading by two antennas
    timing: float = 0.002  # s, of the fix's time against the samples' clock: counts with the speed
    wander: float = 0.75  # of its sigma wanders slowly and does not average out (E-138)
    lag: float = 0.05  # s, its position is older than it says, where a filter does not estimate it
    adapt: float = 0.05  # of the newest fix in what is known of its noise (E-137)
    false_alarm: float = (
        1e-6  # chance that the NIS gate refuses a good fix of a filter whose model is right
    )
    readmit_after: int = (
        10  # rejections in a row after which the filter, not the receiver, is taken to be wrong
    )

    def gate(self, dof: int) -> float:
        """Largest NIS that is accepted."""
        return _gate(self.false_alarm, dof)

    def objection(self, fix: Fix) -> str:
        """Why this fix must not be used, in words; empty when it may."""
        if fix.quality in (NONE, DEAD_RECKONING):
            return "the receiver has no satellite fix"
        whole = fix.filled()
        numbers = np.concatenate(
            [whole.vector(), whole.sigma_p, whole.sigma_v if whole.sigma_v is not None else []]
        )
        if not np.isfinite(numbers).all() or abs(fix.latitude) > np.pi / 2.0:
            return "not a position"
        return ""


_GATES: dict[tuple[float, int], float] = {}


def _gate(false_alarm: float, dof: int) -> float:
    key = (false_alarm, dof)
    if key not in _GATES:
        _GATES[key] = float(chdtri(dof, false_alarm))
    return _GATES[key]


def typical_sigma(quality: int) -> tuple[Array, Array]:
    """Position and velocity sigma, (3,) each, m and m/s, of a receiver that does not say."""
    position, velocity = TYPICAL.get(quality, TYPICAL[AUTONOMOUS])
    return np.array(position), np.array(velocity)


def core_fix(fix: Fix, settings: FixSettings) -> Any:
    """The fix as the core's filters take it, its sigmas floored (E-111). A height or a vertical
    speed that is unknown stays NaN: its row is silent.
    """
    given: dict[str, Any] = {}
    if fix.v_n is not None:
        given |= {"has_v": True, "v_n": fix.v_n}
        sigma_v = np.nan_to_num(fix.sigma_v, nan=1.0)  # of what is silent
        given |= {"sigma_v": np.maximum(sigma_v, settings.floor_v)}
    if fix.yaw is not None:
        given |= {"has_yaw": True, "yaw": fix.yaw}
        given |= {"sigma_yaw": max(fix.sigma_yaw, settings.floor_yaw)}
    return core.Fix(
        t=fix.t,
        latitude=fix.latitude,
        longitude=fix.longitude,
        height=fix.height,
        sigma_p=np.maximum(np.nan_to_num(fix.sigma_p, nan=1.0), settings.floor_p),
        withheld=fix.withheld,
        timing=settings.timing,
        **given,
    )
