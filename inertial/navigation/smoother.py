"""Offline: all fixes for every moment of a drive. Rauch, Tung and Striebel's smoother, and a robust
one. E-126, E-130.

The forward pass is the filter of the name; each fix, used or not, and each constraint that held is
an event at which Phi, both covariances and the correction c are kept. Going back, the error left in
the filter's own solution is found and taken off. The robust smoother repeats this with weights from
its own residuals, which know the future too.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inertial.core import navigation as core
from inertial.navigation import results
from inertial.navigation.batch import Drive
from inertial.navigation.filters import FILTERS, FilterConfig
from inertial.navigation.fix import Fix, core_fix
from inertial.navigation.navigation import NavigatorConfig
from inertial.navigation.start import first_leg

Array = NDArray[np.float64]

CAUCHY = 2.0  # sigmas of a smoothed residual at which a fix has half its weight


@dataclass(frozen=True)
class Smoother:
    """What a smoother of a name does."""

    filter: FilterConfig
    passes: int = 0  # of reweighting; 0: plain


SMOOTHERS = {
    "smoother": Smoother(FILTERS["huber-nhc"]),
    "smoother-robust": Smoother(replace(FILTERS["kf-nhc"], gated=False), 4),
}


@dataclass(frozen=True)
class SmoothRun:
    """The smoothed solution at every fix; k rows."""

    name: str
    fixes: list[Fix]
    used: NDArray[np.bool_]  # (k,)
    y: Array  # (k, 7) smoothed minus measured, rows of update; NaN: absent
    x: results.Table  # (k,), columns NOMINAL
    P: Array  # (k, 9, 9) of psi_n, dv_n, dN dE dh
    began: float  # s
    seconds: float  # CPU time
    epochs: int

    @property
    def t(self) -> Array:
        """Times (k,) of the fixes, s."""
        return np.array([fix.t for fix in self.fixes])


def smooth_drive(
    imu: Array,
    fixes: Sequence[Fix],
    name: str = "smoother",
    config: NavigatorConfig = NavigatorConfig(),
) -> SmoothRun | None:
    """Smooth a drive, imu (n, 7) as run_filters takes it, up to the first gap in it; None when it
    never navigates.
    """
    chosen = SMOOTHERS[name]
    drive = Drive(np.ascontiguousarray(imu, dtype=np.float64), fixes, config)
    found = drive.first()
    if found is None:
        return None
    k, end, last = drive.stretch(found)
    model = chosen.filter.model(config.imu)
    settings = chosen.filter.settings(config.fix, config.lever_arm_b)
    used = drive.fixes[found.next_fix : last]
    given = [core_fix(fix, config.fix) for fix in used]
    clock = time.thread_time_ns()
    for _ in range(chosen.passes + 1):
        leg = first_leg(config, chosen.filter, found.start, found.fix)
        memory = chosen.filter.memory(leg.P, found.startup.still_f)
        rows = core.smooth(leg, model, settings, memory, drive.imu, k, end, given)
        table = rows.view(results.SMOOTHED)
        given = [
            _doubted(core_fix(fix, config.fix), left)
            for fix, left in zip(used, table["left"], strict=True)
        ]
    left = table["left"].copy()
    left[[fix.v_n is None for fix in used], 3:6] = np.nan
    left[[not fix.has_height for fix in used], 2] = np.nan
    return SmoothRun(
        name,
        used,
        np.array([not fix.withheld for fix in used]),
        left,
        table["x"],
        table["P"],
        found.fix.t,
        (time.thread_time_ns() - clock) * 1e-9,
        end - k,
    )


def _doubted(fix: Any, left: Array) -> Any:
    """The core's fix, its sigmas raised by Cauchy weights 1 / (1 + (d / CAUCHY)^2) of the smoothed
    residuals left (7,) (E-130).
    """
    if fix.withheld:
        return fix
    fix.sigma_p = fix.sigma_p * _grown(left[:3] / np.maximum(fix.sigma_p, 1e-9))
    if fix.has_v:
        fix.sigma_v = fix.sigma_v * _grown(left[3:6] / np.maximum(fix.sigma_v, 1e-9))
    return fix


def _grown(whitened: Array) -> float:
    """Factor on a sigma, from residuals in sigmas (3,)."""
    square = float(np.mean(np.square(whitened)))
    return np.sqrt(1.0 + square / CAUCHY**2) if np.isfinite(square) else 1.0
