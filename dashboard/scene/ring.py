"""A table of the newest rows over time, which the charts read."""

import numpy as np


class Ring:
    """The newest `capacity` rows of a table whose first column is the time, s. Not locked: the
    store does that.
    """

    def __init__(self, columns: int, capacity: int) -> None:
        self._rows = np.full((capacity, columns + 1), np.nan)
        self._next = 0
        self.count = 0

    def append(self, t: float, values: np.ndarray | list[float]) -> None:
        """Add a row; missing values at its end stay NaN, too many are cut. A row not after the last
        is dropped.
        """
        if self.count and t <= self._rows[self._next - 1, 0]:
            return
        row = self._rows[self._next]
        width = min(len(values), len(row) - 1)
        row[0], row[1 : width + 1], row[width + 1 :] = t, values[:width], np.nan
        self._next = (self._next + 1) % len(self._rows)
        self.count = min(self.count + 1, len(self._rows))

    def merge(self, rows: np.ndarray) -> None:
        """Take in older rows (n, columns + 1), time first, in any order; at an equal time what is
        there stays.
        """
        held = self.rows()
        both = np.concatenate([held, rows])
        order = np.argsort(both[:, 0], kind="stable")
        both = both[order]
        keep = np.append(True, np.diff(both[:, 0]) > 1e-6)
        both = both[keep][-len(self._rows) :]
        self._rows[: len(both)] = both
        self.count = len(both)
        self._next = self.count % len(self._rows)

    def rows(self) -> np.ndarray:
        """All rows, oldest first, time in the first column."""
        if self.count < len(self._rows):
            return self._rows[: self.count]
        return np.concatenate([self._rows[self._next :], self._rows[: self._next]])

    def window(self, t0: float, t1: float) -> tuple[np.ndarray, np.ndarray]:
        """Times (n,) and values (n, columns) of the rows with t0 <= t <= t1, oldest first,
        copied.
        """
        rows = self.rows()
        first, last = np.searchsorted(rows[:, 0], [t0, t1 + 1e-9])
        chosen = rows[first:last].copy()
        return chosen[:, 0], chosen[:, 1:]
