"""When the samples of a run were taken: by the clock of the board, which is the one that measured.

The time that a sample has in UTC goes by the gateway's mapping of the board's clock, which follows
a board that is slow or whose clock jumps: right for people, and no measure of a rate. So a report
counts the board's seconds since its boot wherever all estimates and samples have them.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sessions.export.table import Table

Array = NDArray[np.float64]


class Times:
    """Seconds of the tables of one boot."""

    def __init__(self, timed: Sequence[Table]) -> None:
        """timed: samples and estimates, at least one."""
        self.by_board = all(_has_board_time(table) for table in timed)
        self._timed = timed
        own = [self._own(table) for table in timed]
        self.first = float(min(t.min() for t in own))
        self.seconds = float(max(t.max() for t in own)) - self.first
        self.first_utc_s = float(min(t.data["utc_s"].min() for t in timed))

    def of(self, table: Table) -> Array:
        """Seconds (n,) of a table's rows since the first sample of the boot."""
        if self.by_board and not _has_board_time(table):  # a receiver on a port of its own
            utc_s = np.concatenate([t.data["utc_s"] for t in self._timed])
            board_s = np.concatenate([_board_s(t) for t in self._timed])
            order = np.argsort(utc_s, kind="stable")
            return np.interp(table.data["utc_s"], utc_s[order], board_s[order]) - self.first
        return self._own(table) - self.first

    def _own(self, table: Table) -> Array:
        return _board_s(table) if self.by_board else table.data["utc_s"]


def _has_board_time(table: Table) -> bool:
    return "device_us" in table.data and bool(np.any(table.data["device_us"] > 0))


def _board_s(table: Table) -> Array:
    """A batch has the time of its first sample; the others follow by the period."""
    if "device_us" not in table.data:
        return np.zeros(len(table))
    us = np.asarray(table.data["device_us"], dtype=np.float64)
    if "period_s" not in table.data:
        return us * 1e-6
    rows = np.arange(len(us))
    begins = np.r_[True, np.diff(us) != 0.0] if len(us) else np.zeros(0, dtype=bool)
    first = np.maximum.accumulate(np.where(begins, rows, 0))
    return us * 1e-6 + (rows - first) * table.data["period_s"]
