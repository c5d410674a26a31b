"""What the core's filters say of fixes: tables whose columns are the fields of its structs."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from inertial.core import navigation as core

Table = NDArray[np.void]

# what became of a fix; DOUBTED: used with less weight
USED, REJECTED, WITHHELD, LATE, READMITTED, DOUBTED = range(6)


def dtype_of(columns: tuple[list[tuple], int]) -> np.dtype:
    """The numpy type of a struct: its fields' names, formats, shapes and places."""
    fields, size = columns
    formats = [(f if isinstance(f, str) else dtype_of(f), shape) for _, f, shape, _ in fields]
    return np.dtype(
        {
            "names": [name for name, *_ in fields],
            "formats": formats,
            "offsets": [offset for *_, offset in fields],
            "itemsize": size,
        }
    )


RESULT = dtype_of(core.RESULT_COLUMNS)
"""A filter's verdict on a fix: status, dof, horizon, nis, crisp, inputs (2), y (7), sigma (7),
weight (3), error_ned (3), yaw, left (6), x (the nominal state), P (9, 9)."""
NOMINAL = RESULT["x"]
"""latitude, longitude (rad), height (m), v_n (m/s), C_nb, bias_accel, bias_gyro, scale_accel,
scale_gyro, lag_position, lag_velocity (s), mount_pitch, mount_yaw (rad), axle (m)."""
SMOOTHED = dtype_of(core.SMOOTHED_COLUMNS)
"""The smoothed solution at a fix: left (7), x, P (9, 9)."""


def run(
    leg: Any,
    model: Any,
    settings: Any,
    memory: Any,
    imu: NDArray[np.float64],
    start: int,
    stop: int,
    fixes: list[Any],
) -> Table:
    """Samples start..stop-1 of imu (n, 7) and all fixes among them, in order; a row per fix.

    The core's structs leg and memory change in place.
    """
    return core.run(leg, model, settings, memory, imu, start, stop, fixes).view(RESULT)


def place_of(x: Table) -> tuple[NDArray[np.float64], ...]:
    """Latitude and longitude (rad) and height (m), (k,) each, of nominal states (k,)."""
    return x["latitude"], x["longitude"], x["height"]
