"""The last samples of a live filter in arrays, so that a late fix is applied at its own time."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

CAPACITY = 8192  # samples; at 1 kHz 8 s
KEEP = 4096  # samples kept when the buffer is full
LATEST = 2.0  # s that a fix may be late


class History:
    """Positions count from the oldest sample kept; `drop` tells its caller by how many they
    moved.
    """

    def __init__(self) -> None:
        self.t = np.empty(CAPACITY)
        self.f = np.empty((CAPACITY, 3))
        self.w = np.empty((CAPACITY, 3))
        self.count = 0

    @property
    def newest(self) -> float | None:
        """Time of the newest sample, s."""
        return float(self.t[self.count - 1]) if self.count else None

    def append(self, t: float, f: Array, w: Array) -> int:
        """Keep a sample; the oldest go when the buffer is full. Returns how many went."""
        dropped = 0
        if self.count == CAPACITY:
            dropped = CAPACITY - KEEP
            for a in (self.t, self.f, self.w):
                a[:KEEP] = a[dropped:].copy()
            self.count = KEEP
        self.t[self.count] = t
        self.f[self.count] = f
        self.w[self.count] = w
        self.count += 1
        return dropped

    def clear(self) -> None:
        """Forget everything."""
        self.count = 0

    def after(self, t: float) -> int:
        """Position of the first sample later than t; the number of samples when there is none."""
        return int(np.searchsorted(self.t[: self.count], t, side="right"))

    def reaches(self, t: float) -> bool:
        """True when the samples kept begin at or before t."""
        return self.count > 0 and self.t[0] <= t
