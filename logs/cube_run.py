"""What an estimator said over a log of a cube, and what it is compared with."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inertial.rate.sight import VALID
from logs.cube_log import CubeLog

Array = NDArray[np.float64]


@dataclass(frozen=True)
class EstimatorRun:
    """What one estimator said, arrays over samples (n)."""

    name: str
    omega_b: Array  # (n, 3) rad/s
    P: Array  # (n, 3, 3)
    q_nb: Array  # (n, 4)
    angle_z: Array  # (n,) rad
    alpha_b: Array  # (n, 3) rad/s^2
    f_b: Array  # (n, 3) m/s^2
    still: NDArray[np.bool_]  # (n,)
    p_n: Array  # (n, 3) m
    sight: NDArray[np.uint8]  # (n, 3), of sight.VALID, AMBIGUOUS, BLIND, by component of omega
    started: NDArray[np.bool_]  # (n,), whether anything was known of the rate
    us_per_sample: float
    blind: str = ""  # why omega was not known in more than half of the samples; empty: it was
    kept: str = ""  # why it knew nothing for a while; empty: it went on

    @property
    def valid(self) -> NDArray[np.bool_]:
        """Components of omega that the estimator vouches for, (n, 3)."""
        return (self.sight == VALID) & self.started[:, None]


@dataclass(frozen=True)
class Reference:
    """What the estimates are compared with. NaN where it is not known."""

    name: str  # "truth", "tachometer" or ""
    omega_b: Array  # (n, 3) rad/s
    angle_z: Array  # (n,) rad, integral of omega_z; NaN without it


def reference(data: CubeLog) -> Reference:
    """Truth if the log has it, else the tachometer, else nothing."""
    omega = np.full((len(data.t_s), 3), np.nan)
    name = ""
    if data.omega_b is not None:
        omega, name = data.omega_b, "truth"
    elif data.tacho is not None:
        omega[:, 2], name = data.tacho, "tachometer"
    step = 0.5 * np.diff(data.t_s) * (omega[1:, 2] + omega[:-1, 2])
    return Reference(name, omega, np.concatenate([[0.0], np.cumsum(step)]) + 0.0 * omega[:, 2])
