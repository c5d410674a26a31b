"""What a filter or a smoother made of a drive, in one form for both."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inertial.navigation.batch import FilterRun
from inertial.navigation.fix import RTK_FIXED, Fix
from inertial.navigation.results import Table
from inertial.navigation.smoother import SmoothRun

Array = NDArray[np.float64]

SETTLED = 20.0  # s after navigation began, from which on it is scored


@dataclass(frozen=True)
class Result:
    """A filter or smoother at every fix, in one form; k rows."""

    t: Array
    fixes: list[Fix]
    began: float
    unseen: NDArray[np.bool_]
    y: Array  # (k, 7) computed - measured: before the correction, or smoothed
    left: Array | None  # (k, 6) after the correction
    yaw: Array  # (k,) at the time of the velocity
    x: Table  # (k,), columns NOMINAL of inertial.navigation.results
    P: Array  # (k, 9, 9)
    us_per_epoch: float

    @property
    def scored(self) -> NDArray[np.bool_]:
        """Unseen fixes of the best quality there is, once navigation has settled."""
        good = np.array([fix.quality == RTK_FIXED for fix in self.fixes], dtype=bool)
        chosen = self.unseen & (self.t >= self.began + SETTLED)
        return chosen & good if (chosen & good).any() else chosen


def of_filter(run: FilterRun) -> Result:
    """A filter's run in the common form."""
    return Result(
        run.t,
        run.fixes,
        run.began,
        run.withheld,
        run.innovation,
        run.residual,
        run.yaw,
        run.x,
        run.P,
        run.seconds / max(1, run.epochs) * 1e6,
    )


def of_smoother(run: SmoothRun) -> Result:
    """A smoother's run in the common form."""
    forward = run.x["C_nb"][:, :, 0]
    yaw = np.arctan2(forward[:, 1], forward[:, 0])
    turn = np.interp(
        run.t - run.x["lag_velocity"], run.t, np.unwrap(yaw)
    )  # at the time of the receiver's velocity
    left = np.where(run.used[:, None], run.y[:, :6], np.nan)
    return Result(
        run.t,
        run.fixes,
        run.began,
        ~run.used,
        run.y,
        left,
        turn,
        run.x,
        run.P,
        run.seconds / max(1, run.epochs) * 1e6,
    )
