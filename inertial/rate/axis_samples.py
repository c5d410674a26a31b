"""What one axis says of itself, sample by sample: stuck, at the end of its range, spiking.

Counters are kept per axis in one integer array (rows below), readings between samples in another;
core/rate/axis_samples.cpp changes them in place. A knock moves all axes: a spike must stand out six
times from the median axis, and vibration is usual: six times from what the axis always does.
"""

import numpy as np
from numpy.typing import NDArray

from inertial.core import native

Integers = NDArray[np.int64]

# Rows of the counters: samples in a row that equal their neighbour exactly, in a row at the end of
# the range, samples since that, spikes close to one another, samples since the last.
SAME, AT_LIMIT, LIMIT_AGE, SPIKES, SPIKE_AGE = range(5)
ROWS = 5
# Rows of what is kept: the last but two, the last but one, the last, the sum of the block without
# spikes, the usual distance from the middle of the neighbours, the measured parity over the noise,
# the smallest change from one reading to the next.
EARLIER, BEFORE, LAST, SUM, USUAL, PARITY, CHANGE = range(7)
KEPT = 7
# Marks: how many of the first three are known, samples in the block, samples in PARITY.
KNOWN, FILLED, HEARD = range(3)
MARKS = 3
AGE_LONG = 1_000_000


def counters(axes: int) -> Integers:
    """Fresh counters."""
    found = np.zeros((ROWS, axes), dtype=np.int64)
    found[LIMIT_AGE], found[SPIKE_AGE] = AGE_LONG, AGE_LONG
    return found


gather = native.health.gather
"""Take samples f[begin:] (n, N), m/s^2, until a block is full or there are no more; returns the
next one's row."""
measured_noise = native.health.measured_noise
"""Variance of the axes' noise over the configured one, by the median axis; 1 where it is not more
(H-11)."""
resolution = native.health.resolution
"""What readings are rounded to, m/s^2, by the median axis, where that hides their noise; 0 where it
does not (H-14)."""
flags = native.health.flags
"""Rows of out (3, N): axes that are stuck, at the end of their range, spiking, by counts. True for
any. coarse: equal readings are usual."""
