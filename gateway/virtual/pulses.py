"""Pulses of a tachometer on a table that turns by a known rate."""

import math
from collections.abc import Iterator, Sequence

from gateway.virtual.virtual_board import BoardPulse


def table_pulses(
    angle: float, rate: float, t0_s: float, t1_s: float, pitch: float
) -> Iterator[BoardPulse]:
    """Pulses of a table turning by `rate` (rad/s) from t0_s to t1_s: one at each multiple of the
    pitch it crosses.
    """
    if rate == 0.0:
        return
    end = angle + rate * (t1_s - t0_s)
    low, high = sorted((angle, end))
    marks: Sequence[int] = range(math.floor(low / pitch) + 1, math.floor(high / pitch) + 1)
    direction = 1 if rate > 0 else -1
    for mark in marks if rate > 0 else reversed(marks):
        yield BoardPulse(t0_s + (mark * pitch - angle) / rate, direction)
