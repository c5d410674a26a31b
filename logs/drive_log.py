"""Read a drive from CSV: inertial samples, GNSS epochs and, where there is one, the truth. Columns
as in docs/logs.md.

The header names what a column is and its unit: fx_mps2 or fx_g, wx_radps or wx_degps, t_s or t_ms,
lat_deg, vn_mps.
"""

import math
import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from inertial.navigation.fix import (
    AUTONOMOUS,
    DIFFERENTIAL,
    RTK_FIXED,
    RTK_FLOAT,
    Fix,
    typical_sigma,
)
from inertial.plausible import doubt_of_gravity, doubt_of_rate
from inertial.timing import Timing
from inertial.toml_file import parsed, text_of
from logs.quantities import read_si, refuse, rising, timing_of
from logs.sheet import LogError, Table, open_sheet

Array = NDArray[np.float64]

# RTKLIB's solution quality (1 fixed, 2 float, 3 SBAS, 4 differential, 5 single) to the bus's
QUALITY = {1: RTK_FIXED, 2: RTK_FLOAT, 3: DIFFERENTIAL, 4: DIFFERENTIAL, 5: AUTONOMOUS}
OWN_QUALITY = {
    4: RTK_FIXED,
    3: RTK_FLOAT,
    2: DIFFERENTIAL,
    1: AUTONOMOUS,
}  # of GnssFix, as exported
UNKNOWN_QUALITY = 0  # no solution, or none that is known here: not used
IMU = ("t", "fx", "fy", "fz", "wx", "wy", "wz")
TRUE_POSITION = ("true_lat", "true_lon", "true_height")
TRUE_VELOCITY = ("true_vn", "true_ve", "true_vd")
TRUE_ATTITUDE = ("true_qw", "true_qx", "true_qy", "true_qz")
SIGMA_P, SIGMA_V = ("sd_n", "sd_e", "sd_u"), ("sd_vn", "sd_ve", "sd_vd")
VELOCITY = ("vn", "ve", "vd")
PLACE = ("lat", "lon")
EPOCH = ("height", "arrival", "quality", *VELOCITY, *SIGMA_P, *SIGMA_V, "yaw", "sd_yaw")


@dataclass(frozen=True)
class DriveTruth:
    """What was really the case, at times t (n,) s; parts that the log does not have are None."""

    t: Array
    position: Array | None  # (n, 3) latitude, longitude rad, height m
    v_n: Array | None  # (n, 3) m/s
    q_nb: Array | None  # (n, 4) w x y z


@dataclass(frozen=True)
class DriveLog:
    """A drive as the filters take it."""

    imu: Array  # (n, 7): t s, f_b m/s^2, omega_ib_b rad/s
    fixes: list[Fix]
    truth: DriveTruth | None
    lever_arm_b: tuple[float, float, float]
    timing: Timing  # of the samples
    notes: tuple[str, ...] = ()  # for people: what is doubtful or was left out


def read_drive_log(
    folder: Path,
    imu: str = "imu.csv",
    gnss: str = "gnss.csv",
    truth: Path | None = None,
    units_as_named: bool = False,
) -> DriveLog:
    """Read the files of a folder. Raises LogError, or OSError for a file that cannot be read.

    Truth columns may stand in the inertial file or in a file of their own. drive.toml, where there
    is one, tells the lever arm: lever_arm_b_m = [forward, right, down]. Numbers that look like
    another unit are refused unless they are meant as they are named.
    """
    imu = sample_file(folder, imu)
    gnss = epoch_file(imu, gnss)
    path = folder / imu
    sheet = open_sheet(path)
    optional = (*TRUE_POSITION, *TRUE_VELOCITY, *TRUE_ATTITUDE)
    table = read_si(sheet, IMU, () if truth else optional, optional)
    timing = timing_of(sheet, table)
    samples = np.column_stack([table[name] for name in IMU])
    t, f_b, omega_b = samples[:, 0], samples[:, 1:4], samples[:, 4:7]
    notes = refuse(path, [doubt_of_gravity(f_b), doubt_of_rate(t, f_b, omega_b)], units_as_named)
    if truth:
        table = read_si(open_sheet(truth), ("t",), optional, optional)
    fixes, left_out = read_fixes(folder / gnss)
    return DriveLog(
        np.ascontiguousarray(samples),
        fixes,
        _truth(table),
        _lever(folder / "drive.toml"),
        timing,
        (*notes, *left_out),
    )


def sample_file(folder: Path, usual: str = "imu.csv") -> str:
    """Name of the file of inertial samples in a folder: the usual one, or an export's."""
    exported = sorted(folder.glob("*.imu.csv"))
    alone = len(exported) == 1 and not (folder / usual).is_file()
    return exported[0].name if alone else usual


def epoch_file(samples: str, usual: str = "gnss.csv") -> str:
    """Name of the file of epochs that belongs to one of samples."""
    stem = samples.removesuffix(".imu.csv")
    return f"{stem}.gnss.csv" if stem != samples else usual


def read_fixes(path: Path) -> tuple[list[Fix], list[str]]:
    """GNSS epochs, and in words what is missing of them; sigmas where the file has them, else what
    is typical of the quality. A height or velocity that the file does not have is unknown. Raises
    LogError, OSError.
    """
    sheet = open_sheet(path)
    c = read_si(sheet, ("t", *PLACE), EPOCH, (*PLACE, *EPOCH))
    if sheet.head.own:  # an export of ours has when a fix came, and when it was of
        of_s = sheet.read(["fix_utc_ns"])["fix_utc_ns"] * 1e-9
        c.columns["arrival"] = c["t"]
        c.columns["t"] = np.where(of_s > 0.0, of_s, c["t"])
    rising(sheet, c)
    quality = c["quality"] if "quality" in c else np.full(len(c), 5.0)
    numbered = OWN_QUALITY if sheet.head.own else QUALITY
    kinds = [
        numbered.get(int(q), UNKNOWN_QUALITY) if math.isfinite(q) else UNKNOWN_QUALITY
        for q in quality.tolist()
    ]
    placed = np.isfinite(c["lat"]) & np.isfinite(c["lon"]) & ((c["lat"] != 0) | (c["lon"] != 0))
    fixes = [_fix(c, k, kind if placed[k] else UNKNOWN_QUALITY) for k, kind in enumerate(kinds)]
    notes = _missing(path, c, fixes, placed)
    if unused := [k for k, kind in enumerate(kinds) if kind == UNKNOWN_QUALITY]:
        first = quality[unused[0]]
        value = f"{first:g}" if math.isfinite(first) else "empty"
        notes.append(
            f"{path}:{c.lines[unused[0]]}: {len(unused)} of {len(kinds)} epochs are not used: their"
            f" quality is {value}; want 1 fixed, 2 float, 3 SBAS, 4 differential or 5 single"
        )
    return fixes, notes


def _missing(path: Path, c: Table, fixes: list[Fix], placed: Array) -> list[str]:
    """In words, what epochs do not have."""
    notes, n = [], len(fixes)
    if not placed.all():
        line = c.lines[int(np.flatnonzero(~placed)[0])]
        empty = int((~placed).sum())
        notes.append(f"{path}:{line}: {empty} of {n} epochs have no position and are not used")
    flat = sum(not fix.has_height for fix in fixes)
    if flat:
        why = "their cells are empty" if "height" in c else "there is no column height_m"
        notes.append(f"{path}: {flat} of {n} epochs have no height ({why}): it stays unknown")
    slow = sum(fix.v_n is None for fix in fixes)
    if slow:
        why = "their cells are empty" if "vn" in c else "there are no columns vn_mps, ve_mps"
        notes.append(f"{path}: {slow} of {n} epochs have no velocity ({why})")
    return notes


def _fix(c: Table, k: int, kind: int) -> Fix:
    position, velocity = typical_sigma(kind)
    return Fix(
        t=float(c["t"][k]),
        arrival=_known(c, "arrival", k, float(c["t"][k])),
        latitude=float(c["lat"][k]),
        longitude=float(c["lon"][k]),
        height=_known(c, "height", k, math.nan),
        quality=kind,
        key=k,
        sigma_p=_three(c, SIGMA_P, k, position, float(position[2])),
        v_n=_three(c, VELOCITY, k, None, math.nan),
        sigma_v=_three(c, SIGMA_V, k, velocity, float(velocity[2])),
        yaw=_known(c, "yaw", k, None),
        sigma_yaw=_known(c, "sd_yaw", k, 0.01),
    )


def _known(c: Table, name: str, k: int, otherwise):
    """A number of row k; `otherwise` where the file does not have it."""
    value = float(c[name][k]) if name in c else math.nan
    return value if math.isfinite(value) else otherwise


def _three(
    c: Table, names: tuple[str, ...], k: int, otherwise: Array | None, third: float
) -> Array | None:
    """Three numbers of row k; `otherwise` where one of the first two is missing, `third` for the
    last alone.
    """
    north, east, last = (_known(c, name, k, math.nan) for name in names)
    if not (math.isfinite(north) and math.isfinite(east)):
        return otherwise
    return np.array([north, east, last if math.isfinite(last) else third])


def _truth(table: Table) -> DriveTruth | None:
    parts = [
        np.column_stack([table[name] for name in names]) if all(n in table for n in names) else None
        for names in (TRUE_POSITION, TRUE_VELOCITY, TRUE_ATTITUDE)
    ]
    return DriveTruth(table["t"], *parts) if any(part is not None for part in parts) else None


def _lever(path: Path) -> tuple[float, float, float]:
    if not path.is_file():
        return 0.0, 0.0, 0.0
    try:
        value = parsed(text_of(path)).get("lever_arm_b_m", [0.0, 0.0, 0.0])
        a, b, c = (float(v) for v in value)
    except (tomllib.TOMLDecodeError, TypeError, ValueError):
        raise LogError(
            f"{path}: lever_arm_b_m: want three numbers, m forward, right, down"
        ) from None
    return a, b, c
