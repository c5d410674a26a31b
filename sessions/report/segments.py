"""A run of a rate table cut into standstills and plateaus, by the tachometer alone; nobody has to
mark anything.

A plateau is where the smoothed reference changes by less than SLOPE for at least SHORTEST; SETTLE
is cut off at both ends, as the table and the smoothing need it. A standstill is a plateau below
STILL.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sessions.report.data import Tacho

Array = NDArray[np.float64]

STEP = 0.01  # s, grid
GRID_LEAST, GRID_PER_PULSE = 1_000_000, 20  # its points are at most the larger of these
SILENCE = 0.6  # s without a pulse: the table stands (1 degree per pulse: below 1.7 deg/s)
SMOOTH = 0.3  # s
SLOPE = np.radians(12.0)  # rad/s^2
SHORTEST = 1.0  # s
SETTLE = 0.25  # s
STILL = np.radians(1.0)  # rad/s


@dataclass(frozen=True)
class Segment:
    """One plateau, or a standstill."""

    begin: float  # s
    end: float  # s
    omega: float  # rad/s, mean of the reference
    scatter: float  # rad/s, standard deviation of the reference
    settle: float  # s, from the end of the segment before until this one begins

    @property
    def still(self) -> bool:
        """The table stands."""
        return abs(self.omega) < STILL

    @property
    def seconds(self) -> float:
        """Length, s."""
        return self.end - self.begin

    def holds(self, t: Array) -> NDArray[np.bool_]:
        """Which of the times are inside."""
        return (t >= self.begin) & (t <= self.end)


def reference(tacho: Tacho, t: Array) -> Array:
    """Rate of the table at times t, rad/s: linear between pulses, zero where no pulse comes for
    SILENCE.

    A rate from pulses is the mean since the pulse before it, so it stands for the middle of that
    time. Where pulses begin or end, the line through the nearest two is drawn on to zero.
    """
    groups = np.split(np.arange(len(tacho.t)), np.flatnonzero(np.diff(tacho.t) > SILENCE) + 1)
    times: list[Array] = []
    rates: list[Array] = []
    for group in groups:
        if len(group) < 4:
            continue  # a nudge
        at, omega = tacho.t[group], tacho.omega[group]
        middle = 0.5 * (at[1:] + at[:-1])  # the first pulse after a silence has no rate
        ends = _to_zero(middle[:2], omega[1:3]), _to_zero(middle[-2:][::-1], omega[-2:][::-1])
        times.append(np.concatenate([[ends[0]], middle, [ends[1]]]))
        rates.append(np.concatenate([[0.0], omega[1:], [0.0]]))
    if not times:
        return np.zeros_like(t)
    return np.interp(t, np.concatenate(times), np.concatenate(rates), left=0.0, right=0.0)


def grid(tacho: Tacho, begin: float, end: float) -> tuple[Array, float]:
    """Times from begin to before end, STEP apart, and that step: wider where time stamps span more
    than there are data for, so that memory goes with the data and not with the stamps.
    """
    most = max(GRID_LEAST, GRID_PER_PULSE * len(tacho.t))
    step = max(STEP, (end - begin) / most)
    return np.arange(begin, end, step), step


def measured(tacho: Tacho, t: Array) -> NDArray[np.bool_]:
    """Where the reference is a measurement: not within SILENCE before pulses begin and after they
    end.
    """
    begins = tacho.t[np.flatnonzero(np.diff(tacho.t, prepend=-np.inf) > SILENCE)]
    ends = tacho.t[np.flatnonzero(np.diff(tacho.t, append=np.inf) > SILENCE)]
    guess = np.zeros(len(t), dtype=bool)
    for begin in begins:
        guess |= (t > begin - SILENCE) & (t < begin + 0.1)
    for end in ends:
        guess |= (t > end - 0.1) & (t < end + SILENCE)
    return ~guess


def _to_zero(t: Array, omega: Array) -> float:
    """Where the line through two rates, the outer one first, meets zero; at most SILENCE / 2 from
    the outer one.
    """
    outward = t[0] - t[1]
    change = omega[0] - omega[1]
    reach = -omega[0] / change * outward if change * omega[0] < 0.0 else np.sign(outward) * SILENCE
    return float(t[0] + np.clip(reach, -0.5 * SILENCE, 0.5 * SILENCE))


def segment(tacho: Tacho, seconds: float) -> list[Segment]:
    """Plateaus and standstills of a run of that length, in order."""
    from scipy.ndimage import (
        median_filter,
        uniform_filter1d,
    )  # here: slow to load, and `reference` wants none of it

    t, step = grid(tacho, 0.0, seconds)
    if len(t) < 10:
        return []
    raw = reference(tacho, t)
    width = max(1, int(SMOOTH / step))
    smooth = uniform_filter1d(median_filter(raw, width | 1), width)
    flat = np.abs(np.gradient(smooth, step)) < SLOPE
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flat.astype(int), [0]])))
    found: list[Segment] = []
    for first, last in zip(edges[::2], edges[1::2], strict=True):
        begin = t[first] + (SETTLE if first > 0 else 0.0)
        end = t[last - 1] - (SETTLE if last < len(t) else 0.0)
        if end - begin < SHORTEST:
            continue
        at = (t >= begin) & (t <= end)
        before = found[-1].end if found else 0.0
        mean, scatter = float(raw[at].mean()), float(raw[at].std())
        found.append(Segment(float(begin), float(end), mean, scatter, float(begin - before)))
    return found
