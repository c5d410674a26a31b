"""Spectral density of a stretch of samples, live and of a recording."""

import numpy as np
from numpy.typing import NDArray
from scipy.signal import welch

Array = NDArray[np.float64]

SEGMENTS = 8  # of Welch's method, half over one another, at least; more average more
HOLE = 1.6  # usual periods; a longer pause ends a stretch


def unbroken(t: Array, y: Array) -> tuple[Array, float]:
    """The longest stretch of y (n,) without a hole, and its period, s; empty where there is none.

    A value that is not finite is a hole. A spectrum over a hole would be one of the hole.
    """
    good = np.isfinite(y)
    t, y = t[good], y[good]
    if len(t) < 3:
        return y[:0], 0.0
    steps = np.diff(t)
    period = float(np.median(steps))
    cuts = np.concatenate([[0], np.flatnonzero(steps > HOLE * period) + 1, [len(t)]])
    longest = int(np.argmax(np.diff(cuts)))
    at = slice(cuts[longest], cuts[longest + 1])
    count = len(t[at])
    return y[at], float(t[at][-1] - t[at][0]) / max(1, count - 1)


def density(y: Array, period: float) -> tuple[Array, Array]:
    """Frequency, Hz, and one-sided power spectral density, unit²/Hz, by Welch's method (Hann, half
    over one another); without the frequency 0.
    """
    length = max(16, 2 * len(y) // (SEGMENTS + 1))
    f, p = welch(y, fs=1.0 / period, nperseg=min(length, len(y)), detrend="linear")
    return f[1:], p[1:]
