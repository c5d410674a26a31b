"""What one axis says of itself, sample by sample: stuck, at the end of its range, spiking. Compiled.

Counters are kept per axis in one integer array (rows below) so that a live stream costs a few microseconds a sample.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

SAME, AT_LIMIT, LIMIT_AGE, SPIKES, SPIKE_AGE = range(5)  # rows of the counters, see `look`
ROWS = 5
AGE_LONG = 1_000_000
SPIKE_SIGMAS = 9.0  # of a sample against the middle of its neighbours, whose own noise is sqrt(1.5) of a sample's
SPIKE_MEMORY = 200  # samples; spikes farther apart do not add up


def counters(axes: int) -> Integers:
    """Fresh counters."""
    found = np.zeros((ROWS, axes), dtype=np.int64)
    found[LIMIT_AGE], found[SPIKE_AGE] = AGE_LONG, AGE_LONG
    return found


@njit(cache=True)
def look(f: Array, last: Array, before: Array, known: int, noise: Array, limit: Array, count: Integers) -> Array:
    """Take sample f (N,), m/s^2, after `last` and `before` (known: how many of the two are there). Counts per axis:

    SAME samples in a row that equal their neighbour exactly, AT_LIMIT in a row at the end of the range, samples since
    that and since a spike, and SPIKES close to one another. Returns `last` with spikes replaced by the middle of
    their neighbours. A knock moves all axes: a spike must stand out six times from the median axis.
    """
    n = len(f)
    clean = last.copy()
    for i in range(n):
        count[SAME, i] = count[SAME, i] + 1 if known >= 1 and f[i] == last[i] else 0
        if abs(f[i]) >= 0.998 * limit[i]:
            count[AT_LIMIT, i] += 1
            count[LIMIT_AGE, i] = 0
        else:
            count[AT_LIMIT, i] = 0
            count[LIMIT_AGE, i] = min(count[LIMIT_AGE, i] + 1, AGE_LONG)
        count[SPIKE_AGE, i] = min(count[SPIKE_AGE, i] + 1, AGE_LONG)
        if count[SPIKE_AGE, i] > SPIKE_MEMORY:
            count[SPIKES, i] = 0
    if known < 2:
        return clean
    off = np.abs(last - 0.5 * (f + before))
    usual = np.median(off)
    for i in range(n):
        limit_off = max(SPIKE_SIGMAS * noise[i], 6.0 * usual)
        if off[i] > limit_off and abs(f[i] - before[i]) < 0.6 * off[i]:
            count[SPIKES, i] += 1
            count[SPIKE_AGE, i] = 0
            clean[i] = 0.5 * (f[i] + before[i])
    return clean
