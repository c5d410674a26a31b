"""Simulated drives: an MPU-class IMU at 100 Hz and a low-cost receiver at 1 Hz in a car whose
motion is known.

CONDITIONS holds the columns A to J of the comparison (inmotion-alignment, section 14). A condition
has two halves: `sensors`, what is true of the drive, and `Tuning`, how a filter's beliefs differ
from the honest ones; the columns with a wrong Q or R are drives like B seen by a filter that is
told something else.

The truth is independent of the filters (drive_path.py). Positions N E U in m, rates in rad/s.
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from inertial.earth import radii
from inertial.navigation.fix import AUTONOMOUS, Fix
from inertial.simulation.drive_path import RATE, Truth, drive_truth

Array = NDArray[np.float64]

DEG = math.pi / 180.0
SAID_P, SAID_V = (
    (1.6, 1.6, 3.2),
    (0.1, 0.1, 0.2),
)  # m, m/s: what such a receiver says of itself, 1 sigma N E U


@dataclass(frozen=True)
class Sensors:
    """What the instruments of one drive are like; sigmas of what is drawn once, per sample, or per
    fix.
    """

    accel_noise: float = 0.05  # m/s^2/sqrt(Hz) under way, vibration included
    gyro_noise: float = 0.05 * DEG  # rad/s/sqrt(Hz), likewise
    accel_still: float = 0.006  # m/s^2/sqrt(Hz) at standstill
    gyro_still: float = 0.012 * DEG
    accel_bias: float = 0.15  # m/s^2, drawn once
    gyro_bias: float = 1.0 * DEG  # rad/s, drawn once
    accel_wander: float = 0.03  # m/s^2, Gauss-Markov
    gyro_wander: float = 0.05 * DEG  # rad/s, Gauss-Markov
    tau: float = 300.0  # s, of both
    scale: float = 0.01  # of 1, scale and cross-axis errors of both sensors
    step_at: float = math.inf  # s, when both biases jump
    accel_step: float = 0.0  # m/s^2 on every axis, the sign drawn once
    gyro_step: float = 0.0  # rad/s, likewise
    fix_white: tuple[float, float, float] = (1.0, 1.0, 2.0)  # m, north east up
    fix_wander: tuple[float, float, float] = (
        1.15,
        1.15,
        2.4,
    )  # m, Gauss-Markov: ionosphere, multipath
    fix_tau: float = 60.0  # s, of the wander
    fix_velocity: tuple[float, float, float] = (0.1, 0.1, 0.2)  # m/s, white
    fix_hz: int = 1  # fixes a second
    latency: float = 0.05  # s: a fix tells where the car was that long before its time
    outliers: float = 0.0  # share of fixes with a gross error
    bursts: int = 0  # spells of 3 to 6 s with one gross error


@dataclass(frozen=True)
class Tuning:
    """How a filter is told something else than what is honest; factors on variances."""

    q_scale: float = 1.0  # of the process noise
    r_scale: float = 1.0  # of the fixes' noise
    constant_bias: bool = False  # biases modelled as constants
    heading_error: float = 0.0  # rad, added to the heading at the start
    sigma_yaw: float = 4.0 * DEG  # rad, believed at the start


@dataclass(frozen=True)
class Condition:
    """One column of the comparison."""

    text: str
    sensors: Sensors = Sensors()
    tuning: Tuning = Tuning()
    outages: tuple[tuple[float, float], ...] = ()  # s: begin, length


REALISTIC = Sensors()
QUIET = replace(
    REALISTIC,
    accel_noise=0.006,
    gyro_noise=0.012 * DEG,
    scale=0.0,
    fix_white=(0.8, 0.8, 1.6),
    fix_wander=(0.0, 0.0, 0.0),
    latency=0.0,
)
OUTLIERS = replace(REALISTIC, outliers=0.05, bursts=2)
STEP = replace(REALISTIC, step_at=150.0, accel_step=0.3, gyro_step=0.5 * DEG)

CONDITIONS: dict[str, Condition] = {
    "A": Condition("quiet sensors, white GNSS error", QUIET),
    "B": Condition(
        "realistic: vibration, 1 % scale and cross-axis, correlated GNSS error, 50 ms latency"
    ),
    "C": Condition("B with 5 % gross fixes and bursts", OUTLIERS),
    "D": Condition("B, filter believes Q/10", tuning=Tuning(q_scale=0.1)),
    "K": Condition("B, filter believes Q/100", tuning=Tuning(q_scale=0.01)),
    "E": Condition("B, filter believes 10 Q", tuning=Tuning(q_scale=10.0)),
    "F": Condition("B, filter believes R/10", tuning=Tuning(r_scale=0.1)),
    "G": Condition("B, filter believes 10 R", tuning=Tuning(r_scale=10.0)),
    "H": Condition(
        "bias step 0.3 m/s^2, 0.5 °/s; filter models constant biases",
        STEP,
        Tuning(constant_bias=True),
    ),
    "H2": Condition("the same step; filter models wandering biases", STEP),
    "I": Condition(
        "B with three 20 s outages", outages=((90.0, 20.0), (170.0, 20.0), (250.0, 20.0))
    ),
    "J": Condition("20 deg heading error, 4 deg believed", tuning=Tuning(heading_error=20.0 * DEG)),
    "J2": Condition(
        "60 deg heading error, 4 deg believed", tuning=Tuning(heading_error=60.0 * DEG)
    ),
    "J3": Condition(
        "60 deg heading error, 40 deg believed",
        tuning=Tuning(heading_error=60.0 * DEG, sigma_yaw=40.0 * DEG),
    ),
}


@dataclass(frozen=True)
class SimulatedDrive:
    """Samples, fixes and the truth behind them. Has what logs.score.Drive has, and more."""

    # (n, 7): t s, specific force m/s^2, rate rad/s; each row for the interval that ends at t
    imu: Array
    fixes: list[Fix]  # those inside outages are withheld
    truth: Truth  # row k at sample k, row 0 before the first sample
    accel_bias: Array  # (n, 3) m/s^2, as it was
    gyro_bias: Array  # (n, 3) rad/s
    lever_arm_b: tuple[float, float, float] = (0.0, 0.0, 0.0)
    gross: tuple[int, ...] = field(default=())  # keys of the fixes with a gross error

    def row_of(self, t: float) -> int:
        """Row of the truth nearest to time t."""
        return round(t * RATE)


def simulate(
    seed: int,
    condition: str | Condition = "B",
    seconds: float = 300.0,
    still: float = 20.0,
    climb: float = 20.0,
    lever_arm_b: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> SimulatedDrive:
    """One drive. The same seed is the same road and the same bias in every condition, so columns
    can be compared.

    Raises ValueError for a condition that is not in CONDITIONS.
    """
    if isinstance(condition, str):
        if condition not in CONDITIONS:
            raise ValueError(f"no condition {condition!r}; want one of {', '.join(CONDITIONS)}")
        condition = CONDITIONS[condition]
    return observe(seed, drive_truth(seed, seconds, still, climb), condition, lever_arm_b)


def observe(
    seed: int,
    truth: Truth,
    condition: Condition,
    lever_arm_b: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> SimulatedDrive:
    """Samples and fixes of any motion, by the instruments and outages of a condition."""
    imu, accel_bias, gyro_bias = _imu(np.random.default_rng([seed, 11]), truth, condition.sensors)
    fixes, gross = _fixes(
        np.random.default_rng([seed, 12]), truth, condition.sensors, np.array(lever_arm_b)
    )
    hidden = [any(a <= f.t < a + length for a, length in condition.outages) for f in fixes]
    fixes = [replace(f, withheld=out) for f, out in zip(fixes, hidden, strict=True)]
    return SimulatedDrive(imu, fixes, truth, accel_bias, gyro_bias, lever_arm_b, gross)


def gauss_markov(draw: np.random.Generator, n: int, sigma: Array, steps: float) -> Array:
    """(n, len(sigma)) stationary first-order Gauss-Markov sequences with a time constant of `steps`
    samples.
    """
    sigma = np.asarray(sigma, dtype=np.float64)
    phi = math.exp(-1.0 / steps)
    w = draw.normal(size=(n, len(sigma))) * math.sqrt(1.0 - phi * phi)
    w[0] /= math.sqrt(1.0 - phi * phi)
    return lfilter([1.0], [1.0, -phi], w, axis=0) * sigma


def _imu(draw: np.random.Generator, truth: Truth, s: Sensors) -> tuple[Array, Array, Array]:
    n = len(truth.t) - 1
    speed = np.linalg.norm(truth.v_n[1:], axis=1)
    read, biases = [], []
    for ideal, noise, still, bias, wander, step in (
        (truth.f_b[1:], s.accel_noise, s.accel_still, s.accel_bias, s.accel_wander, s.accel_step),
        (truth.omega_ib_b[1:], s.gyro_noise, s.gyro_still, s.gyro_bias, s.gyro_wander, s.gyro_step),
    ):
        side = draw.choice([-1.0, 1.0], size=3)
        offset = draw.normal(size=3) * bias + gauss_markov(
            draw, n, np.full(3, wander), s.tau * RATE
        )
        offset[truth.t[1:] >= s.step_at] += step * side
        mix = np.eye(3) + draw.normal(size=(3, 3)) * s.scale
        read.append(ideal @ mix.T + offset + _shake(draw, speed, noise, still))
        biases.append(offset)
    return np.column_stack([truth.t[1:], *read]), biases[0], biases[1]


def _shake(draw: np.random.Generator, speed: Array, moving: float, still: float) -> Array:
    """Noise (n, 3) of one sensor: white, and under way half its power in a line at 17 Hz, as of
    wheels and engine.
    """
    white = draw.normal(size=(len(speed), 3)) * math.sqrt(RATE)
    radius, turn = 0.95, 2.0 * math.pi * 17.0 / RATE
    line = lfilter(
        [1.0],
        [1.0, -2.0 * radius * math.cos(turn), radius**2],
        draw.normal(size=white.shape),
        axis=0,
    )
    line *= math.sqrt(RATE) / line.std()
    part = np.minimum(1.0, speed / 5.0)[:, None]
    extra = math.sqrt(max(moving**2 - still**2, 0.0))
    rough = draw.normal(size=white.shape) * math.sqrt(RATE)
    return still * white + extra * part * math.sqrt(0.5) * (rough + line)


def _fixes(
    draw: np.random.Generator, truth: Truth, s: Sensors, lever: Array
) -> tuple[list[Fix], tuple[int, ...]]:
    rows = np.arange(RATE, len(truth.t), RATE // s.fix_hz)  # from 1 s
    error, gross = fix_errors(draw, len(rows), s)
    then = rows - round(s.latency * RATE)
    arm_n = truth.C_nb[then] @ lever
    arm_v = np.einsum("tij,tj->ti", truth.C_nb[then], np.cross(truth.omega_ib_b[then], lever))
    meridian, normal = radii(truth.latitude[then])
    latitude = truth.latitude[then] + (error[:, 0] + arm_n[:, 0]) / (meridian + truth.height[then])
    longitude = truth.longitude[then] + (error[:, 1] + arm_n[:, 1]) / (
        (normal + truth.height[then]) * np.cos(truth.latitude[then])
    )
    height = truth.height[then] + error[:, 2] - arm_n[:, 2]
    v_n = truth.v_n[then] + arm_v + error[:, 3:]
    fixes = [
        Fix(
            float(truth.t[k]),
            float(truth.t[k]),
            float(latitude[i]),
            float(longitude[i]),
            float(height[i]),
            AUTONOMOUS,
            np.array(SAID_P),
            v_n[i],
            np.array(SAID_V),
            key=i,
        )
        for i, k in enumerate(rows)
    ]
    return fixes, gross


def fix_errors(draw: np.random.Generator, n: int, s: Sensors) -> tuple[Array, tuple[int, ...]]:
    """Errors (n, 6) of consecutive fixes: N E U m, v_n m/s; and which have a gross
    one.
    """
    position = (
        gauss_markov(draw, n, np.array(s.fix_wander), s.fix_tau * s.fix_hz)
        + draw.normal(size=(n, 3)) * s.fix_white
    )
    error = np.column_stack([position, draw.normal(size=(n, 3)) * s.fix_velocity])
    gross = _gross(draw, n, s)
    return error + gross, tuple(np.flatnonzero(gross.any(axis=1)).tolist())


def _gross(draw: np.random.Generator, n: int, s: Sensors) -> Array:
    """(n, 6) gross errors: single fixes some 30 m and 1 m/s off, and bursts of one error for some
    seconds.
    """
    error = np.zeros((n, 6))
    single = draw.random(n) < s.outliers
    size = np.array([22.0, 22.0, 30.0, 0.65, 0.65, 0.65])
    error[single] = draw.normal(size=(int(single.sum()), 6)) * size
    for _ in range(s.bursts):
        begin = int(draw.integers(40, max(41, n - 10)))
        error[begin : begin + int(draw.integers(3, 7))] = draw.normal(size=6) * size * 0.7
    return error
