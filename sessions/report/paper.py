"""The published table test's own quantities, from a recording, in the order in which the paper
shows them.

Equation numbers in round brackets are the paper's; docs/equations.md derives them. SI, body frame
b.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inertial.constants import GRAVITY
from inertial.earth import gravity
from inertial.rate.field import cube_angular_acceleration, cube_specific_force
from sessions.report.data import Accel, Rate, Run
from sessions.report.segments import STEP, Segment, grid, reference

Array = NDArray[np.float64]

CUBE_AXES = 12


@dataclass(frozen=True)
class CubeTest:
    """What the cube's twelve axes say by the paper's equations."""

    t: Array  # (n,) s
    f_axis: Array  # (n, 12) m/s^2
    p_b: Array  # (n, 3) m/s^2 (25)
    alpha_b: Array  # (n, 3) rad/s^2 (26)
    bias_b: (
        Array | None
    )  # (3,) m/s^2, equivalent bias from the standstills; None without two headings
    tilt: float | None  # rad, of the table's axis against the vertical


@dataclass(frozen=True)
class PositionError:
    """Inertial navigation of a cube that stays in its place: all of the position is error."""

    name: str
    seconds: float  # since the end of the first standstill
    error: Array  # (3,) m, NED
    closed_form: float | None  # m, what (27) gives for the equivalent bias alone, were it left in
    drift: float  # rad/s that (27) needs to explain the error, the "equivalent drift"


def cube_test(accel: Accel, side: float, segments: list[Segment], run: Run) -> CubeTest | None:
    """None for a board that has not the cube's twelve axes."""
    if accel.f_axis.shape[1] != CUBE_AXES:
        return None
    p = np.array([cube_specific_force(row) for row in accel.f_axis])
    alpha = np.array([cube_angular_acceleration(row, side) for row in accel.f_axis])
    bias, tilt = equivalent_bias(accel.t, p, segments, run)
    return CubeTest(accel.t, accel.f_axis, p, alpha, bias, tilt)


def local_gravity(run: Run) -> float:
    """m/s^2, at the median fix, or the standard one where no fix has a height."""
    high = run.fixes[np.isfinite(run.fixes).all(axis=1)]
    if not len(high):
        return GRAVITY
    return float(gravity(float(np.median(high[:, 1])), float(np.median(high[:, 3]))))


def equivalent_bias(
    t: Array, p: Array, segments: list[Segment], run: Run
) -> tuple[Array | None, float | None]:
    """Bias of p (m/s^2) and tilt of the table's axis (rad) from standstills at different headings.

    At rest p = b + g (u(psi), cos tilt), where the horizontal part u of gravity turns against the
    table's angle psi and the bias b does not: two headings tell them apart. None where all
    standstills have one heading.
    """
    resting = [part for part in segments if part.still and part.holds(t).sum() > 20]
    if run.tacho is None or len(resting) < 2:
        return None, None
    times, step = grid(run.tacho, 0.0, run.seconds + STEP)
    angle = np.concatenate([[0.0], np.cumsum(reference(run.tacho, times)[:-1] * step)])
    rows, values, heights = [], [], []
    for part in resting:
        psi = float(np.interp(0.5 * (part.begin + part.end), times, angle))
        mean = p[part.holds(t)].mean(axis=0)
        c, s = np.cos(psi), np.sin(psi)
        rows += [[1.0, 0.0, c, s], [0.0, 1.0, -s, c]]  # p_xy = b_xy + R(-psi) u
        values += [mean[0], mean[1]]
        heights.append(mean[2])
    design = np.array(rows)
    if np.linalg.cond(design) > 50.0:
        return None, None
    bx, by, ux, uy = np.linalg.lstsq(design, np.array(values), rcond=None)[0]
    g = local_gravity(run)
    tilt = float(np.arcsin(min(1.0, np.hypot(ux, uy) / g)))
    return np.array([bx, by, float(np.mean(heights)) - g * np.cos(tilt)]), tilt


def position_error(
    rate: Rate, bias_b: Array | None, start: float, g: float
) -> PositionError | None:
    """At the end of the run; None for an estimator that does not navigate.

    (27): x = 1/2 b t^2 + 1/6 [d x] (0, 0, -g) t^3. Our estimators take b out at the standstill, so
    what remains is laid on the drift: d = 6 |x| / (g t^3), x horizontal. closed_form is the first
    term with b left in.
    """
    if not np.any(rate.p_n) or rate.t[-1] <= start:
        return None
    t = float(rate.t[-1] - start)
    error = rate.p_n[-1]
    closed = None if bias_b is None else 0.5 * float(np.linalg.norm(bias_b)) * t**2
    return PositionError(
        rate.name, t, error, closed, 6.0 * float(np.hypot(error[0], error[1])) / (g * t**3)
    )
