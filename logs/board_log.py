"""A log of a whole board, as it is played, imported or run: its samples, and the fixes beside them.

Two kinds, told apart by their header:

    t_s, fx_mps2, fy_mps2, fz_mps2, wx_radps, wy_radps, wz_radps       a six-axis unit, in
                                                                       forward-right-down
    t_s, a11_counts, a12_counts ... a43_counts; optional tacho_rad_s   the cube

and for a six-axis unit the epochs of its receiver (gnss.csv in the same folder):

    t_s, lat_deg, lon_deg, height_m, quality, sd_n_m, sd_e_m, sd_u_m, vn_mps, ve_mps, vd_mps

height above the ellipsoid; quality as RTKLIB counts: 1 fixed, 2 float, 3 SBAS, 4 differential, 5
single, 0 none. Other units in the columns' names are converted.
"""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from inertial.layouts.catalogue import CUBE
from inertial.navigation.fix import Fix
from inertial.plausible import doubt_of_frozen, doubt_of_gravity, doubt_of_rate, doubt_of_sense
from inertial.timing import Timing
from logs.cube_log import LSB_MG, centre_force, read_log, squared_rate
from logs.drive_log import IMU, epoch_file, read_fixes, sample_file
from logs.quantities import read_si, refuse, said_of, timing_of
from logs.sheet import LogError, Sheet, open_sheet

Array = NDArray[np.float64]

CUBE_AXES = tuple(f"a{sensor}{axis}" for sensor in range(1, 5) for axis in range(1, 4))
COUNTS_16 = (-32768, 32767)  # what a frame of the wire carries
NEAR_S = 60.0  # before and behind the samples, in which epochs are taken
HALF_SIDE = 0.05  # m; gravity is read without it


@dataclass(frozen=True)
class BoardLog:
    """A whole log in memory, checked. Arrays over samples (n)."""

    path: Path
    kind: str  # "imu" or "cube"
    t_s: Array  # (n,)
    index: NDArray[np.int64]  # (n,) sample numbers; what is missing was lost
    f_b: Array | None  # (n, 3) m/s^2 of a six-axis unit
    omega_b: Array | None  # (n, 3) rad/s
    counts: NDArray[np.int16] | None  # (n, 12) of a cube
    tacho: Array | None  # (n,) rad/s
    fixes: tuple[Fix, ...]
    timing: Timing
    notes: tuple[str, ...]  # for people: what is doubtful, missing or was left out

    @property
    def duration_s(self) -> float:
        """From the first to the last sample, s."""
        return float(self.t_s[-1] - self.t_s[0])


def read_board_log(
    path: Path,
    gnss: Path | None = None,
    units_as_named: bool = False,
    lsb_mg: float = LSB_MG,
    tacho: Path | None = None,
) -> BoardLog:
    """Read and check a log: a CSV file or a folder with imu.csv. gnss: its epochs; default gnss.csv
    beside it, if any. tacho: a cube's tachometer in a file of its own. Raises LogError, OSError.
    """
    path = Path(path)
    if path.is_dir():
        path = path / sample_file(path)
    sheet = open_sheet(path)
    if any(f"a11_{unit}" in sheet.header for unit in ("counts", "mps2", "g", "mg")):
        return _cube(path, units_as_named, lsb_mg, tacho)
    beside = path.parent / epoch_file(path.name)
    if gnss is None and beside.is_file():
        gnss = beside
    return _imu(path, sheet, gnss, units_as_named)


def _imu(path: Path, sheet: Sheet, gnss: Path | None, as_named: bool) -> BoardLog:
    table = read_si(sheet, IMU)
    timing = timing_of(sheet, table)
    f_b, omega_b = (
        np.column_stack([table[name] for name in IMU[a:b]]) for a, b in ((1, 4), (4, 7))
    )
    doubts = [doubt_of_gravity(f_b), doubt_of_rate(table["t"], f_b, omega_b)]
    notes = refuse(path, doubts, as_named) + said_of(path, timing, table.cut_off)
    fixes, left_out = read_fixes(gnss) if gnss else ([], [])
    near = [fix for fix in fixes if _near(fix, table["t"])]
    if len(near) < len(fixes):
        left_out.append(
            f"{gnss}: {len(fixes) - len(near)} of {len(fixes)} epochs are left out: they have no"
            f" position, or are more than {NEAR_S:.0f} s away from the samples"
            f" ({table['t'][0]:.3f} to {table['t'][-1]:.3f} s)"
        )
    return BoardLog(
        path,
        "imu",
        table["t"],
        timing.index,
        f_b,
        omega_b,
        None,
        None,
        tuple(near),
        timing,
        (*notes, *left_out),
    )


def _near(fix: Fix, t: Array) -> bool:
    """Can an epoch belong to samples at times t?"""
    place = math.isfinite(fix.latitude) and math.isfinite(fix.longitude)
    return place and t[0] - NEAR_S <= fix.t <= t[-1] + NEAR_S


def _cube(path: Path, as_named: bool, lsb_mg: float, tacho: Path | None) -> BoardLog:
    log = read_log(path, CUBE_AXES, lsb_mg, tacho)
    counts = log.counts
    if counts is None:
        raise LogError(
            f"{path}: a board sends counts, and this log has m/s^2: want columns a11_counts ..."
            " (gyrofree run takes the log as it is)"
        )
    low, high = COUNTS_16
    bad = np.argwhere((counts < low) | (counts > high))
    if len(bad):
        row, column = bad[0]
        raise LogError(
            f"{path}: column '{CUBE_AXES[column]}_counts' at {log.t_s[row]:.3f} s:"
            f" {counts[row, column]}; want a whole number of 16 bits"
        )
    shape = CUBE(HALF_SIDE)
    doubts = [
        doubt_of_frozen(log.f_axis),
        doubt_of_gravity(centre_force(log.f_axis, shape), lsb_mg),
    ]
    notes = refuse(path, doubts, as_named) + said_of(path, log.timing, log.cut_off)
    square = squared_rate(log.f_axis, shape)
    if square is not None and (doubt := doubt_of_sense(square)):
        notes.append(doubt.text)
    return BoardLog(
        path,
        "cube",
        log.t_s,
        log.index,
        None,
        None,
        counts.astype(np.int16),
        log.tacho,
        (),
        log.timing,
        tuple(notes),
    )
