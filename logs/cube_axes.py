"""What a log says of its axes, before any estimator: noise, stuck and saturated samples of each,
and how well they agree where a layout has more axes than the field has unknowns (E-4).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inertial.doubts.watch import SettingsWatch
from inertial.layouts.layout import RANK_TOLERANCE, Layout
from inertial.rate.observed import axis_noise
from logs.cube_log import CubeLog
from logs.cube_parts import Monitored

Array = NDArray[np.float64]

STUCK_S = 1.0  # s of exactly the same reading ; at rest, coarse counts may repeat for long
SATURATED = (
    (-4096, 0.5),
    (4095, -0.5),
)  # and half a count within; counts, ADXL345 in full resolution, +-16 g
NOISELESS = 1e-3  # m/s^2; no accelerometer is quieter
MOVING = (
    0.5  # m/s^2, standard deviation of the other axes over a stretch that tells turning from rest
)
REPORT_S = 0.05  # between reports of a gateway's tachometer
DISAGREE = 2.0  # times the noise; less is what a good calibration leaves


def axes_of(data: CubeLog, shape: Layout, watched: Monitored) -> dict[str, dict[str, Any]]:
    """As `examine`, with the axis monitor's word where it says that an axis is not good."""
    found = examine(data, shape)
    for name, fault in zip(data.names, watched.faults, strict=True):
        if fault.word != "good":
            found[name]["state"] = fault.word
            found[name]["text"] = fault.text
    return found


def examine(data: CubeLog, shape: Layout) -> dict[str, dict[str, Any]]:
    """By axis: state "good", "stuck" or "saturated", noise (m/s^2, one sample), samples lost to
    either.
    """
    moves = moving(data)
    noises = np.array([_noise(column) for column in data.f_axis.T])
    usual = float(np.median(noises))
    if usual < NOISELESS:
        moves[:] = False  # a computed log: axes along the table's axis stand still in it
    elif usual > 0.4 * data.lsb_mps2:
        moves[:] = True  # so much noise never reads the same for a second, at rest or not
    found = {}
    for k, name in enumerate(data.names):
        column, noise = data.f_axis[:, k], float(noises[k])
        stuck = _longest_run(column, moves) * data.period_s
        saturated = 0
        if data.lsb_mps2:
            low, high = (data.lsb_mps2 * (limit + side) for limit, side in SATURATED)
            saturated = int(np.count_nonzero((column < low) | (column > high)))
        state = "stuck" if stuck >= STUCK_S else "saturated" if saturated else "good"
        found[name] = {
            "state": state,
            "noise_mps2": noise,
            "mean_mps2": float(column.mean()),
            "longest_stuck_s": float(stuck),
            "saturated_samples": saturated,
        }
    return found


def _noise(column: NDArray[np.float64]) -> float:
    """Of one axis, from sample to sample; robust against motion."""
    steps = np.diff(column)
    return float(1.4826 * np.median(np.abs(steps - np.median(steps))) / np.sqrt(2.0))


def moving(data: CubeLog) -> NDArray[np.bool_]:
    """(n,), True in stretches of a second in which at least a third of the axes scatter."""
    n = max(8, int(round(1.0 / data.period_s)))
    moving = np.zeros(len(data.t_s), dtype=bool)
    for first in range(0, len(moving), n):
        stretch = data.f_axis[first : first + n]
        moving[first : first + n] = np.mean(stretch.std(axis=0) > MOVING) > 1.0 / 3.0
    return moving


def _longest_run(column: NDArray[np.float64], moving: NDArray[np.bool_]) -> int:
    """Samples of the longest run of equal readings while the body moves."""
    same = np.concatenate([[False], (np.diff(column) == 0.0)]) & moving
    ends = np.nonzero(np.diff(np.concatenate([[0], same.astype(int), [0]])))[0].reshape(-1, 2)
    return int((ends[:, 1] - ends[:, 0]).max(initial=-1)) + 1


@dataclass(frozen=True)
class Agreement:
    """RMS of one axis' part that no motion explains, m/s^2; noise: of the layout."""

    noise: float
    still: float
    turning: float

    @property
    def sigma_axis(self) -> float:
        """Noise that the axes really have while the body turns, m/s^2."""
        return max(self.noise, self.turning)

    @property
    def text(self) -> str:
        """For people; empty where the axes agree."""
        if self.turning < DISAGREE * self.noise:
            return ""
        return (
            f"no motion of a rigid body explains {self.turning:.2f} m/s² RMS of each axis while it"
            f" turns, {self.turning / self.noise:.0f} times its noise ({self.still:.2f} m/s² at"
            " rest): sensors that do not sample together, a body that is not rigid, or positions"
            " and directions that are not these; the bound is that of this noise"
        )


def agreement(shape: Layout, f_axis: Array, turning: NDArray[np.bool_]) -> Agreement | None:
    """Of readings f_axis (n, N), m/s^2; turning (n,). None where every reading could be a motion,
    or nothing turns.
    """
    F = shape.field_matrix
    left, sigma, _ = np.linalg.svd(F / np.linalg.norm(F, axis=0).clip(1e-12))
    rank = int(np.sum(sigma > RANK_TOLERANCE * sigma.max()))
    if rank == shape.axes or not turning.any():
        return None
    rest = f_axis[~turning] if (~turning).any() else f_axis
    apart = (f_axis - np.median(rest, axis=0)) @ left[:, rank:]
    square = np.mean(apart**2, axis=1)
    still = float(np.sqrt(square[~turning].mean())) if (~turning).any() else 0.0
    return Agreement(axis_noise(shape), still, float(np.sqrt(square[turning].mean())))


def doubts_of_settings(data: CubeLog, shape: Layout, lsb_mg: float | None) -> list[str]:
    """What a board with this log's data would be told live, in words; not of the scale: a log's
    units are judged before.
    """
    watch = SettingsWatch(shape, lsb_mg, live=False)
    f_axis, size = data.f_axis * np.array(shape.gain), max(1, round(REPORT_S / data.period_s))
    for k in range(0, len(f_axis), size):
        if data.tacho is not None:
            watch.tacho(float(data.t_s[k]), float(data.tacho[k]))
        watch.feed(data.t_s[k : k + size], f_axis[k : k + size])
    return [f"is a setting wrong? {d.text}" for d in watch.doubts() if d.subject != "gravity"]
