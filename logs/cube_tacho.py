"""The tachometer in a file of its own: beside an export of ours, or one that a person names."""

import csv
import logging
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from logs.sheet import Sheet, open_sheet

Array = NDArray[np.float64]

log = logging.getLogger(__name__)

SAMPLES, REPORTS = ".accel.csv", ".tacho.csv"
TOGETHER = 2e-6  # s; clocks of both files are written alike
STANDS_S = 0.5  # s without a report: no pulse came


def beside(sheet: Sheet, t_s: Array, named: Path | None = None) -> Array | None:
    """Rate (n,) rad/s at samples t_s (n,) by the reports of a file that is named, else of an export
    NAME.accel.csv by those of NAME.tacho.csv; None where there are none.

    Each report holds until the next; where none follows, as long as the one before did, and then
    the table stands, as it does before the first. Raises LogError for reports that cannot be read.
    """
    path = named or sheet.path.with_name(sheet.path.name.removesuffix(SAMPLES) + REPORTS)
    exported = sheet.head.own and sheet.path.name.endswith(SAMPLES) and path.is_file()
    if not (named or exported):
        return None
    reports = open_sheet(path).read(["t_s", "tacho_rad_s"])
    if not len(reports):
        return None
    if not _signed(path):
        log.warning("%s: its direction is not known, so it is left out", path)
        return None
    t, first = np.unique(reports["t_s"], return_index=True)
    return _held(t, reports["tacho_rad_s"][first], t_s)


def _signed(path: Path) -> bool:
    """Whether every report knows its direction."""
    sheet = open_sheet(path)
    if "direction_known" not in sheet.header:
        return True
    place = sheet.header.index("direction_known")
    with path.open(encoding=sheet.encoding, newline="") as lines:
        rows = csv.reader(lines, delimiter=sheet.separator)
        return not any(cell.lower() in ("false", "0") for row in rows for cell in row[place:][:1])


def _held(t: Array, rate: Array, at: Array) -> Array:
    """The newest report (t, rate), both (k,), at moments (n,); zero where it is too old."""
    newest = np.searchsorted(t, at + TOGETHER, side="right") - 1
    apart = np.diff(t, append=np.inf)
    before = np.r_[np.inf, np.diff(t)]
    holds = np.where(apart <= STANDS_S, apart, np.minimum(before, STANDS_S))
    there = np.clip(newest, 0, None)
    fresh = (newest >= 0) & (at - t[there] < holds[there] - TOGETHER)
    return np.where(fresh, rate[there], 0.0)
