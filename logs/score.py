"""Score a navigation filter on a real drive: give it one fix in n, compare its prediction with
those it never saw.
"""

import csv
import math
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inertial.navigation.fix import RTK_FIXED, Fix
from inertial.navigation.navigation import Mode

Array = NDArray[np.float64]

CAR_LEVER_ARM_B = (0.0, -0.05, 0.0)  # m, of the car_drive log
COURSE_SPEED = 4.0  # m/s, above it the course is taken as the heading
QUALITY = {1: RTK_FIXED, 2: 3, 5: 1}  # RTKLIB's quality (1 fixed, 2 float, 5 single) to the bus's


@dataclass(frozen=True)
class Drive:
    """A log: IMU rows t, f (3), w (3) and fixes."""

    imu: Array  # (n, 7)
    fixes: list[Fix]


def read_drive(imu_csv: Path, gnss_csv: Path, every: int = 1) -> Drive:
    """Read the documented CSV form; all fixes but each every-th are marked withheld. Raises
    ValueError, OSError.
    """
    imu = np.loadtxt(imu_csv, delimiter=",", skiprows=1, ndmin=2)
    if imu.shape[1] != 7:
        raise ValueError(f"{imu_csv}: {imu.shape[1]} columns, want 7: t_s, force (3), rate (3)")
    fixes = []
    with open(gnss_csv, newline="") as file:
        for k, row in enumerate(csv.DictReader(file)):
            fixes.append(
                _fix({name: float(value) for name, value in row.items()}, k, k % every != 0)
            )
    return Drive(imu, fixes)


def _fix(row: dict[str, float], key: int, withheld: bool) -> Fix:
    return Fix(
        t=row["t_s"],
        arrival=row["t_s"],
        latitude=math.radians(row["lat_deg"]),
        longitude=math.radians(row["lon_deg"]),
        height=row["height_m"],
        quality=QUALITY.get(int(row["quality"]), 0),
        sigma_p=np.array([row["sd_n_m"], row["sd_e_m"], row["sd_u_m"]]),
        v_n=np.array([row["vn_mps"], row["ve_mps"], row["vd_mps"]]),
        sigma_v=np.full(3, 0.05),
        withheld=withheld,
        key=key,
    )


def score(drive: Drive, navigator: Any) -> dict[str, Any]:
    """Errors at the RTK fixes the filter never saw, from 20 s after navigation began.

    Returns RMS: horizontal_m, vertical_m, velocity_mps (3-D), heading_vs_course_deg (above 4 m/s);
    how many fixes that is over (scored), how many came before (unscored: a heading needs a course),
    the mean NIS of the used fixes per degree of freedom, and us_per_epoch: CPU time of everything,
    corrections included, per IMU sample.
    """
    position, velocity, heading, nis, unscored = [], [], [], [], 0
    began = math.inf
    fixes = iter(drive.fixes)
    pending = next(fixes, None)
    times, force, rate = (
        drive.imu[:, 0].tolist(),
        drive.imu[:, 1:4].copy(),
        drive.imu[:, 4:7].copy(),
    )
    started = time.thread_time_ns()
    for k, t in enumerate(times):
        while pending is not None and pending.arrival <= t:
            navigator.fix(pending)
            pending = next(fixes, None)
        corrections = navigator.imu(t, force[k], rate[k])
        if navigator.mode == Mode.NAVIGATING:
            began = min(began, t)
        for c in corrections:
            if c.accepted and c.nis:
                nis.append(c.nis / len(c.values))
            if not c.fix.withheld or c.fix.quality != RTK_FIXED:
                continue
            if not c.fix.t >= began + 20.0 or not len(c.values):
                unscored += 1
                continue
            position.append(c.error_ned)
            velocity.append(c.values[3:6])
            speed = math.hypot(c.fix.v_n[0], c.fix.v_n[1])
            if speed > COURSE_SPEED:
                yaw = c.yaw - math.atan2(c.fix.v_n[1], c.fix.v_n[0])
                heading.append(math.remainder(yaw, 2.0 * math.pi))
    busy = time.thread_time_ns() - started
    p, v, psi = np.array(position), np.array(velocity), np.array(heading)
    return {
        "horizontal_m": _rms(p[:, :2]),
        "vertical_m": _rms(p[:, 2:]),
        "velocity_mps": _rms(v),
        "heading_vs_course_deg": math.degrees(_rms(psi[:, None])),
        "scored": len(p),
        "unscored": unscored,
        "nis_per_dof": float(np.mean(nis)),
        "counts": dict(navigator.counts),
        "us_per_epoch": busy / 1000.0 / len(times),
    }


def _rms(errors: Array) -> float:
    """Root of the mean of the squared row lengths."""
    return float(np.sqrt(np.mean(np.sum(np.square(errors), axis=1))))
