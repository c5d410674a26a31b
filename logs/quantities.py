"""Columns by what they measure: the unit stands in a column's name, the numbers come in SI.

t_s, t_ms, fx_mps2, fx_g, wx_radps, wx_degps, lat_deg, height_m, vn_mps ...
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from inertial.constants import GRAVITY
from inertial.plausible import Doubt, doubt_of_time
from inertial.timing import Timing, TimingError, sample_timing, straight
from logs.sheet import LogError, Sheet, Table

Array = NDArray[np.float64]

UNITS = {
    "s": 1.0,
    "ms": 1e-3,
    "us": 1e-6,
    "ns": 1e-9,
    "mps2": 1.0,
    "g": GRAVITY,
    "mg": GRAVITY * 1e-3,
    "radps": 1.0,
    "degps": math.pi / 180.0,
    "dps": math.pi / 180.0,
    "rad": 1.0,
    "deg": math.pi / 180.0,
    "m": 1.0,
    "cm": 0.01,
    "mps": 1.0,
    "kmph": 1.0 / 3.6,
}
LIMITS = {  # of quantities in SI, by the beginning of their names: what a log can mean
    "fx fy fz": (-2e4, 2e4),
    "wx wy wz": (-2e3, 2e3),
    "lat true_lat": (-math.pi / 2.0, math.pi / 2.0),
    "lon true_lon": (-2.0 * math.pi, 2.0 * math.pi),
    "height true_height": (-1e6, 1e6),
    "vn ve vd true_vn true_ve true_vd": (-1e5, 1e5),
    "sd_n sd_e sd_u sd_vn sd_ve sd_vd": (0.0, 1e6),
    "tacho_rad_s true_wx true_wy true_wz": (-1e4, 1e4),
}
RANGES = {name: limits for names, limits in LIMITS.items() for name in names.split()}
LATEST_S = 4.1e9  # of a log's time: year 2099, if it is Unix time
LONGEST_S = 1e8  # of a log, three years
USUAL = {"t": "s", "f": "mps2", "w": "radps", "lat": "deg", "lon": "deg", "height": "m", "v": "mps"}


def column_of(sheet: Sheet, quantity: str) -> tuple[str, float] | None:
    """Name of the column of a quantity ("t", "fx", "lat") and its unit in SI; None without one."""
    for name in sheet.header:
        stem, _, unit = name.rpartition("_")
        if stem == quantity and unit in UNITS:
            return name, UNITS[unit]
    return (quantity, 1.0) if quantity in sheet.header else None


def to_si(numbers: Array, unit: float) -> Array:
    """Numbers of this unit in SI. 1247 ms have the same bits as 1.247 s: a division by 1000 is
    rounded once, a product with 0.001, which is no number of the machine, twice.
    """
    parts = round(1.0 / unit)
    return numbers / parts if parts * unit == 1.0 else numbers * unit


def read_si(
    sheet: Sheet,
    wanted: Sequence[str],
    optional: Sequence[str] = (),
    may_miss: Sequence[str] = (),
) -> Table:
    """Quantities in SI, by their names without unit; of the optional ones those that are there.

    Cells of `may_miss` may be empty and become NaN. Raises LogError as Sheet.read does.
    """
    found = {q: column_of(sheet, q) for q in (*wanted, *optional)}
    missing = [q for q in wanted if found[q] is None]
    if missing:
        as_written = [_usual(q) for q in wanted]
        sheet.want([_usual(q) for q in missing], f"{', '.join(as_written)} (or in other units)")
    there = {q: pair for q, pair in found.items() if pair is not None}
    names = [name for name, _ in there.values()]
    free = [there[q][0] for q in may_miss if q in there]
    table = sheet.read(names, free)
    columns = {q: to_si(table[name], unit) for q, (name, unit) in there.items()}
    for q, (name, _) in there.items():
        in_range(sheet, table, name, columns[q], q)
    return Table(columns, table.lines, table.cut_off)


def in_range(sheet: Sheet, table: Table, name: str, values: Array, quantity: str) -> None:
    """Raises LogError for a value (SI) that no such quantity has; NaN is none."""
    if quantity not in RANGES:
        return
    low, high = RANGES[quantity]
    bad = np.nonzero((values < low) | (values > high))[0]
    if len(bad):
        row = int(bad[0])
        raise LogError(
            f"{sheet.path}:{table.lines[row]}: column {name!r}: {values[row]:.6g} in SI units; want"
            f" {low:.6g} to {high:.6g}: check the column's unit"
        )


def timing_of(sheet: Sheet, table: Table) -> Timing:
    """Timing of a table's column "t" (s), which is mended where its counter began anew or samples
    came in bursts. Raises LogError for times that do not rise or are no seconds.
    """
    if len(table) < 2:
        raise LogError(f"{sheet.path}: {len(table)} samples; want at least two below the header")
    name = (column_of(sheet, "t") or ("t_s", 1.0))[0]
    try:
        table.columns["t"], mended = straight(table["t"], _same(table))
        timing = replace(sample_timing(table["t"]), mended=mended)
    except TimingError as error:
        line = table.lines[error.row]
        raise LogError(f"{sheet.path}:{line}: column {name!r}: {error}") from None
    if doubt := doubt_of_time(timing.period_s, name):
        raise LogError(f"{sheet.path}: {doubt.text}")
    rising(sheet, table)
    return timing


def _same(table: Table) -> NDArray[np.bool_]:
    """Rows (n,) that repeat the one before in every column."""
    same = np.ones(len(table), dtype=bool)
    same[0] = False
    for column in table.columns.values():
        same[1:] &= (np.diff(column) == 0.0) | (np.isnan(column[1:]) & np.isnan(column[:-1]))
    return same


def rising(sheet: Sheet, table: Table) -> None:
    """Raises LogError where times of column "t" (s) fall, or are no times of a log; equal ones may
    follow one another.
    """
    t = table["t"]
    name = (column_of(sheet, "t") or ("t_s", 1.0))[0]
    wrong = np.concatenate([[False], np.diff(t) < 0.0]) | (np.abs(t) > LATEST_S)
    if len(t):
        wrong |= t - t[0] > LONGEST_S
    if wrong.any():
        row = int(np.argmax(wrong))
        raise LogError(
            f"{sheet.path}:{table.lines[row]}: column {name!r}: time {t[row]:.6f} s after"
            f" {t[max(0, row - 1)]:.6f} s; want seconds that rise, from the log's start or of Unix"
            " time"
        )


def refuse(path: Path, doubts: Sequence[Doubt | None], as_named: bool) -> list[str]:
    """What is doubtful in a log, in words. Raises LogError unless the units are meant as named."""
    said = [doubt.text for doubt in doubts if doubt is not None]
    if said and not as_named:
        raise LogError(
            f"{path}: {'; '.join(said)}. If the numbers are right all the same (a body that never"
            " rests, say), give --units-as-named"
        )
    return said


def said_of(path: Path, timing: Timing, cut_off: bool) -> list[str]:
    """What of a log's times a person should know."""
    said = [f"{path}: {text}" for text in timing.mended]
    if timing.missing:
        longest = max(timing.holes, key=lambda hole: hole.missing)
        said.append(
            f"{path}: {timing.missing} samples are missing in {len(timing.holes)} holes, the"
            f" longest {longest.seconds:.3f} s after {longest.t_s:.3f} s"
        )
    if timing.jitter_s > 0.05 * timing.period_s and timing.jitter_s > timing.resolution_s:
        said.append(
            f"{path}: times jitter by {timing.jitter_s * 1e3:.2f} ms about a period of"
            f" {timing.period_s * 1e3:.3f} ms: samples are taken as even"
        )
    if cut_off:
        said.append(f"{path}: the last line was cut off; the rows before it are used")
    return said


def _usual(quantity: str) -> str:
    stem = quantity.rstrip("xyzned") if quantity[:1] in "fwv" and len(quantity) == 2 else quantity
    unit = USUAL.get(stem) or USUAL.get(quantity[:1] if len(quantity) == 2 else quantity)
    return f"{quantity}_{unit}" if unit else quantity
