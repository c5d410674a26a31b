"""A board with many accelerometers and gyroscopes beside them, on disk: the accelerometers scored
by the gyroscopes.

For a flat layout, which does not see all of the field, one combination of the products it does see
is compared with the same combination of the gyroscopes' rate. Form of the file (npz): raw (n,
sensors, 6) int16, tick (n,) of a 64 MHz counter of 32 bits, acc_board_mps2 and gyro_board_dps (n,
sensors, 3), C_sensor_to_board (sensors, 3, 3).
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from inertial.calibration.card import Card, make_card
from inertial.calibration.fit import fit
from inertial.calibration.poses import collect, find
from inertial.layouts.layout import GeometryError, Layout

Array = NDArray[np.float64]

TICKS = 64e6  # per second
FULL_SCALE = 32700  # counts, beyond which a 16-bit reading is clipped
RATE_QUADRATIC = np.array(
    [0.0] * 6 + [0.5, 0.0, 0.0, 0.5, 0.0, 1.0]
)  # (w_x^2 + w_y^2)/2 + w_z^2 of the unknowns
SEEN = 1e-6  # of a combination's length that may lie outside what the axes see


@dataclass(frozen=True)
class ArrayLog:
    """Arrays over samples (n)."""

    t_s: Array
    period_s: float
    f_axis: Array  # (n, N) m/s^2, along the sensors' own axes
    gyro: Array  # (n, sensors, 3) rad/s, in b
    clipped: NDArray[np.bool_]  # (n,), a gyroscope was at the end of its range: no truth there


def read_array(path: Path) -> ArrayLog:
    """Read the file; raises OSError, and ValueError for one without these arrays."""
    with np.load(path) as found:
        missing = {"raw", "tick", "acc_board_mps2", "gyro_board_dps", "C_sensor_to_board"} - set(
            found.files
        )
        if missing:
            raise ValueError(
                f"{path}: array {sorted(missing)[0]!r} is missing; want raw, tick,"
                " acc_board_mps2 ..."
            )
        C, f_b = found["C_sensor_to_board"], found["acc_board_mps2"].astype(np.float64)
        tick = found["tick"].astype(np.int64)
        turns = np.concatenate([[0], np.cumsum(np.diff(tick) < 0)])  # the counter has 32 bits: 67 s
        t = (tick + turns * 2**32 - tick[0]) / TICKS
        return ArrayLog(
            t_s=t,
            period_s=float(np.median(np.diff(t))),
            f_axis=np.einsum("nsb,sbk->nsk", f_b, C).reshape(len(t), -1),
            gyro=np.deg2rad(found["gyro_board_dps"].astype(np.float64)),
            clipped=(np.abs(found["raw"][:, :, 3:].astype(np.int32)) >= FULL_SCALE).any(
                axis=(1, 2)
            ),
        )


def combination(layout: Layout, weights: Array) -> Array:
    """Row (N,) that gives weights . [omega'; p; products] of axis readings with the least noise.

    Raises GeometryError when the layout does not see that combination.
    """
    length = np.concatenate([np.full(3, layout.scale_m), np.ones(3), np.full(6, layout.scale_m)])
    F = layout.field_matrix / length
    wanted = weights / length
    row = np.linalg.lstsq(F.T, wanted, rcond=1e-9)[0]
    lost = np.linalg.norm(F.T @ row - wanted) / np.linalg.norm(wanted)
    if lost > SEEN:
        raise GeometryError(
            f"layout {layout.name} does not see this combination: {lost:.0%} of it lies outside"
        )
    return row


@dataclass(frozen=True)
class Score:
    """The accelerometers' combination against the gyroscopes'."""

    samples: int
    correlation: float
    slope: float
    rms: float  # (rad/s)^2


def score(layout: Layout, f_axis: Array, omega_b: Array, use: NDArray[np.bool_]) -> Score:
    """(w_x^2 + w_y^2)/2 + w_z^2 of axis readings (n, N) against that of rates (n, 3), where use
    (n,) says so.
    """
    q = (f_axis @ combination(layout, RATE_QUADRATIC))[use]
    w2 = omega_b[use] ** 2
    true = 0.5 * (w2[:, 0] + w2[:, 1]) + w2[:, 2]
    return Score(
        samples=len(q),
        correlation=float(np.corrcoef(q, true)[0, 1]),
        slope=float(np.polyfit(true, q, 1)[0]),
        rms=float(np.sqrt(np.mean((q - true) ** 2))),
    )


def calibrate_at_rest(
    log: ArrayLog, layout: Layout, still_s: float, date: str
) -> tuple[Card, Array]:
    """Card from the poses of the first still_s seconds, and the rate (n, 3) of all gyroscopes,
    their rest removed.
    """
    part = log.t_s < still_s
    found, noise = find(log.f_axis[part], log.period_s)
    poses = collect(log.f_axis[part], found)
    solved = fit(layout, poses, noise=noise)
    card = make_card(solved, layout, layout.axis_names, device="array", date=date, poses=len(found))
    rest = np.median(np.concatenate([log.gyro[one.first : one.last] for one in found]), axis=0)
    return card, np.median(log.gyro - rest, axis=1)
