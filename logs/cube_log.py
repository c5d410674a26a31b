"""A log of accelerometer axes in CSV as arrays: read, checked, its gaps counted. One row is one
sample.

    t_s, a11_counts ... a43_counts      or  a11_mps2 ... a43_mps2       triad then axis, in the
    layout's order tacho_rad_s                         optional, rate of the table about z_b true_wx
    true_wy true_wz             optional, rad/s, rate of b against inertial, in b true_qw true_qx
    true_qy true_qz     optional, q_nb

Columns may stand in any order, others are ignored, lines that begin with # are comments. A fault is
named by its line of the file and its column.
"""

import csv
import hashlib
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from inertial.constants import GRAVITY

Array = NDArray[np.float64]

LSB_MG = 3.9  # mg per count, ADXL345 in full resolution
AXIS = re.compile(r"a\d{1,2}_(counts|mps2)")  # a column of an accelerometer axis
TRUE_RATE = ("true_wx", "true_wy", "true_wz")
TRUE_ATTITUDE = ("true_qw", "true_qx", "true_qy", "true_qz")
TACHO = "tacho_rad_s"
GAP = 1.5  # periods between two samples; more is a gap


class LogError(ValueError):
    """A log that cannot be used; names file, line and column, and says what was wanted."""


@dataclass(frozen=True)
class Gap:
    """Missing samples."""

    line: int  # of the file, of the first sample after it
    t_s: float  # s, of the last sample before it
    seconds: float
    missing: int  # samples, by the log's period


@dataclass(frozen=True)
class CubeLog:
    """A whole log in memory. Arrays over samples (n)."""

    path: Path
    sha256: str
    names: tuple[str, ...]  # of the axes, "a11" ...
    t_s: Array  # (n,)
    f_axis: Array  # (n, N) m/s^2, nominal scale
    counts: NDArray[np.int64] | None  # (n, N), where the log has counts
    lsb_mps2: float  # m/s^2 per count; 0 for a log in m/s^2
    index: NDArray[np.int64]  # (n,), sample numbers with the gaps counted
    period_s: float
    gaps: tuple[Gap, ...]
    tacho: Array | None  # (n,) rad/s
    omega_b: Array | None  # (n, 3) rad/s, truth
    q_nb: Array | None  # (n, 4), truth

    @property
    def seconds(self) -> float:
        """From the first to the last sample, s."""
        return float(self.t_s[-1] - self.t_s[0])


def read_log(path: Path, names: Sequence[str], lsb_mg: float | None = None) -> CubeLog:
    """Read and check a log of these axes; lsb_mg scales counts, default 3.9 mg.

    Raises LogError for what cannot be used and OSError for a file that cannot be read.
    """
    path = Path(path)
    data = path.read_bytes()
    lines = data.decode("utf-8", errors="replace").splitlines()
    header_line, header = _header(path, lines)
    unit = _unit(path, header_line, header, names)
    wanted = ["t_s", *(f"{name}_{unit}" for name in names), *_optional(path, header_line, header)]
    numbers, cells = _rows(path, lines, header_line, header, wanted)
    table = _numbers(path, numbers, cells, wanted)
    period, index, gaps = _time(path, numbers, table[:, 0])
    values = table[:, 1 : 1 + len(names)]
    lsb = (LSB_MG if lsb_mg is None else lsb_mg) * 1e-3 * GRAVITY if unit == "counts" else 0.0
    if unit == "counts" and not lsb > 0.0:
        raise LogError(f"{path}: {lsb_mg} mg per count, want more than 0")
    return CubeLog(
        path=path,
        sha256=hashlib.sha256(data).hexdigest(),
        names=tuple(names),
        t_s=table[:, 0],
        f_axis=np.ascontiguousarray(values * lsb if lsb else values),
        counts=_whole(path, numbers, values, names) if lsb else None,
        lsb_mps2=lsb,
        index=index,
        period_s=period,
        gaps=gaps,
        tacho=table[:, wanted.index(TACHO)] if TACHO in wanted else None,
        omega_b=_columns(table, wanted, TRUE_RATE),
        q_nb=_attitude(path, numbers, _columns(table, wanted, TRUE_ATTITUDE)),
    )


def _header(path: Path, lines: list[str]) -> tuple[int, list[str]]:
    for number, line in enumerate(lines, 1):
        if line.strip() and not line.startswith("#"):
            return number, [name.strip().lstrip("\ufeff") for name in line.split(",")]
    raise LogError(f"{path}: empty; want a header line t_s, a11_counts ... and samples")


def _unit(path: Path, line: int, header: list[str], names: Sequence[str]) -> str:
    """ "counts" or "mps2", whichever the header has of all axes."""
    twice = [name for name in header if name and header.count(name) > 1]
    if twice:
        raise LogError(
            f"{path}:{line}: column {twice[0]!r} stands there twice; rename or remove one"
        )
    missing = {
        unit: [n for n in names if f"{n}_{unit}" not in header] for unit in ("counts", "mps2")
    }
    unit = min(missing, key=lambda u: len(missing[u]))
    if missing[unit]:
        first = f"{missing[unit][0]}_{unit}"
        raise LogError(
            f"{path}:{line}: column {first!r} is missing ({len(missing[unit])} of {len(names)} axes"
            f" are); found {', '.join(header)}; want t_s, {names[0]}_{unit} ... {names[-1]}_{unit}"
            " of the layout, or name another with --layout"
        )
    more = [
        name for name in header if AXIS.fullmatch(name) and name.rpartition("_")[0] not in names
    ]
    if more:
        raise LogError(
            f"{path}:{line}: column {more[0]!r} belongs to no axis of the layout, which has"
            f" {len(names)} ({names[0]} ... {names[-1]}); the log has {len(names) + len(more)}:"
            " name its layout with --layout, or take the column out"
        )
    if "t_s" not in header:
        raise LogError(
            f"{path}:{line}: column 't_s' is missing, found {', '.join(header)}; want the time in"
            " seconds"
        )
    return unit


def _optional(path: Path, line: int, header: list[str]) -> list[str]:
    found = [TACHO] if TACHO in header else []
    for group in (TRUE_RATE, TRUE_ATTITUDE):
        there = [name for name in group if name in header]
        if there and len(there) < len(group):
            lost = next(name for name in group if name not in header)
            raise LogError(
                f"{path}:{line}: column {lost!r} is missing beside {there[0]!r}; want"
                f" {', '.join(group)}"
            )
        found += there
    return found


def _rows(
    path: Path, lines: list[str], header_line: int, header: list[str], wanted: list[str]
) -> tuple[list[int], list[list[str]]]:
    """Line numbers and the wanted cells of every sample."""
    places = [header.index(name) for name in wanted]
    numbers, cells = [], []
    for number, line in enumerate(lines[header_line:], header_line + 1):
        if not line.strip() or line.startswith("#"):
            continue
        row = next(csv.reader([line])) if '"' in line else line.split(",")
        if len(row) <= max(places):
            short = wanted[places.index(max(places))]
            raise LogError(
                f"{path}:{number}: {len(row)} cells, column {short!r} is missing; complete the row"
                " or leave it out"
            )
        numbers.append(number)
        cells.append([row[place] for place in places])
    if len(numbers) < 2:
        raise LogError(f"{path}: {len(numbers)} samples; want at least two below the header")
    return numbers, cells


def _numbers(path: Path, numbers: list[int], cells: list[list[str]], wanted: list[str]) -> Array:
    try:
        table = np.array(cells, dtype=np.float64)
    except ValueError:
        table = np.array([[_float(cell) for cell in row] for row in cells])
    bad = np.argwhere(~np.isfinite(table))
    if len(bad):
        row, column = bad[0]
        rows = len(np.unique(bad[:, 0]))
        raise LogError(
            f"{path}:{numbers[row]}: column {wanted[column]!r}: {cells[row][column].strip()!r} is"
            f" no finite number ({rows} such row{'s' if rows > 1 else ''}); correct it, or leave"
            " the row out: it then counts as a gap"
        )
    return table


def _float(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return math.nan


def _time(
    path: Path, numbers: list[int], t: Array
) -> tuple[float, NDArray[np.int64], tuple[Gap, ...]]:
    step = np.diff(t)
    back = np.nonzero(step <= 0.0)[0]
    if len(back):
        k = int(back[0])
        raise LogError(
            f"{path}:{numbers[k + 1]}: t_s {t[k + 1]:.6f} after {t[k]:.6f} does not rise"
            f" ({len(back)} such row{'s' if len(back) > 1 else ''}); sort the log by t_s and remove"
            " repeated samples"
        )
    period = float(np.median(step))
    late = step > GAP * period
    jumps = np.where(late, np.maximum(2, np.rint(step / period)), 1).astype(np.int64)
    index = np.concatenate([[0], np.cumsum(jumps)])
    gaps = tuple(
        Gap(numbers[k + 1], float(t[k]), float(step[k]), int(jumps[k] - 1))
        for k in np.nonzero(late)[0].tolist()
    )
    return period, index, gaps


def _whole(
    path: Path, numbers: list[int], values: Array, names: Sequence[str]
) -> NDArray[np.int64]:
    bad = np.argwhere((values != np.rint(values)) | (np.abs(values) > 2**31))
    if len(bad):
        row, column = bad[0]
        raise LogError(
            f"{path}:{numbers[row]}: column '{names[column]}_counts': {values[row, column]:g} is no"
            f" whole number; counts are as read, values in m/s^2 belong in '{names[column]}_mps2'"
        )
    return values.astype(np.int64)


def _columns(table: Array, wanted: list[str], group: tuple[str, ...]) -> Array | None:
    return (
        np.ascontiguousarray(table[:, [wanted.index(n) for n in group]])
        if group[0] in wanted
        else None
    )


def _attitude(path: Path, numbers: list[int], q: Array | None) -> Array | None:
    if q is None:
        return None
    length = np.linalg.norm(q, axis=1)
    bad = np.nonzero(np.abs(length - 1.0) > 0.01)[0]
    if len(bad):
        k = int(bad[0])
        raise LogError(
            f"{path}:{numbers[k]}: true_qw ... true_qz have length {length[k]:.4g}, want 1:"
            " normalise them"
        )
    return q / length[:, None]
