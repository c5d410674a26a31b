"""A table of the newest rows over time, which the charts read."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

FIRST_ROWS = 256  # of a new ring; it grows as it fills
SLACK = 4  # one part in so many is room to write on before the rows are moved to the front
SAME_S = 1e-6  # rows nearer than this in time are one


class Ring:
    """The newest `capacity` rows of a structured type whose first field is `t`, s, ascending.

    The rows lie in one piece, so that a window is a view without a copy. Not locked: the store does
    that, and a window is good until the next write.
    """

    def __init__(
        self, dtype: np.dtype, capacity: int, may_grow: Callable[[int], bool] = lambda _: True
    ) -> None:
        """may_grow(bytes): is there memory for so much more? Where not, fewer rows are kept."""
        self._rows = np.empty(_with_slack(min(capacity, FIRST_ROWS)), dtype)
        self._capacity, self._may_grow = capacity, may_grow
        self._end = 0
        self.count = 0

    @property
    def nbytes(self) -> int:
        """Memory of the rows."""
        return self._rows.nbytes

    @property
    def dtype(self) -> np.dtype:
        """Type of a row."""
        return self._rows.dtype

    def append(self, t: ArrayLike, **columns: ArrayLike) -> None:
        """Add rows at times t (n,) or one at time t, s; each column (n, width), (n,) or a constant.

        Columns that are not named are NaN. A row that is not after the one before it is dropped.
        """
        t = np.atleast_1d(np.asarray(t, dtype=float))
        block = blank(self.dtype, len(t))
        block["t"] = t
        for name, values in columns.items():
            block[name] = values
        before = np.append(self._rows["t"][self._end - 1] if self.count else -np.inf, t[:-1])
        after = t > np.maximum.accumulate(before)
        self._write(block if after.all() else block[after])

    def like(self) -> "Ring":
        """An empty ring of the same rows."""
        return Ring(self.dtype, self._capacity, self._may_grow)

    def merge(self, rows: np.ndarray) -> None:
        """Take in older rows of this type in any order; at an equal time what is there stays."""
        if not len(rows):
            return
        both = np.concatenate([self.rows(), rows])
        both = both[np.argsort(both["t"], kind="stable")]
        keep = np.append(True, np.diff(both["t"]) > SAME_S)
        self._end = self.count = 0
        self._write(both[keep])

    def rows(self) -> np.ndarray:
        """All rows, oldest first."""
        return self._rows[self._end - self.count : self._end]

    def window(self, t0: float, t1: float) -> np.ndarray:
        """The rows with t0 <= t <= t1, oldest first."""
        rows = self.rows()
        first, last = np.searchsorted(rows["t"], [t0, t1 + 1e-9])
        return rows[first:last]

    def _write(self, block: np.ndarray) -> None:
        block = block[-self._capacity :]
        if self._end + len(block) > len(self._rows):
            self._grow(self.count + len(block))
            block = block[-self._capacity :]
        if self._end + len(block) > len(self._rows):
            kept = self.rows()[max(0, self.count + len(block) - self._capacity) :].copy()
            self._rows[: len(kept)] = kept
            self._end = self.count = len(kept)
        self._rows[self._end : self._end + len(block)] = block
        self._end += len(block)
        self.count = min(self.count + len(block), self._capacity)

    def _grow(self, rows: int) -> None:
        """Room for so many rows, and for as many again; where there is no memory for that, what is
        there now is the capacity.
        """
        whole = _with_slack(self._capacity)
        if len(self._rows) >= min(whole, _with_slack(rows)):
            return
        wanted = min(whole, 2 * _with_slack(rows))
        if not self._may_grow((wanted - len(self._rows)) * self.dtype.itemsize):
            self._capacity = max(1, len(self._rows) * SLACK // (SLACK + 1))
            return
        kept = self.rows()
        larger = np.empty(wanted, self.dtype)
        larger[: len(kept)] = kept
        self._rows, self._end = larger, len(kept)


def _with_slack(capacity: int) -> int:
    return capacity + max(1, capacity // SLACK)


def blank(dtype: np.dtype, count: int) -> np.ndarray:
    """Rows of NaN; every field of the type is float64."""
    return np.full(count * (dtype.itemsize // 8), np.nan).view(dtype)


def gap_limit(t: np.ndarray, least: float = 0.25) -> float:
    """The pause between samples above which a series counts as interrupted: five usual periods, at
    least `least` s.
    """
    return least if len(t) < 3 else max(least, 5.0 * float(np.median(np.diff(t))))
