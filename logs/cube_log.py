"""A log of accelerometer axes in CSV as arrays: read, checked, its gaps counted. One row is one
sample.

    t_s                                a11_counts ... a43_counts, or a11_mps2 ... (also _g, _mg):
                                       triad then axis, in the layout's order
    tacho_rad_s                        optional, rate of the table about z_b
    true_wx true_wy true_wz            optional, rad/s, rate of b against inertial, in b
    true_qw true_qx true_qy true_qz    optional, q_nb

Columns may stand in any order, others are ignored. How the file is written: sheet.py. A fault is
named by its line of the file and its column.
"""

import hashlib
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from inertial.constants import from_mg
from inertial.layouts.layout import PRODUCTS, Layout
from inertial.timing import Timing
from logs.cube_tacho import beside
from logs.quantities import UNITS, column_of, in_range, timing_of, to_si
from logs.sheet import LogError, Sheet, Table, open_sheet

Array = NDArray[np.float64]

LSB_MG = 3.9  # mg per count, ADXL345 in full resolution
AXIS_UNITS = ("counts", "mps2", "g", "mg")
AXIS = re.compile(rf"a\d{{1,2}}_({'|'.join(AXIS_UNITS)})")  # a column of an accelerometer axis
TRUE_RATE = ("true_wx", "true_wy", "true_wz")
TRUE_ATTITUDE = ("true_qw", "true_qx", "true_qy", "true_qz")
TACHO = "tacho_rad_s"


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
    lsb_mps2: float  # m/s^2 per count; 0 for a log in m/s^2
    index: NDArray[np.int64]  # (n,), sample numbers with the gaps counted
    timing: Timing
    gaps: tuple[Gap, ...]
    tacho: Array | None  # (n,) rad/s
    omega_b: Array | None  # (n, 3) rad/s, truth
    q_nb: Array | None  # (n, 4), truth
    cut_off: bool = False  # the last line was half written and is left out

    @property
    def counts(self) -> NDArray[np.int64] | None:
        """(n, N) as read, where the log has counts; made when they are asked for."""
        if not self.lsb_mps2:
            return None
        return np.rint(self.f_axis / self.lsb_mps2).astype(np.int64)

    @property
    def period_s(self) -> float:
        """Between samples, s."""
        return self.timing.period_s

    @property
    def seconds(self) -> float:
        """From the first to the last sample, s."""
        return float(self.t_s[-1] - self.t_s[0])


def read_log(
    path: Path, names: Sequence[str], lsb_mg: float | None = None, tacho: Path | None = None
) -> CubeLog:
    """Read and check a log of these axes; lsb_mg scales counts, default 3.9 mg; tacho: the
    tachometer's reports, where they are in a file of their own.

    Raises LogError for what cannot be used and OSError for a file that cannot be read.
    """
    path = Path(path)
    sheet = open_sheet(path)
    unit = _unit(sheet, names)
    t_name, t_unit = column_of(sheet, "t") or ("t_s", 1.0)
    axes = [f"{name}_{unit}" for name in names]
    table = sheet.read([t_name, *axes, *_optional(sheet)])
    table.columns["t"] = to_si(table[t_name], t_unit)
    timing = timing_of(sheet, table)
    for name in (TACHO, *TRUE_RATE):
        if name in table:
            in_range(sheet, table, name, table[name], name)
    lsb = from_mg(LSB_MG if lsb_mg is None else lsb_mg) if unit == "counts" else 0.0
    if unit == "counts" and not lsb > 0.0:
        raise LogError(f"{path}: {lsb_mg} mg per count, want more than 0")
    f_axis = np.empty((len(table), len(axes)))
    for k, name in enumerate(axes):
        column = table.columns.pop(name)  # a log is long: no column is kept twice
        if lsb:
            _whole(path, table, column, name)
        f_axis[:, k] = column * (lsb or UNITS[unit])
        in_range(sheet, table, name, f_axis[:, k], "fx")
    return CubeLog(
        path=path,
        sha256=_digest(path),
        names=tuple(names),
        t_s=table["t"],
        f_axis=f_axis,
        lsb_mps2=lsb,
        index=timing.index,
        timing=timing,
        gaps=_gaps(timing, table),
        tacho=table[TACHO] if TACHO in table else beside(sheet, table["t"], tacho),
        omega_b=_columns(table, TRUE_RATE),
        q_nb=_attitude(path, table, _columns(table, TRUE_ATTITUDE)),
        cut_off=table.cut_off,
    )


def centre_force(f_axis: Array, shape: Layout) -> Array:
    """Specific force (n, 3) of the centre, m/s^2, of axes (n, m): least squares where nothing
    turns (E-5).
    """
    J = np.column_stack([np.cross(shape.r_b, shape.theta_b), shape.theta_b])
    return (f_axis * np.array(shape.gain)) @ np.linalg.pinv(J).T[:, 3:]


def squared_rate(f_axis: Array, shape: Layout) -> Array | None:
    """|omega|^2 (n,), rad^2/s^2, as axes (n, m) show it in any motion (E-4); None where a layout
    does not see all products.
    """
    if shape.rank < 12:
        return None
    squares = shape.field_inverse[6:][np.equal(*PRODUCTS)]
    return (f_axis * np.array(shape.gain)) @ squares.sum(axis=0)


def _digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _unit(sheet: Sheet, names: Sequence[str]) -> str:
    """Of AXIS_UNITS the one that the header has of all axes."""
    missing = {unit: [n for n in names if f"{n}_{unit}" not in sheet.header] for unit in AXIS_UNITS}
    unit = min(missing, key=lambda u: len(missing[u]))
    where = f"{sheet.path}:{sheet.header_line}"
    if missing[unit]:
        sheet.want(
            [f"{name}_{unit}" for name in names],
            f"t_s, {names[0]}_{unit} ... {names[-1]}_{unit} of the layout, or name another with"
            " --layout",
        )
    more = [n for n in sheet.header if AXIS.fullmatch(n) and n.rpartition("_")[0] not in names]
    if more:
        raise LogError(
            f"{where}: column {more[0]!r} belongs to no axis of the layout, which has"
            f" {len(names)} ({names[0]} ... {names[-1]}); the log has {len(names) + len(more)}:"
            " name its layout with --layout, or take the column out"
        )
    return unit


def _optional(sheet: Sheet) -> list[str]:
    found = [TACHO] if TACHO in sheet.header else []
    for group in (TRUE_RATE, TRUE_ATTITUDE):
        there = [name for name in group if name in sheet.header]
        if there and len(there) < len(group):
            lost = next(name for name in group if name not in there)
            raise LogError(
                f"{sheet.path}:{sheet.header_line}: column {lost!r} is missing beside {there[0]!r};"
                f" want {', '.join(group)}"
            )
        found += there
    return found


def _gaps(timing: Timing, table: Table) -> tuple[Gap, ...]:
    return tuple(
        Gap(int(table.lines[hole.row]), hole.t_s, hole.seconds, hole.missing)
        for hole in timing.holes
    )


def _whole(path: Path, table: Table, column: Array, name: str) -> None:
    bad = np.nonzero((column != np.rint(column)) | (np.abs(column) > 2**31))[0]
    if len(bad):
        row, axis = bad[0], name.rpartition("_")[0]
        raise LogError(
            f"{path}:{table.lines[row]}: column {name!r}: {column[row]:g} is no whole number;"
            f" counts are as read, values in m/s^2 belong in '{axis}_mps2'"
        )


def _columns(table: Table, group: tuple[str, ...]) -> Array | None:
    return np.column_stack([table[name] for name in group]) if group[0] in table else None


def _attitude(path: Path, table: Table, q: Array | None) -> Array | None:
    if q is None:
        return None
    length = np.linalg.norm(q, axis=1)
    bad = np.nonzero(np.abs(length - 1.0) > 0.01)[0]
    if len(bad):
        k = int(bad[0])
        raise LogError(
            f"{path}:{table.lines[k]}: true_qw ... true_qz have length {length[k]:.4g}, want 1:"
            " normalise them"
        )
    return q / length[:, None]
