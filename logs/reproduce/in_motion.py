"""Runs of the navigation filters for the comparison: methods, one drive through one of them, and
its errors.

Three metrics, never to be mixed up (docs/in-motion.md): `error` is estimate minus truth after the
update; `prediction` is the state carried to the next fix minus that fix, which needs no truth and
cannot be gamed; `residual` is the estimate minus the very fix that was just fed in, which any
filter with a high gain makes small and which is no error.
"""

import math
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from inertial.earth import radii
from inertial.navigation import results
from inertial.navigation.alignment import Alignment, AlignmentSettings, Start
from inertial.navigation.error_model import ImuNoise
from inertial.navigation.filters import FILTERS, Constraints, FilterConfig
from inertial.navigation.fix import Fix, FixSettings, core_fix
from inertial.navigation.navigation import NavigatorConfig, first_leg
from inertial.rotation import euler_matrix, rotation_vector
from inertial.simulation.drive import Tuning

Array = NDArray[np.float64]

SETTLED = 15.0  # s after the start of navigation, from which errors count
HONEST = ImuNoise(
    turn=0.0, accel=0.05, gyro=math.radians(0.05), shake=0.0
)  # the simulated sensors' own figures, as they are
BELIEVED = FixSettings(
    wander=0.0,  # the published filters take a receiver at its word
    lag=0.0,
    adapt=0.0,
    floor_p=(0.0, 0.0, 0.0),
    floor_v=(0.0, 0.0, 0.0),
    timing=0.0,
)  # what the fixes say, no more
CONSTANT = 1e-9  # factor on the biases' variance that makes them constants
# as the comparison has it: mounting known, IMU over the rear axle, nothing at standstill
WHEELS = Constraints(
    car=True,
    sigma_side=0.25,
    sigma_up=0.25,
    sigma_mount=math.radians(0.3),
    axle=0.0,
    sigma_axle=0.1,
)
COMPONENTS = ("north_m", "east_m", "height_m", "v_north_mps", "v_east_mps", "v_down_mps")


def plain(name: str, **changes: object) -> FilterConfig:
    """A filter of the table as the comparison has it: no gate and no latency states."""
    return replace(FILTERS[name], gated=False, latency=False, **changes)


def methods(mean_covariance: Array) -> dict[str, FilterConfig]:
    """The rows of the comparison; mean_covariance (15, 15) is the Kalman filter's of a calibration
    run.
    """
    mean = tuple(map(tuple, mean_covariance.tolist()))
    horizons = {"N=1": 1, "N=2": 2, "N=5": 5, "N=10": 10, "fuzzy": 0}
    return {
        "KF": plain("kf"),
        **{f"FPE-P0 {name}": plain("fpe-p0-n1", horizon=n) for name, n in horizons.items()},
        **{
            f"FPE-Pbar {name}": plain("fpe-mean-n1", horizon=n, mean_covariance=mean)
            for name, n in horizons.items()
        },
        "FPE-4Pbar N=10": plain("fpe-4mean-n10", mean_covariance=mean),
        "FPE-4Pbar fuzzy": plain("fpe-4mean-n10", horizon=0, mean_covariance=mean),
        "KF fading 1.05": plain("kf-fading"),
        "KF+NHC": plain("kf", constraints=WHEELS),
        "Huber-KF+NHC": plain("huber", constraints=WHEELS),
        "Huber-KF": plain("huber"),
        "MHE-Huber N=10": plain("mhe-robust"),
    }


@dataclass(frozen=True)
class Inputs:
    """A drive as the filters take it, and what is known of the truth at its fixes."""

    imu: Array  # (n, 7): t, f, w
    fixes: list[Fix]
    position: Array  # (k, 3) true latitude, longitude (rad), height (m) of the IMU at each fix
    v_n: Array  # (k, 3) m/s
    C_nb: Array | None  # (k, 3, 3); None where nobody knows
    lever_arm_b: tuple[float, float, float] = (0.0, 0.0, 0.0)


class Begin(NamedTuple):
    """Where the filters take over from the alignment."""

    start: Start
    fix: int  # place of the fix
    sample: int  # first sample after it
    still_f: float  # |mean f| at standstill, m/s^2


@dataclass
class Errors:
    """Rows of scored fixes: north, east, height (m), v_n (m/s)."""

    t: list[float] = field(default_factory=list)
    error: list[Array] = field(default_factory=list)
    prediction: list[Array] = field(default_factory=list)
    residual: list[Array] = field(default_factory=list)
    attitude: list[Array] = field(default_factory=list)  # psi_n (3,), rad
    t_from_start: list[float] = field(
        default_factory=list
    )  # s since navigation began, of every fix
    attitude_from_start: list[Array] = field(default_factory=list)  # psi_n (3,), rad, of every fix
    horizon: list[tuple[float, float, float, float]] = field(
        default_factory=list
    )  # t, N, the two fuzzy inputs


def align(inputs: Inputs) -> Begin:
    """Level at the standstill, take the course: the common start of all methods. Raises ValueError
    without one.
    """
    alignment = Alignment(AlignmentSettings(in_motion=False))
    k, t = 0, inputs.imu[:, 0]
    for i in range(len(t)):
        alignment.imu(t[i], inputs.imu[i, 1:4], inputs.imu[i, 4:7])
        if k < len(inputs.fixes) and (i + 1 == len(t) or t[i + 1] > inputs.fixes[k].t):
            fix = inputs.fixes[k]
            alignment.fix(fix.t, fix.v_n, fix.sigma_v)
            start = alignment.start(alignment.C, fix.v_n)
            if start is not None:
                still = float(np.linalg.norm(alignment.mean_f))
                return Begin(start, k, i + 1, still)
            k += 1
    raise ValueError(f"this drive never became fit for navigation: {alignment.text}")


def tuned(tuning: Tuning, noise: ImuNoise = HONEST) -> ImuNoise:
    """Process noise as a filter of this condition believes it."""
    s, bias = math.sqrt(tuning.q_scale), CONSTANT if tuning.constant_bias else 1.0
    return replace(
        noise,
        accel=s * noise.accel,
        gyro=s * noise.gyro,
        sigma_bias_accel=s * bias * noise.sigma_bias_accel,
        sigma_bias_gyro=s * bias * noise.sigma_bias_gyro,
        tau=1e9 if tuning.constant_bias else noise.tau,
        position=s * noise.position,
    )


def run(
    inputs: Inputs, begin: Begin, chosen: FilterConfig, tuning: Tuning, noise: ImuNoise = HONEST
) -> Errors:
    """One method over one drive."""
    errors, _ = run_with_memory(inputs, begin, chosen, tuning, noise)
    return errors


def run_with_memory(
    inputs: Inputs, begin: Begin, chosen: FilterConfig, tuning: Tuning, noise: ImuNoise = HONEST
) -> tuple[Errors, Any]:
    """As run, with the core's Memory for those who need its covariances."""
    config = NavigatorConfig(
        lever_arm_b=inputs.lever_arm_b,
        imu=tuned(tuning, noise),
        fix=BELIEVED,
        sigma_yaw=tuning.sigma_yaw,
    )
    start = replace(
        begin.start, C_nb=euler_matrix(0.0, 0.0, tuning.heading_error) @ begin.start.C_nb
    )
    fix = inputs.fixes[begin.fix]
    model = chosen.model(config.imu)
    leg = first_leg(config, chosen, start, fix)
    memory = chosen.memory(leg.P, begin.still_f)
    given = [core_fix(f, BELIEVED) for f in inputs.fixes[begin.fix + 1 :]]
    for f in given:
        f.sigma_p = f.sigma_p * math.sqrt(tuning.r_scale)
        f.sigma_v = f.sigma_v * math.sqrt(tuning.r_scale)
    settings = chosen.settings(BELIEVED, inputs.lever_arm_b)
    imu = np.ascontiguousarray(inputs.imu)
    out = results.run(leg, model, settings, memory, imu, begin.sample, len(imu), given)
    return _errors(inputs, begin.fix, out), memory


def _errors(inputs: Inputs, first: int, out: results.Table) -> Errors:
    said = Errors()
    began = inputs.fixes[first].t
    for row, fix, where, v_n, k in zip(
        out,
        inputs.fixes[first + 1 :],
        inputs.position[first + 1 :],
        inputs.v_n[first + 1 :],
        range(first + 1, len(inputs.fixes)),
        strict=True,
    ):
        if row["horizon"] > 0:
            said.horizon.append((fix.t, row["horizon"], *row["inputs"]))
        x = row["x"]
        psi = None if inputs.C_nb is None else rotation_vector(inputs.C_nb[k] @ x["C_nb"].T)
        if psi is not None:
            said.t_from_start.append(fix.t - began)
            said.attitude_from_start.append(psi)
        if fix.t < began + SETTLED:
            continue
        meridian, normal = radii(where[0])
        said.t.append(fix.t)
        said.error.append(
            np.array(
                [
                    (x["latitude"] - where[0]) * (meridian + where[2]),
                    (x["longitude"] - where[1]) * (normal + where[2]) * math.cos(where[0]),
                    x["height"] - where[2],
                    *(x["v_n"] - v_n),
                ]
            )
        )
        if not fix.withheld:
            said.prediction.append(row["y"][:6].copy())
            said.residual.append(row["left"].copy())
        if psi is not None:
            said.attitude.append(psi)
    return said


def figures(errors: Errors) -> dict[str, float]:
    """RMS of each metric: horizontal, height, 3-D velocity; heading and tilt where they are known.
    SI, rad.
    """
    result = {}
    for name in ("error", "prediction", "residual"):
        rows = np.array(getattr(errors, name))
        rows = rows[np.isfinite(rows).all(axis=1)] if len(rows) else np.full((1, 6), np.nan)
        result[f"{name}_h_m"] = _rms(rows[:, :2])
        result[f"{name}_v_m"] = _rms(rows[:, 2:3])
        result[f"{name}_velocity_mps"] = _rms(rows[:, 3:6])
    if errors.attitude:
        psi = np.array(errors.attitude)
        result["tilt_rad"], result["heading_rad"] = _rms(psi[:, :2]), _rms(psi[:, 2:3])
    return result


def paper_form(errors: Errors) -> dict[str, dict[str, dict[str, float]]]:
    """Mean and standard deviation of each component, as the paper's tables have them, for error and
    residual.
    """
    result = {}
    for name in ("error", "residual"):
        rows = np.array(getattr(errors, name))
        rows = rows[np.isfinite(rows).all(axis=1)]
        result[name] = {
            c: {"mean": float(m), "std": float(s)}
            for c, m, s in zip(COMPONENTS, rows.mean(axis=0), rows.std(axis=0), strict=True)
        }
    return result


def _rms(rows: Array) -> float:
    return float(np.sqrt(np.mean(np.sum(np.square(rows), axis=1))))
