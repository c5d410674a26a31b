"""Many samples become a few hundred points without losing a peak, and gaps stay gaps.

A browser gets every point of a chart again with each update, so charts are decimated here: the time
window is cut into buckets and each keeps the smallest and the largest value of a series. All series
of a chart share the buckets, because uPlot wants one x array for all. uPlot draws a straight line
across NaN, so a gap is told by a mask beside the values.
"""

from collections.abc import Sequence

import numpy as np

THIN = 3.0  # usual pauses of a preview that are none yet
POINTS = 300  # per series: two per bucket


def grid(t0: float, t1: float, points: int = POINTS) -> tuple[np.ndarray, np.ndarray]:
    """Bucket edges (points/2 + 1) and the x positions (points) of a window [t0, t1], s."""
    edges = np.linspace(t0, max(t1, t0 + 1e-3), points // 2 + 1)
    width = edges[1] - edges[0]
    return edges, (edges[:-1, None] + np.array([0.25, 0.75]) * width).ravel()


def decimate(t: np.ndarray, y: np.ndarray, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Smallest and largest value of each bucket in the order in which the series moves.

    t (n,) ascending, s; y (n,); edges (b + 1,). Returns values (2 b,) and filled (b,): which
    buckets hold a sample. A bucket without one is interpolated between its neighbours, before the
    first and after the last it is held. A series without any finite value gives zeros and an
    all-False mask.
    """
    buckets = len(edges) - 1
    good = np.isfinite(y) & (t >= edges[0]) & (t <= edges[-1])
    t, y = t[good], y[good]
    filled = np.zeros(buckets, dtype=bool)
    if not len(t):
        return np.zeros(2 * buckets), filled
    bucket = np.clip(np.searchsorted(edges, t, side="right") - 1, 0, buckets - 1)
    starts = np.flatnonzero(np.diff(bucket, prepend=-1))
    held = bucket[starts]
    low, high = np.minimum.reduceat(y, starts), np.maximum.reduceat(y, starts)
    rising = y[np.append(starts[1:], len(y)) - 1] >= y[starts]
    filled[held] = True
    quarter = np.array([0.25, 0.75])
    values = np.column_stack([np.where(rising, low, high), np.where(rising, high, low)]).ravel()
    at = (np.arange(buckets)[:, None] + quarter).ravel()
    return np.interp(at, (held[:, None] + quarter).ravel(), values), filled


def gap_mask(
    t: np.ndarray,
    edges: np.ndarray,
    gap_s: float,
    thin: Sequence[Sequence[float]] = (),
) -> np.ndarray:
    """1 where no sample is nearer than a pause longer than gap_s, else 0; (2 b,) for b buckets.
    In the stretches [from, until, one sample in so many s] of `thin` a pause is THIN of these.

    The time before the first and after the last sample counts as a pause too, when it is that long.
    """
    centres = (edges[:-1, None] + np.array([0.25, 0.75]) * (edges[1] - edges[0])).ravel()
    if not len(t):
        return np.ones(len(centres))
    limits = [(begin, end, max(gap_s, THIN * every_s)) for begin, end, every_s in thin]

    def most(at: float) -> float:
        return max([gap_s, *(limit for begin, end, limit in limits if begin <= at <= end)])

    before = edges[0] if t[0] - edges[0] <= most(t[0]) else -np.inf
    behind = edges[-1] if edges[-1] - t[-1] <= most(t[-1]) else np.inf
    bounds = np.concatenate([[before], t, [behind]])
    after = np.clip(np.searchsorted(bounds, centres), 1, len(bounds) - 1)
    pauses, allowed = bounds[after] - bounds[after - 1], np.full(len(centres), gap_s)
    for begin, end, limit in limits:
        near = (bounds[after - 1] <= end) & (bounds[after] >= begin)
        allowed[near] = np.maximum(allowed[near], limit)
    gaps = pauses > allowed
    return gaps.astype(float)


def stretch_mask(stretches: Sequence[Sequence[float]], edges: np.ndarray) -> np.ndarray:
    """1 inside the stretches [from, until], s, else 0; (2 b,) for b buckets, one bucket at least
    for each.
    """
    inside = np.zeros(len(edges) - 1)
    for begin, end in stretches:
        if end >= edges[0] and begin <= edges[-1]:
            first = max(np.searchsorted(edges, begin, side="right") - 1, 0)
            inside[first : max(np.searchsorted(edges, end, side="right"), first + 1)] = 1.0
    return np.repeat(inside, 2)
