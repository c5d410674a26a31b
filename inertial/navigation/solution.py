"""What a navigation filter says: its solution at a sample, and its verdict on a fix."""

import math
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inertial.navigation import results
from inertial.navigation.fix import UNKNOWN_HEIGHT_SIGMA, Fix

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
HEIGHT_STATE = 8  # of sigma
NO_HEIGHT_SIGMA = 1000.0  # m, from which on a height is none
WITHHELD = "withheld to score the filter"
MUTED = "muted by an operator"


class Mode(IntEnum):
    """As NavSolution.Mode of the bus contract."""

    WAITING = 0
    LEVELLING = 1
    COURSE = 2
    NAVIGATING = 3


class Wheels(IntEnum):
    """What a filter believes of a car's wheels, as Wheels of the core."""

    NONE = 0
    ON_TRIAL = 1
    BELIEVED = 2
    CONTRADICTED = 3


WHEELS = {
    Wheels.NONE: "",
    Wheels.ON_TRIAL: "wheels on trial, not used: it may be no car",
    Wheels.BELIEVED: "wheels believed: the fixes agree with a car that does not slide",
    Wheels.CONTRADICTED: "wheels not used: the fixes contradict a car that does not slide",
}


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
    # (m,) computed - measured: position NE and height m, v_n m/s, heading rad; empty: not compared,
    # NaN: the fix does not have it
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


def correction_of(fix: Fix, said: Any) -> Correction:
    """The core's FixResult for a fix."""
    status, m = said.status, said.dof
    accepted = status in (results.USED, results.READMITTED, results.DOUBTED)
    weight = float(said.weight.min())
    reason = ""
    if status == results.REJECTED:
        compared = int(np.isfinite(said.y[:m]).sum())
        reason, weight = f"NIS {said.nis:.0f} of {compared}", 0.0
    elif status == results.WITHHELD:
        reason, weight = MUTED if fix.muted else WITHHELD, 0.0
    elif weight < 1.0:
        reason = f"weighted down to {weight:.2f}"
    if fix.drag > 0.0 and accepted:
        drag = (
            f"position walks off its own velocity at {fix.drag:.2f} m/s: believed to"
            f" {max(fix.sigma_p[:2]):.0f} m"
        )
        reason = f"{drag}; {reason}" if reason else drag
    if said.switched:
        now = WHEELS[Wheels(said.wheels)]
        reason = f"{reason}; {now}" if reason else now
    horizon = None
    if said.horizon > 0:
        force, rate = said.inputs.tolist()
        horizon = HorizonChoice(
            said.horizon, said.crisp, (force, rate) if math.isfinite(force) else None
        )
    return Correction(
        fix,
        said.y[:m],
        said.sigma[:m],
        said.nis,
        accepted,
        said.error_ned,
        reason,
        said.yaw,
        weight,
        said.left if accepted else None,
        horizon,
    )


@dataclass(frozen=True)
class Solution:
    """Where we are, at time t of the samples' clock."""

    t: float
    mode: Mode
    latitude: float  # rad; NaN: no fix was used yet
    longitude: float  # rad, likewise
    height: float  # m; NaN: unknown, no fix had one
    p_ned: Array  # (3,) m from origin; NaN where the place is, down where the height is
    v_n: Array  # (3,) m/s
    q_nb: Array  # (4,)
    bias_f_b: Array  # (3,) m/s^2
    bias_omega_b: Array  # (3,) rad/s
    sigma: Array  # (15,) in the order of the error state, see error_model
    position_covariance: Array  # (3, 3) NED m^2
    origin: tuple[float, float, float]  # rad, rad, m: the first fix
    fix_age: float  # s since the last fix used; infinite before the first
    horizon: HorizonChoice | None = None  # of the last fix; None for filters without one
    # m, 1-sigma of the height of the ellipsoid against the sea level that height counts from; it is
    # in sigma. 0: height is above the ellipsoid
    datum: float = 0.0
    alignment: str = ""  # for people: what the alignment does or waits for, how it was found


def as_known(solution: Solution, measured: bool) -> Solution:
    """Says what is not known: a height that no fix has measured is none, whatever the model makes
    of gravity and of wheels on the ground, nor is one whose sigma has grown to that of not knowing;
    and one that counts from sea level is no better than the geoid.
    """
    s = solution
    if not measured:
        sigma = s.sigma.copy()
        sigma[HEIGHT_STATE] = max(sigma[HEIGHT_STATE], UNKNOWN_HEIGHT_SIGMA)
        s = replace(s, sigma=sigma)
    elif s.datum:
        sigma, covariance = s.sigma.copy(), s.position_covariance.copy()
        sigma[HEIGHT_STATE] = math.hypot(sigma[HEIGHT_STATE], s.datum)
        covariance[2, 2] += s.datum**2
        s = replace(s, sigma=sigma, position_covariance=covariance)
    if s.sigma[HEIGHT_STATE] < NO_HEIGHT_SIGMA:
        return s
    return replace(s, height=math.nan, p_ned=np.array([s.p_ned[0], s.p_ned[1], math.nan]))
