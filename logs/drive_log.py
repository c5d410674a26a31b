"""Read a drive from CSV: inertial samples, GNSS epochs and, where there is one, the truth. Columns
as in docs/logs.md.

The header names what a column is and its unit: fx_mps2 or fx_g, wx_radps or wx_degps, t_s or t_ms,
lat_deg, vn_mps.
"""

import csv
import math
import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv
from numpy.typing import NDArray

from inertial.constants import GRAVITY, MILLI_G
from inertial.navigation.fix import (
    AUTONOMOUS,
    DIFFERENTIAL,
    RTK_FIXED,
    RTK_FLOAT,
    Fix,
    typical_sigma,
)

Array = NDArray[np.float64]

# RTKLIB's solution quality (1 fixed, 2 float, 4 differential, 5 single) to the bus's
QUALITY = {1: RTK_FIXED, 2: RTK_FLOAT, 4: DIFFERENTIAL, 5: AUTONOMOUS}
UNITS = {
    "s": 1.0,
    "ms": 1e-3,
    "us": 1e-6,
    "ns": 1e-9,
    "mps2": 1.0,
    "g": GRAVITY,
    "mg": MILLI_G,
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
IMU = ("t", "fx", "fy", "fz", "wx", "wy", "wz")
TRUE_POSITION = ("true_lat", "true_lon", "true_height")
TRUE_VELOCITY = ("true_vn", "true_ve", "true_vd")
TRUE_ATTITUDE = ("true_qw", "true_qx", "true_qy", "true_qz")
NO_UNIT = {"quality", *TRUE_ATTITUDE}


class BadLog(ValueError):
    """A file that is not a drive; names row and column."""


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


def read_drive_log(
    folder: Path, imu: str = "imu.csv", gnss: str = "gnss.csv", truth: Path | None = None
) -> DriveLog:
    """Read the files of a folder. Raises BadLog, or OSError for a file that cannot be read.

    Truth columns may stand in the inertial file or in a file of their own. drive.toml, where there
    is one, tells the lever arm: lever_arm_b_m = [forward, right, down].
    """
    path = folder / imu
    columns = read_columns(path)
    samples = np.column_stack([_need(path, columns, name) for name in IMU])
    fallen = np.flatnonzero(np.diff(samples[:, 0]) <= 0.0)
    if len(fallen):
        row = int(fallen[0]) + 3
        raise BadLog(
            f"{path}: row {row}, column t: {samples[row - 2, 0]} s is not after the row before it"
        )
    true = _truth(read_columns(truth) if truth else columns, truth or path)
    return DriveLog(
        np.ascontiguousarray(samples),
        read_fixes(folder / gnss),
        true,
        _lever(folder / "drive.toml"),
    )


def read_fixes(path: Path) -> list[Fix]:
    """GNSS epochs; sigmas and velocity where the file has them, else what is typical of the
    quality.
    """
    c = read_columns(path)
    t, lat, lon, height = (_need(path, c, name) for name in ("t", "lat", "lon", "height"))
    quality = c["quality"] if "quality" in c else np.full(len(t), 5.0)
    arrival = c.get("arrival", t)
    v = [c.get(name) for name in ("vn", "ve", "vd")]
    sigma_p = [c.get(name) for name in ("sd_n", "sd_e", "sd_u")]
    sigma_v = [c.get(name) for name in ("sd_vn", "sd_ve", "sd_vd")]
    yaw, sigma_yaw = c.get("yaw"), c.get("sd_yaw")
    fixes = []
    for k in range(len(t)):
        kind = QUALITY.get(int(quality[k]), 0)
        position, velocity = typical_sigma(kind)
        has_v = all(column is not None for column in v)
        fixes.append(
            Fix(
                t=float(t[k]),
                arrival=float(arrival[k]),
                latitude=float(lat[k]),
                longitude=float(lon[k]),
                height=float(height[k]),
                quality=kind,
                key=k,
                sigma_p=(
                    np.array([s[k] for s in sigma_p])
                    if all(s is not None for s in sigma_p)
                    else position
                ),
                v_n=np.array([column[k] for column in v]) if has_v else None,
                sigma_v=(
                    np.array([s[k] for s in sigma_v])
                    if all(s is not None for s in sigma_v)
                    else velocity
                ),
                yaw=None if yaw is None else float(yaw[k]),
                sigma_yaw=0.01 if sigma_yaw is None else float(sigma_yaw[k]),
            )
        )
    return fixes


def read_columns(path: Path) -> dict[str, Array]:
    """Columns in SI units by their name without unit. Raises BadLog for text among the numbers,
    OSError.
    """
    options = pa.csv.ConvertOptions(null_values=["", "nan", "NaN"], strings_can_be_null=False)
    try:
        table = pa.csv.read_csv(path, convert_options=options)
        values = {name: table[name].to_numpy().astype(np.float64) for name in table.column_names}
    except (pa.ArrowInvalid, ValueError, TypeError) as error:
        raise BadLog(_where(path) or f"{path}: {error}") from None
    out = {}
    for name, column in values.items():
        stem, _, unit = name.strip().rpartition("_")
        if name.strip() in NO_UNIT:
            out[name.strip()] = column
        elif unit in UNITS and stem:
            out[stem] = column * UNITS[unit]
    if not len(table):
        raise BadLog(f"{path}: no rows below the header")
    return out


def _where(path: Path) -> str:
    """The first cell that is no number, in words; empty when none is found."""
    with open(path, newline="", encoding="utf-8", errors="replace") as file:
        reader = csv.reader(file)
        header = next(reader, [])
        if not header:
            return f"{path}: empty, want a header and rows"
        for number, row in enumerate(reader, start=2):
            if row and len(row) != len(header):
                return f"{path}: row {number}: {len(row)} values, the header names {len(header)}"
            for name, cell in zip(header, row, strict=False):
                try:
                    float(cell or "nan")
                except ValueError:
                    return f"{path}: row {number}, column {name}: {cell!r} is not a number"
    return ""


def _need(path: Path, columns: dict[str, Array], name: str) -> Array:
    if name not in columns:
        raise BadLog(
            f"{path}: no column {name!r} with a unit behind it (as t_s, fx_mps2, wx_radps, lat_deg,"
            " height_m)"
        )
    bad = np.flatnonzero(~np.isfinite(columns[name]))
    if len(bad):
        raise BadLog(f"{path}: row {bad[0] + 2}, column {name}: no number")
    return columns[name]


def _truth(columns: dict[str, Array], path: Path) -> DriveTruth | None:
    parts = [
        (
            np.column_stack([columns[name] for name in names])
            if all(name in columns for name in names)
            else None
        )
        for names in (TRUE_POSITION, TRUE_VELOCITY, TRUE_ATTITUDE)
    ]
    return (
        DriveTruth(_need(path, columns, "t"), *parts)
        if any(part is not None for part in parts)
        else None
    )


def _lever(path: Path) -> tuple[float, float, float]:
    if not path.is_file():
        return 0.0, 0.0, 0.0
    try:
        value = tomllib.loads(path.read_text(encoding="utf-8")).get(
            "lever_arm_b_m", [0.0, 0.0, 0.0]
        )
        a, b, c = (float(v) for v in value)
    except (tomllib.TOMLDecodeError, TypeError, ValueError):
        raise BadLog(f"{path}: lever_arm_b_m: want three numbers, m forward, right, down") from None
    return a, b, c
