"""When did another session do the same? Two signals laid over one another by their correlation.

The signals may have different lengths and gaps (NaN). For every shift the correlation coefficient
is that of the samples which both have, by six FFTs (D. Padfield, Masked object registration in the
Fourier domain, IEEE Trans. Image Process. 21, 2012, in one dimension; (S-1) of
docs/equations-sessions.md). A shift that leaves little in common may correlate by chance, so shifts
are ranked by the test statistic of a correlation, r sqrt(e / (1 - r^2)), with the share e of both
signals' variation that lies in what they have in common (S-2). The best is refined between samples
by a parabola (S-3).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft

Array = NDArray[np.float64]

SHARE = 0.2  # of the shorter signal that must be in common ...
LEAST_S = 2.0  # ... and s
GOOD = 0.8  # correlation from which an alignment is believed
POOR = 0.5  # below it there is none
RIVAL = 0.9  # another shift with that share of the best one's score makes it ambiguous
FLAT = 1e-9  # share of a signal's variance below which a window of it is constant
BEST = 0.98  # better correlations count the same: two runs are never the same to the last percent


@dataclass(frozen=True)
class Shift:
    """Where the second signal lies on the first one's time axis."""

    offset_s: float  # time of the first = time of the second + offset
    correlation: float  # of what both have there, -1 to 1
    overlap_s: float
    rival_s: float | None = None  # the best other shift, and its correlation
    rival_correlation: float | None = None
    rival_share: float = 0.0  # its score relative to the best one's, 0 to 1

    @property
    def quality(self) -> str:
        """good, ambiguous (another shift does as well), poor, or none."""
        if self.correlation < POOR:
            return "none"
        if self.correlation < GOOD:
            return "poor"
        return "ambiguous" if self.rival_share > RIVAL else "good"


def correlate(a: Array, b: Array, dt: float) -> Shift | None:
    """The shift of b (m,) over a (n,), both sampled every dt s from their own zero, NaN where there
    is nothing.

    None where no shift leaves max(LEAST_S, SHARE of the shorter one) of varying signal in common.
    """
    r, n, share, lags = correlations(a, b)
    least = max(LEAST_S / dt, SHARE * min(np.isfinite(a).sum(), np.isfinite(b).sum()))
    allowed = (n >= least) & np.isfinite(r)
    if not allowed.any():
        return None
    r = np.where(allowed, r, -1.0)
    bounded = np.clip(r, 0.0, BEST)
    score = bounded * np.sqrt(share / (1.0 - bounded**2))
    best = _top(r, int(score.argmax()))
    step = _vertex(r, best)
    rival = _rival(r, score, best, dt)
    return Shift(
        offset_s=float((lags[best] + step) * dt),
        correlation=float(r[best]),
        overlap_s=float(n[best] * dt),
        rival_s=None if rival is None else float(lags[rival] * dt),
        rival_correlation=None if rival is None else float(r[rival]),
        rival_share=0.0 if rival is None else float(score[rival] / score[best]),
    )


def correlations(a: Array, b: Array) -> tuple[Array, Array, Array, NDArray[np.int64]]:
    """(r, n, e, lag) at every lag, a[i + lag] over b[i]: correlation, common samples, share of the
    variation (S-1).
    """
    size = next_fast_len(len(a) + len(b) - 1, real=True)

    def spectra(x: Array) -> tuple[Array, Array, Array, float]:
        there = np.isfinite(x)
        level = x[there].mean() if there.any() else 0.0
        clean = np.where(there, x - level, 0.0)
        return (
            rfft(there.astype(float), size),
            rfft(clean, size),
            rfft(clean**2, size),
            float((clean**2).sum()),
        )

    ones_a, sum_a, square_a, whole_a = spectra(a)
    ones_b, sum_b, square_b, whole_b = spectra(b)
    lags = np.arange(-(len(b) - 1), len(a))

    def over(x: Array, y: Array) -> Array:
        return irfft(x * np.conj(y), size)[
            lags
        ]  # a negative lag counts from the end: the transform is periodic

    n = np.round(over(ones_a, ones_b))
    count = np.maximum(n, 1.0)
    total_a, total_b = over(sum_a, ones_b), over(ones_a, sum_b)
    spread_a = over(square_a, ones_b) - total_a**2 / count
    spread_b = over(ones_a, square_b) - total_b**2 / count
    common = over(sum_a, sum_b) - total_a * total_b / count
    varies = (spread_a > FLAT * whole_a) & (spread_b > FLAT * whole_b) & (n >= 3)
    r, share = np.full(len(lags), np.nan), np.zeros(len(lags))
    both = np.sqrt(spread_a[varies] * spread_b[varies])
    r[varies] = np.clip(common[varies] / both, -1.0, 1.0)
    share[varies] = both / np.sqrt(whole_a * whole_b)
    return r, n, share, lags


def _top(r: Array, k: int) -> int:
    """The highest correlation of the peak that k belongs to, as far as all of it is above BEST."""
    if r[k] < BEST:
        return k
    low = np.flatnonzero(r < BEST)
    begin = low[low < k][-1] + 1 if (low < k).any() else 0
    end = low[low > k][0] if (low > k).any() else len(r)
    return int(begin + r[begin:end].argmax())


def _vertex(r: Array, k: int) -> float:
    """Where the parabola through r[k-1], r[k], r[k+1] is highest, in steps from k (S-3)."""
    if not 0 < k < len(r) - 1:
        return 0.0
    before, here, after = r[k - 1], r[k], r[k + 1]
    bend = before - 2.0 * here + after
    return float(np.clip(0.5 * (before - after) / bend, -0.5, 0.5)) if bend < 0.0 else 0.0


def _rival(r: Array, score: Array, best: int, dt: float) -> int | None:
    """The best shift outside the peak of the best one, which ends where the correlation has fallen
    to half.
    """
    low = r < 0.5 * r[best]
    left = np.flatnonzero(low[:best])
    right = np.flatnonzero(low[best:])
    begin = left[-1] if len(left) else 0
    end = best + right[0] if len(right) else len(r) - 1
    outside = np.ones(len(r), dtype=bool)
    outside[
        min(begin, best - int(1.0 / dt)) if begin else 0 : max(end, best + int(1.0 / dt)) + 1
    ] = False
    if not (outside & (score > 0.0)).any():
        return None
    return _top(np.where(outside, r, -1.0), int(np.where(outside, score, -1.0).argmax()))
