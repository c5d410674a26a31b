"""The navigation filters by name: what each believes and what it makes of a fix. docs/navigation.md
compares them.
"""

import math
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from inertial.core import navigation as core
from inertial.navigation import fuzzy
from inertial.navigation.error_model import ImuNoise, make_model
from inertial.navigation.fix import FixSettings

Array = NDArray[np.float64]

# values of enums of the core, inertial/core/navigation/window.hpp and filter.hpp
ARRIVALS = {"p0": 0, "mean": 1, "kf": 2}
WINDOWS = {"none": 0, "predictive": 1, "robust": 2}


@dataclass(frozen=True)
class Trial:
    """When the data agree with the wheels: a filter with their constraint and one without differ by
    no more than they may (E-134 to E-136).
    """

    memory: float = 10.0  # s of motion over which the difference is averaged
    contradicted: float = 3.0  # mean squared difference, in variances, that ends belief
    agreed: float = 1.5  # below it counts as agreement
    proof: float = 15.0  # s of agreement in motion until the wheels are believed
    again: float = 60.0  # s of it after they were contradicted
    turn: float = math.radians(30.0)  # rad of headings that the agreement must have gone through
    heading: float = math.radians(3.0)  # rad, sigma above which the one without cannot tell
    strain: float = 4.0  # mean NIS per row of the constraint itself that ends belief

    def core(self) -> Any:
        """The core's TrialSettings."""
        return core.TrialSettings(**asdict(self))


@dataclass(frozen=True)
class Constraints:
    """What the vehicle cannot do."""

    car: bool = False  # wheels do not slide sideways and do not leave the ground
    standstill: bool = False  # zero velocity and zero rate while it stands
    every: float = 0.5  # s
    sigma_side: float = 0.2  # m/s, correlated in time: so more than a single look would show
    sigma_up: float = 0.2  # m/s
    least_speed: float = 2.0  # m/s
    most_turn: float = 0.7  # rad/s
    still_v: float = 0.1  # m/s
    still_w: float = math.radians(0.1)  # rad/s
    still_speed: float = 0.5  # m/s
    still_f_change: float = 0.12  # m/s^2, of means over 0.1 s
    still_w_change: float = math.radians(0.4)  # rad/s
    huber: float = 2.0
    sigma_mount: float = math.radians(4.0)  # rad, of both mounting angles at the start
    axle: float = 1.0  # m, the rear axle behind the IMU, at the start
    sigma_axle: float = 1.0  # m
    tried: bool = True  # the wheels are believed only while the data agree
    trial: Trial = Trial()

    def core(self) -> Any:
        """The core's Rules."""
        return core.Rules(
            every=self.every if self.car or self.standstill else math.inf,
            sigma_side=self.sigma_side,
            sigma_up=self.sigma_up,
            least_speed=self.least_speed,
            most_turn=self.most_turn,
            still_v=self.still_v,
            still_w=self.still_w,
            still_speed=self.still_speed if self.standstill else -1.0,
            still_f_change=self.still_f_change,
            still_w_change=self.still_w_change,
            huber=self.huber,
        )


@dataclass(frozen=True)
class FilterConfig:
    """One filter. Default: the plain error-state Kalman filter with 15 states."""

    window: Literal["none", "predictive", "robust"] = "none"
    horizon: int = 0  # fixes, 1 to 10; 0: fuzzy
    arrival: Literal["p0", "mean", "kf"] = "mean"
    kappa: float = 4.0  # on the mean covariance
    mean_covariance: tuple[tuple[float, ...], ...] | None = (
        None  # (n, n) of a calibration run; None: this one's
    )
    literal: bool = False  # fuzzy inputs as read, not conditioned
    rules: fuzzy.FuzzyRules = fuzzy.RULES
    huber: float = (
        math.inf
    )  # Mahalanobis distance of position or velocity from which a fix is weighted down
    passes: int = 3  # of reweighting in a robust horizon
    fading: float = 1.0  # forgetting factor on the covariance, 1.05 to 1.1 for sensors that jump
    scale: bool = False  # six scale factors as states
    sigma_scale: float = 0.01
    latency: bool = False  # of the receiver's position and velocity, as states
    sigma_latency: tuple[float, float] = (0.05, 0.1)  # s, position, velocity
    constraints: Constraints = Constraints()
    # m/s^2 and rad/s, by which a bias may have changed where innovations last (E-141)
    jump: tuple[float, float] = (0.0, 0.0)
    gated: bool = True  # refuse fixes beyond FixSettings.gate

    low_weight: float = 0.2  # of a fix that a robust filter hardly believes

    def model(self, noise: ImuNoise) -> Any:
        """The states of this filter, the core's Model."""
        return make_model(noise, self.scale, self.latency, self.constraints.car)

    def extra_sigma(self) -> list[float]:
        """1-sigma of the states beyond 15 at the start, in their order."""
        c = self.constraints
        return (
            [self.sigma_scale] * 6 * self.scale
            + list(self.sigma_latency) * self.latency
            + [c.sigma_mount, c.sigma_mount, c.sigma_axle] * c.car
        )

    def settings(self, fix: FixSettings, lever_arm_b: tuple[float, float, float]) -> Any:
        """The core's Settings."""
        gates = [fix.gate(dof) if self.gated else math.inf for dof in range(1, 8)]
        return core.Settings(
            gates=[math.inf, *gates],
            readmit=fix.readmit_after,
            fading=self.fading,
            huber=self.huber,
            low_weight=self.low_weight,
            window=WINDOWS[self.window],
            horizon=self.horizon,
            arrival=ARRIVALS[self.arrival],
            kappa=self.kappa,
            passes=self.passes,
            literal=self.literal,
            fuzzy=self.rules.core(),
            wander=fix.wander,
            lag=fix.lag,
            adapt=fix.adapt,
            jump_accel=self.jump[0],
            jump_gyro=self.jump[1],
            rules=self.constraints.core(),
            tries=self.constraints.car and self.constraints.tried,
            trial=self.constraints.trial.core(),
            lever_b=lever_arm_b,
        )

    def memory(self, P0: Array, still_f: float) -> Any:
        """The core's Memory: all that the filter remembers besides its leg, at the start of
        navigation with covariance P0 (n, n).
        """
        memory = core.new_memory(len(P0), core.CAPACITY if self.window != "none" else 0)
        memory.still_f = still_f
        window = memory.window
        window.P0 = window.kalman = P0
        if self.mean_covariance is not None:
            window.sum = self.mean_covariance
            window.seen = -1  # given: nothing is summed up
        return memory


_CAR = Constraints(car=True, standstill=True)
_JUMP = (0.3, math.radians(0.3))
_ROBUST = FilterConfig(huber=2.5, latency=True, jump=_JUMP)

FILTERS: dict[str, FilterConfig] = {
    "kf": FilterConfig(),
    "kf-nhc": FilterConfig(latency=True, constraints=_CAR, jump=_JUMP),
    "kf-fading": FilterConfig(fading=1.05),
    "kf-scale": FilterConfig(scale=True, latency=True),
    "kf-latency": FilterConfig(latency=True),
    "kf-still": FilterConfig(latency=True, constraints=Constraints(standstill=True)),
    "huber": _ROBUST,
    "huber-nhc": replace(_ROBUST, constraints=_CAR),
    "mhe-robust": replace(_ROBUST, window="robust", horizon=10),
    **{
        f"fpe-p0-n{n}": FilterConfig(window="predictive", horizon=n, arrival="p0")
        for n in range(1, 11)
    },
    **{
        f"fpe-mean-n{n}": FilterConfig(window="predictive", horizon=n, kappa=1.0)
        for n in range(1, 11)
    },
    **{
        f"fpe-4mean-n{n}": FilterConfig(window="predictive", horizon=n, kappa=4.0)
        for n in range(1, 11)
    },
    "fpe-p0-fuzzy": FilterConfig(window="predictive", arrival="p0"),
    "fpe-mean-fuzzy": FilterConfig(window="predictive", kappa=1.0),
    "fpe-fuzzy": FilterConfig(window="predictive", kappa=4.0),
    "fpe-fuzzy-literal": FilterConfig(window="predictive", kappa=4.0, literal=True),
}
DEFAULT = "huber-nhc"


class UnknownFilter(ValueError):
    """A name that is not in the table."""


def filter_of(name: str) -> FilterConfig:
    """The filter of a name; raises UnknownFilter with the known ones."""
    if name not in FILTERS:
        raise UnknownFilter(f"no navigation filter {name!r}; want one of {', '.join(FILTERS)}")
    return FILTERS[name]
