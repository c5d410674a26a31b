"""A run on the turning table, with the tachometer, as blocks for the fit."""

import numpy as np
from numpy.typing import NDArray

from inertial.calibration.fit import CalibrationError
from inertial.calibration.model import Steps

Array = NDArray[np.float64]

BLOCK_S = 0.2  # s; noise falls with its root, a table's ramp is still straight in it
TURNING = 0.2  # rad/s; a log that never exceeds it has no steps
TACHO_SIGMA = 0.005  # rad/s, of one reading: a pulse's length at 360 pulses per turn


def turns(tacho: Array | None) -> bool:
    """Does the table turn in this log?"""
    return tacho is not None and bool((np.abs(tacho) > TURNING).any())


def blocks(
    t_s: Array, f_axis: Array, tacho: Array, period_s: float, tacho_sigma: float = TACHO_SIGMA
) -> Steps:
    """Means over blocks of BLOCK_S of a log: times (n,), readings (n, N), table rate (n,) rad/s
    about its axis up.

    Blocks with a gap are left out. Raises CalibrationError where nothing turns.
    """
    if not turns(tacho):
        raise CalibrationError(
            f"the table never turns faster than {TURNING} rad/s: no steps to fit"
        )
    size = max(4, round(BLOCK_S / period_s))
    angle = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(t_s) * (tacho[1:] + tacho[:-1]))])
    n = len(t_s) // size
    if n < 2:
        raise CalibrationError(
            f"{len(t_s)} samples, want at least {2 * size}: two blocks of {BLOCK_S} s"
        )

    def cut(values: Array) -> Array:
        return values[: n * size].reshape(n, size, *values.shape[1:])

    t, w = cut(t_s), cut(tacho)
    # a cubic through 11 readings: exact on a ramp that bends, where a straight line through a block
    # is not
    from scipy.signal import savgol_filter  # here: heavy, and only a calibration needs it

    alpha = savgol_filter(tacho, min(11, len(tacho) // 2 * 2 - 1), 3, deriv=1, delta=period_s)
    whole = (t[:, -1] - t[:, 0]) < 1.5 * size * period_s
    return Steps(
        mean=cut(f_axis).mean(axis=1)[whole],
        samples=np.full(int(whole.sum()), size),
        cos=np.cos(cut(angle)).mean(axis=1)[whole],
        sin=np.sin(cut(angle)).mean(axis=1)[whole],
        rate2=(w**2).mean(axis=1)[whole],
        alpha=cut(alpha).mean(axis=1)[whole],
        alpha_sigma=np.full(int(whole.sum()), np.sqrt(2.0) * tacho_sigma / (size * period_s)),
    )
