"""What a navigation filter says: its solution at a sample, and its verdict on a fix."""

import math
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from inertial.navigation import estimate as est
from inertial.navigation.fix import Fix

Array = NDArray[np.float64]

INNOVATIONS = (
    "position N m",
    "position E m",
    "height m",
    "velocity N m/s",
    "velocity E m/s",
    "velocity D m/s",
)
HEADING = "heading rad"
WITHHELD = "withheld to score the filter"
MUTED = "muted by an operator"


class Mode(IntEnum):
    """As NavSolution.Mode of the bus contract."""

    WAITING = 0
    LEVELLING = 1
    COURSE = 2
    NAVIGATING = 3


@dataclass(frozen=True)
class HorizonChoice:
    """How many fixes a moving horizon looked back at its last fix, and why."""

    n: int
    crisp: float  # before rounding; n itself for a fixed horizon
    inputs: (
        tuple[float, float] | None
    )  # |f| m/s^2 and |w| rad/s as they entered the rules; None: fixed


@dataclass(frozen=True)
class Correction:
    """What one fix said, and what was done with it."""

    fix: Fix
    # (m,) computed - measured: position NE and height m, v_n m/s, heading rad; empty: not compared
    values: Array
    sigma: Array  # (m,) of values as the filter expects them
    nis: float
    accepted: bool
    # (3,) computed - measured position of the antenna, m, before the correction; may be empty
    error_ned: Array
    reason: str = ""  # why it was not accepted, or only in part
    yaw: float = math.nan  # heading at the time of the fix's velocity, before the correction, rad
    weight: float = 1.0  # 0 to 1, the lowest of position, velocity and heading
    left: Array | None = (
        None  # (6,) computed - measured after the correction; None: nothing corrected
    )
    horizon: HorizonChoice | None = None

    @property
    def prediction_error(self) -> Array:
        """(6,) fix minus the prediction from the fix before: position NED m, velocity NED m/s; may
        be empty or (3,).
        """
        signs = np.array([-1.0, -1.0, 1.0, -1.0, -1.0, -1.0])
        n = min(6, len(self.values) // 3 * 3)
        return signs[:n] * self.values[:n]

    @property
    def residual(self) -> Array:
        """(6,) fix minus the solution after it was used: position NED m, velocity NED m/s; empty
        where nothing was.
        """
        return (
            np.empty(0)
            if self.left is None
            else np.array([-1.0, -1.0, 1.0, -1.0, -1.0, -1.0]) * self.left
        )


def nothing_compared(fix: Fix) -> Correction:
    """A fix taken while there is no prediction to compare it with."""
    return Correction(fix, np.empty(0), np.empty(0), 0.0, True, np.empty(0))


def correction_of(fix: Fix, row: Array) -> Correction:
    """The compiled filter's results (OUT,) for a fix."""
    status, m = int(row[est.O_STATUS]), int(row[est.O_DOF])
    accepted = status in (est.USED, est.READMITTED, est.DOUBTED)
    weight = float(row[est.O_WEIGHT : est.O_WEIGHT + 3].min())
    reason = ""
    if status == est.REJECTED:
        reason, weight = f"NIS {row[est.O_NIS]:.0f} of {m}", 0.0
    elif status == est.WITHHELD:
        reason, weight = MUTED if fix.muted else WITHHELD, 0.0
    elif weight < 1.0:
        reason = f"weighted down to {weight:.2f}"
    if fix.drag > 0.0 and accepted:
        drag = (
            f"position walks off its own velocity at {fix.drag:.2f} m/s: believed to"
            f" {max(fix.sigma_p[:2]):.0f} m"
        )
        reason = f"{drag}; {reason}" if reason else drag
    horizon = None
    if row[est.O_N] > 0.0:
        fuzzy = math.isfinite(row[est.O_INPUT])
        inputs = (float(row[est.O_INPUT]), float(row[est.O_INPUT + 1])) if fuzzy else None
        horizon = HorizonChoice(int(row[est.O_N]), float(row[est.O_CRISP]), inputs)
    return Correction(
        fix,
        row[est.O_Y : est.O_Y + m].copy(),
        row[est.O_SIGMA : est.O_SIGMA + m].copy(),
        float(row[est.O_NIS]),
        accepted,
        row[est.O_ERROR : est.O_ERROR + 3].copy(),
        reason,
        float(row[est.O_YAW]),
        weight,
        row[est.O_LEFT : est.O_LEFT + 6].copy() if accepted else None,
        horizon,
    )


@dataclass(frozen=True)
class Solution:
    """Where we are, at time t of the samples' clock."""

    t: float
    mode: Mode
    latitude: float  # rad
    longitude: float  # rad
    height: float  # m
    p_ned: Array  # (3,) m from origin
    v_n: Array  # (3,) m/s
    q_nb: Array  # (4,)
    bias_f_b: Array  # (3,) m/s^2
    bias_omega_b: Array  # (3,) rad/s
    sigma: Array  # (15,) in the order of the error state, see error_model
    position_covariance: Array  # (3, 3) NED m^2
    origin: tuple[float, float, float]  # rad, rad, m: the first fix
    fix_age: float  # s since the last fix used; infinite before the first
    horizon: HorizonChoice | None = None  # of the last fix; None for filters without one
    alignment: str = ""  # for people: what the alignment does or waits for, how it was found
