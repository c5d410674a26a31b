"""Samples into bins of time, pulses into a rate, positions into a track: the parts of
curves_build.py.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from inertial.earth import ned_between
from sessions.library.curves import Line, Track, bins_of
from sessions.report.data import Tacho
from sessions.report.segments import reference

Array = NDArray[np.float64]

GAP_PERIODS = 4.0  # a hole of more than so many sample periods is a gap and stays one
LEAST_GAP_S = 0.05
PULSE_S = 0.1  # a pulse nearer than that says that the line worked
POINTS = 4000  # of a track, at most
UNTOLD = (np.nan, np.nan, np.nan, 0.0)  # nothing is said of how certain a position is


class Binner:
    """Mean, least and greatest per bin, as samples come."""

    def __init__(self, key: str, seconds: float, bin_s: float, width: int) -> None:
        n = bins_of(seconds, bin_s)
        self._key, self._bin_s = key, bin_s
        self._sum = np.zeros((n, width))
        self._count = np.zeros(n, dtype=np.int64)
        self._low = np.full((n, width), np.inf, dtype=np.float32)
        self._high = np.full((n, width), -np.inf, dtype=np.float32)
        self._period = np.inf
        self._sight: NDArray[np.uint8] | None = None

    def add(self, t: Array, values: Array, sight: NDArray[Any] | None = None) -> None:
        """Samples at times t (m,), values (m, width), nearly in order; sight (m, 3) of a rate."""
        if len(t) > 1:
            self._period = min(self._period, float(np.median(np.diff(t))))
        at = np.clip((t / self._bin_s).astype(np.int64), 0, len(self._count) - 1)
        begins = np.flatnonzero(np.diff(at, prepend=-1))
        bins = at[begins]
        np.add.at(self._sum, bins, np.add.reduceat(values, begins))
        np.add.at(self._count, bins, np.diff(begins, append=len(at)))
        np.minimum.at(self._low, bins, np.minimum.reduceat(values, begins).astype(np.float32))
        np.maximum.at(self._high, bins, np.maximum.reduceat(values, begins).astype(np.float32))
        if sight is not None:
            if self._sight is None:
                self._sight = np.zeros((len(self._count), 3), dtype=np.uint8)
            worst = np.maximum.reduceat(sight, begins).astype(np.uint8)
            np.maximum.at(self._sight, bins, worst)

    def line(self, n: int) -> Line:
        """The first n bins as a line; holes no longer than a few samples are closed."""
        count = self._count[:n]
        mean = np.where(count[:, None] > 0, self._sum[:n] / np.maximum(count, 1)[:, None], np.nan)
        period = self._period if np.isfinite(self._period) else self._bin_s
        longest = int(max(GAP_PERIODS * period, LEAST_GAP_S, 2.5 * self._bin_s) / self._bin_s)
        holes = _holes(count > 0, longest)
        mean = _closed(mean, holes).astype(np.float32)
        sight = None if self._sight is None else self._sight[:n]
        if count.max(initial=0) <= 1:
            return Line(self._key, mean, mean, mean, sight=sight)
        low = np.where(count[:, None] > 0, self._low[:n], np.nan)
        high = np.where(count[:, None] > 0, self._high[:n], np.nan)
        low, high = np.fmin(_closed(low, holes), mean), np.fmax(_closed(high, holes), mean)
        return Line(self._key, mean, low, high, sight=sight)


def _holes(there: NDArray[np.bool_], longest: int) -> NDArray[np.bool_]:
    """Bins that are empty, but between full ones and in a run of at most `longest`."""
    edges = np.flatnonzero(np.diff(np.concatenate([[True], there, [True]]).astype(np.int8)))
    result = np.zeros(len(there), dtype=bool)
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        if begin > 0 and end < len(there) and end - begin <= longest:
            result[begin:end] = True
    return result


def _closed(values: NDArray[Any], holes: NDArray[np.bool_]) -> NDArray[Any]:
    """Values with the holes interpolated."""
    if not holes.any():
        return values
    index = np.arange(len(values))
    there = np.isfinite(values).all(axis=1)
    result = values.copy()
    for k in range(values.shape[1]):
        result[holes, k] = np.interp(index[holes], index[there], values[there, k])
    return result


class PulseLine:
    """Rate from tachometer pulses, which come at no fixed times and not at all while the table
    stands.
    """

    def __init__(self, key: str) -> None:
        self._key = key
        self._t: list[Array] = []
        self._omega: list[Array] = []

    def add(self, t: Array, omega: Array) -> None:
        """Pulses."""
        self._t.append(t)
        self._omega.append(omega)

    def line(
        self, n: int, bin_s: float, coarse: bool, dark: NDArray[np.bool_] | None = None
    ) -> Line:
        """The reference of report/segments.py in the middle of every bin; of a part of the pulses
        only their means.

        `dark` (n,): bins without any other sample of the device; no pulse there does not mean that
        the table stands.
        """
        t, omega = np.concatenate(self._t), np.concatenate(self._omega)
        order = np.argsort(t, kind="stable")
        t, omega = t[order], omega[order]
        if coarse:
            binner = Binner(self._key, n * bin_s, bin_s, 1)
            binner.add(t, omega[:, None])
            return binner.line(n)
        middle = (np.arange(n) + 0.5) * bin_s
        rate = reference(Tacho(t, omega, np.zeros(len(t))), middle).astype(np.float32)[:, None]
        if dark is not None and dark.any():
            after = np.searchsorted(t, middle)
            since = middle - t[np.maximum(after - 1, 0)]
            until = t[np.minimum(after, len(t) - 1)] - middle
            rate[dark & (np.minimum(np.abs(since), np.abs(until)) > PULSE_S)] = np.nan
        return Line(self._key, rate, rate, rate)


class TrackLine:
    """Positions over time, NED from an origin; thinned by halves so that it stays small."""

    def __init__(self, key: str, origin: tuple[float, float, float]) -> None:
        self._key, self._origin = key, origin
        self._points: list[tuple[float, ...]] = []
        self._every, self._seen = 1, 0

    def add(
        self, t: float, north: float, east: float, down: float, told: tuple[float, ...] = UNTOLD
    ) -> None:
        """One position, m; told as Track has it."""
        self._seen += 1
        if self._seen % self._every:
            return
        self._points.append((t, north, east, down, *told))
        if len(self._points) >= 2 * POINTS:
            self._points = self._points[::2]
            self._every *= 2

    def add_place(
        self, t: float, place: tuple[float, float, float], told: tuple[float, ...] = UNTOLD
    ) -> None:
        """One position: latitude and longitude, rad, and height, m."""
        north, east, down = ned_between(self._origin, place)
        self.add(t, north, east, down, told)

    def track(self) -> Track:
        """What it has become."""
        points = np.array(self._points) if self._points else np.zeros((0, 8))
        return Track(self._key, points[:, :4], self._origin, points[:, 4:])
