"""Errors of a filter against the truth of a simulated ride, and whether its sigmas told of them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inertial.earth import ned_between
from inertial.navigation.batch import FilterRun
from inertial.navigation.results import REJECTED, place_of
from inertial.navigation.smoother import SmoothRun
from inertial.rotation import rotation_vector
from inertial.simulation.drive import SimulatedDrive

Array = NDArray[np.float64]

SETTLED_S = 60.0  # s, from which on is scored
FAR = 5.0  # sigmas that an error never exceeds where sigmas are right
PSI, YAW, V, P = slice(0, 2), slice(2, 3), slice(3, 6), slice(6, 9)


@dataclass(frozen=True)
class Errors:
    """RMS, and NEES per component (1 where sigmas are right); NaN where it never navigated."""

    position_m: float
    heading_deg: float
    tilt_deg: float
    velocity_mps: float
    nees_position: float
    nees_heading: float
    nees_tilt: float
    nees_velocity: float
    refused: float  # share of the fixes
    beyond: float  # share of all components off by more than FAR sigmas


def errors_of(run: FilterRun | SmoothRun, drive: SimulatedDrive) -> Errors:
    """At every fix from SETTLED_S on, those that were withheld too."""
    late = run.t >= SETTLED_S
    if not late.any():
        return Errors(*[float("nan")] * 8, refused=0.0, beyond=0.0)
    truth, x = drive.truth, run.x[late]
    at = np.array([drive.row_of(t) for t in run.t[late]])
    psi = rotation_vector(truth.C_nb[at] @ x["C_nb"].transpose(0, 2, 1))
    there = truth.latitude[at], truth.longitude[at], truth.height[at]
    d = np.column_stack(ned_between(there, place_of(x))) * (1.0, 1.0, -1.0)
    e = np.hstack([psi, x["v_n"] - truth.v_n[at], d])
    square = e**2 / np.diagonal(run.P[late], axis1=1, axis2=2)
    nees = np.mean(square, axis=0)
    size = {part: float(np.sqrt(np.mean(np.sum(e[:, rows] ** 2, axis=1)))) for part, rows in PARTS}
    refused = np.mean(run.status == REJECTED) if isinstance(run, FilterRun) else 0.0
    return Errors(
        size["position"],
        float(np.degrees(size["heading"])),
        float(np.degrees(size["tilt"])),
        size["velocity"],
        *(float(nees[rows].mean()) for rows in (P, YAW, PSI, V)),
        refused=float(refused),
        beyond=float(np.mean(square > FAR**2)),
    )


PARTS = (("position", P), ("heading", YAW), ("tilt", PSI), ("velocity", V))
