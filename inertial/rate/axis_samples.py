"""What one axis says of itself, sample by sample: stuck, at the end of its range, spiking.
Compiled.

Counters are kept per axis in one integer array (rows below) so that a live stream costs a few
microseconds a sample.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

SAME, AT_LIMIT, LIMIT_AGE, SPIKES, SPIKE_AGE = range(5)  # rows of the counters, see `look`
ROWS = 5
KNOWN, FILLED = range(2)  # of the marks of `gather`
AGE_LONG = 1_000_000
# of a sample against the middle of its neighbours, whose own noise is sqrt(1.5) of a sample's
SPIKE_SIGMAS = 9.0
SPIKE_MEMORY = 200  # samples; spikes farther apart do not add up


def counters(axes: int) -> Integers:
    """Fresh counters."""
    found = np.zeros((ROWS, axes), dtype=np.int64)
    found[LIMIT_AGE], found[SPIKE_AGE] = AGE_LONG, AGE_LONG
    return found


@njit(cache=True)
def gather(
    f: Array,
    begin: int,
    per_block: int,
    near: Array,
    marks: Integers,
    noise: Array,
    limit: Array,
    count: Integers,
) -> int:
    """Take samples f[begin:] (n, N), m/s^2, until a block is full or there are no more; returns the
    next one's row.

    near (3, N): the sample before the last, the last, and the sum of the block, spikes removed;
    marks: how many of the two are known, and samples in the block.
    """
    for k in range(begin, len(f)):
        clean = look(f[k], near[1], near[0], marks[KNOWN], noise, limit, count)
        if marks[KNOWN] > 0:
            near[2] += clean
            marks[FILLED] += 1
        near[0] = clean if marks[KNOWN] == 2 else near[1]
        near[1] = f[k]
        marks[KNOWN] = min(marks[KNOWN] + 1, 2)
        if marks[FILLED] >= per_block:
            return k + 1
    return len(f)


@njit(cache=True)
def flags(count: Integers, stuck: int, at_limit: int, spikes: int, out: NDArray[np.bool_]) -> bool:
    """Rows of out (3, N): axes that are stuck, at the end of their range, spiking, by counts. True
    for any.
    """
    n, standing, found = count.shape[1], 0, False
    for i in range(n):
        out[0, i], out[1, i] = count[SAME, i] >= stuck, count[AT_LIMIT, i] >= at_limit
        out[2, i] = count[SPIKES, i] >= spikes
        standing += 1 if out[0, i] else 0
    if standing * 2 > n:  # most stand still exactly: a source without noise, not a fault
        out[0] = False
    for i in range(n):
        found = found or out[0, i] or out[1, i] or out[2, i]
    return found


@njit(cache=True)
def look(
    f: Array, last: Array, before: Array, known: int, noise: Array, limit: Array, count: Integers
) -> Array:
    """Take sample f (N,), m/s^2, after `last` and `before` (known: how many of the two are there).
    Counts per axis:

    SAME samples in a row that equal their neighbour exactly, AT_LIMIT in a row at the end of the
    range, samples since that and since a spike, and SPIKES close to one another. Returns `last`
    with spikes replaced by the middle of their neighbours. A knock moves all axes: a spike must
    stand out six times from the median axis.
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
