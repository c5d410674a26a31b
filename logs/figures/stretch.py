"""What two cursors ask of a curve: the figures of the samples between them."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from logs.figures.sight import Sight, vouched, worst

Array = NDArray[np.floating[Any]]


def stretch(
    t: Array, y: Array, begin: float, end: float, sight: Sight | None = None
) -> dict[str, float | int | str | None]:
    """Mean, sigma (n - 1), RMS, slope (least squares, per s), peak to peak of the finite samples
    y (n,) at t (n,) s within [begin, end]; None for what so few do not tell.

    Where `sight` (n,) is given, of the `n` samples that the estimator vouches for, `of` how many;
    `word` says why some were left out.
    """
    at = (t >= begin) & (t <= end) & np.isfinite(y)
    of, why = int(at.sum()), worst(sight[at]) if sight is not None else ""
    at &= np.isfinite(vouched(y, sight))
    x, v = np.asarray(t[at], dtype=np.float64), np.asarray(y[at], dtype=np.float64)
    n = len(v)
    found: dict[str, float | int | str | None] = dict.fromkeys(
        ("mean", "sigma", "rms", "slope", "p2p")
    )
    found |= {"n": n, "of": of, "word": why}
    if n:
        found |= {
            "mean": float(v.mean()),
            "rms": float(np.sqrt(np.mean(v * v))),
            "p2p": float(np.ptp(v)),
        }
    if n > 1:
        found["sigma"] = float(v.std(ddof=1))
        lean = x - x.mean()
        spread = float(np.sum(lean * lean))
        found["slope"] = float(np.sum(lean * (v - v.mean()))) / spread if spread > 0 else None
    return found
