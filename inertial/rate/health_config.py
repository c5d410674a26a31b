"""Limits of the axis monitor (health.py), and what it tells."""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

STANDSTILL = (
    50  # blocks that offsets are learned from: long enough to tell a slow turn by gravity's own
)


@dataclass(frozen=True)
class Config:
    """Limits; times in s, sigmas in SI."""

    block_s: float = 0.04  # samples of so long are averaged for the parity filter
    sigma_alpha: float = 200.0  # rad/s^2 per root s: angular acceleration may do what it likes
    sigma_force: float = 4.0  # m/s^2 per root s, the same for the specific force
    # of 1: scale and cross-axis error of an axis that is still good, 2.4 sigma uncalibrated
    scale: float = 0.012
    scale_sigmas: float = 2.4  # of the sensor's own scale error, where that is more
    offset_sigmas: float = 1.5  # of the sensor's uncalibrated offset, before the first standstill
    offset_left: float = 0.03  # m/s^2, after it: drift
    gate: float = 1.5  # of the NIS expected of a block: what lies above it adds up
    alarm: float = 10.0  # times the axes in use: sum at which hypotheses are asked
    doubt: float = 1.0  # the same: sum at which nothing is valid until it is explained
    decide_s: float = (
        1.3  # s after which the best explanation counts although another axis is nearly as good
    )
    stuck_s: float = 0.4  # s of exactly equal readings
    limit_s: float = 0.03  # s at the end of the range
    spikes: int = 3  # of one axis within axis_samples.SPIKE_MEMORY
    good_s: float = 2.0  # s of good readings before an axis is believed again
    longest_good_s: float = 16.0  # that time doubles with every relapse, up to this
    relapse_s: float = 60.0  # s after which a fault is a new one and no relapse
    evidence: float = 30.0  # -2 log likelihood ratio for good against the fault


@dataclass
class Counts:
    """What the monitor did."""

    named: int = 0
    returned: int = 0
    restarts: int = 0  # readings did not fit any motion and no axis explains it
    explained_by_start: int = 0
    widened: int = 0  # all axes were found less exact than expected, and none is at fault
    spikes_removed: int = 0
    blocks: int = 0


@dataclass
class Newest:
    """Of the last block."""

    residual: Array
    sigma: Array
    nis: float = 0.0
    degrees: int = 0
    filled: bool = field(default=False)


class Part(NamedTuple):
    """Samples up to row `end` of a batch, and what was thought of the axes then."""

    end: int
    mask: int  # bit k: axis k is excluded
    doubted: bool  # readings do not fit one motion, and nothing explains that yet
