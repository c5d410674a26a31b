"""What estimators said along a log, as a table for other programs: `gyrofree run --out FILE`.

One row per estimator and sample (per epoch of the receiver, for a drive), the estimators one below
the other, in CSV or Parquet by the file's ending. Units stand in the columns' names; a cell is
empty where a value is not known. docs/logs.md describes every column.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq
from numpy.typing import NDArray

from inertial.navigation.results import place_of
from inertial.rotation import euler_angles
from inertial.whole_file import whole
from logs.cube_log import CubeLog
from logs.cube_run import EstimatorRun, Reference
from logs.drive_result import Result
from logs.sheet import LogError

Array = NDArray[Any]
Columns = dict[str, Array]

FORMS = (".csv", ".parquet")
SIGHT = np.array(["valid", "ambiguous", "blind"])
XYZ, NED, WXYZ = "xyz", "ned", "wxyz"


def check_form(out: Path | None) -> None:
    """Raises LogError for a file that would be neither CSV nor Parquet, or whose folder is not
    there: before the work, not after it.
    """
    if out is None:
        return
    if out.suffix.lower() not in FORMS:
        raise LogError(f"--out {out}: want a file that ends in {' or '.join(FORMS)}")
    if not out.parent.is_dir():
        raise LogError(f"--out {out}: there is no folder {out.parent}: make it")


def write(out: Path, parts: Mapping[str, Columns | list[Columns]], kind: str) -> dict[str, Any]:
    """Write the columns of each estimator (of each of its logs); `kind` is the name of the column
    that tells them apart. Gives {"file", "rows", "columns"}. Raises OSError.
    """
    tables = []
    for name, found in parts.items():
        for columns in found if isinstance(found, list) else [found]:
            n = len(columns["t_s"])
            named = {"t_s": columns["t_s"], kind: np.full(n, name)} | columns
            tables.append(pa.table({key: _cells(values) for key, values in named.items()}))
    table = pa.concat_tables(tables, promote_options="default") if tables else pa.table({})
    with whole(out) as draft:
        if out.suffix.lower() == ".parquet":
            pq.write_table(table, draft, compression="zstd")
        else:
            pa.csv.write_csv(table, draft, pa.csv.WriteOptions(quoting_style="needed"))
    return {"file": str(out), "rows": len(table), "columns": table.column_names}


def _cells(values: Array) -> pa.Array:
    """Empty where a number is not known."""
    if values.dtype.kind == "b":
        return pa.array(values.astype(np.uint8))
    return pa.array(values, from_pandas=True)


def _parts(
    stem: str, letters: str, unit: str, values: Array, known: Array | None = None
) -> Columns:
    """Columns of a vector's parts; NaN where it is not known (n,)."""
    if known is not None:
        values = np.where(known[:, None], values, np.nan)
    end = f"_{unit}" if unit else ""
    return {f"{stem}{letter}{end}": values[:, k] for k, letter in enumerate(letters)}


def of_cube(data: CubeLog, track: EstimatorRun, truth: Reference) -> Columns:
    """What one estimator said of a cube's log."""
    known, sigma = track.started, np.sqrt(np.einsum("nii->ni", track.P).clip(0.0))
    sight = np.where(known[:, None], SIGHT[track.sight], "blind")
    return {
        "t_s": data.t_s,
        **_parts("w", XYZ, "radps", track.omega_b, known),
        **_parts("sigma_w", XYZ, "radps", sigma, known),
        **_parts("valid_", XYZ, "", track.valid),
        **_parts("sight_", XYZ, "", sight),
        "angle_z_rad": np.where(known, track.angle_z, np.nan),
        **_parts("q", WXYZ, "", track.q_nb, known),
        **_parts("f", XYZ, "mps2", track.f_b, known),
        **_parts("alpha_", XYZ, "radps2", track.alpha_b, known),
        "still": track.still,
        **_parts("reference_w", XYZ, "radps", truth.omega_b),
        "reference_angle_z_rad": truth.angle_z,
    }


def of_attitude(t_s: Array, q_nb: Array, error: Array, scored: Array, log: str) -> Columns:
    """What one attitude filter said of a log; error (n,) rad, NaN without a reference."""
    return {
        "t_s": t_s,
        "log": np.full(len(t_s), log),
        **_parts("q", WXYZ, "", q_nb),
        "inclination_error_rad": error,
        "scored": scored,
    }


def of_drive(result: Result) -> Columns:
    """What one navigation filter said at every epoch, after its correction; `scored` tells those
    that it did not see and that are compared.
    """
    x, P = result.x, result.P
    sigma = np.sqrt(np.einsum("nii->ni", P).clip(0.0))  # of attitude, velocity, position
    known = result.t >= result.began
    latitude, longitude, height = (np.asarray(part, dtype=float) for part in place_of(x))
    by_element = np.ascontiguousarray(np.moveaxis(x["C_nb"], 0, -1))
    roll, pitch, yaw = euler_angles(np.moveaxis(by_element, -1, 0))
    blank = np.where(known, 0.0, np.nan)
    return {
        "t_s": result.t,
        "valid": known,
        "lat_deg": np.degrees(latitude) + blank,
        "lon_deg": np.degrees(longitude) + blank,
        "height_m": height + blank,
        **_parts("v", NED, "mps", x["v_n"], known),
        "roll_deg": np.degrees(roll) + blank,
        "pitch_deg": np.degrees(pitch) + blank,
        "heading_deg": np.degrees(yaw) % 360.0 + blank,
        **_parts("sigma_attitude_", NED, "deg", np.degrees(sigma[:, :3]), known),
        **_parts("sigma_v", NED, "mps", sigma[:, 3:6], known),
        **_parts("sigma_position_", NED, "m", sigma[:, 6:], known),
        **_parts("before_minus_fix_", "ne", "m", result.y[:, :2], known),
        "withheld": result.unseen,
        "scored": result.scored,
    }
