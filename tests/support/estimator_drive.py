"""An exact drive: states and the IMU samples that the mechanisation turns into those states."""

import math

import numpy as np
from numpy.typing import NDArray

from inertial.earth import radii
from inertial.navigation.fix import RTK_FIXED, Fix
from inertial.rotation import euler_matrix
from logs.score import Drive
from tests.inertial.twins.strapdown import State, inverse_step, moved

Array = NDArray[np.float64]
DT = 0.01


def motion(t: float, still: float) -> tuple[Array, Array]:
    """v_n (3,) and C_nb (3, 3) of a car that waits `still` s, then drives with turns, hills and
    roll.
    """
    s = max(0.0, t - still)
    speed = 12.0 * (1.0 - math.exp(-((s / 4.0) ** 2))) * (1.0 + 0.25 * math.sin(0.35 * s))
    yaw = 0.6 + 0.9 * math.sin(0.12 * s) + 0.5 * (1.0 - math.cos(0.31 * s))
    climb = 0.06 * math.sin(0.2 * s)
    v = speed * np.array(
        [math.cos(climb) * math.cos(yaw), math.cos(climb) * math.sin(yaw), -math.sin(climb)]
    )
    return v, euler_matrix(0.02 + 0.05 * math.sin(0.4 * s), climb + 0.01, yaw)


def exact(
    duration: float, still: float = 0.0, ba: Array = np.zeros(3), bg: Array = np.zeros(3)
) -> tuple[list[State], Array]:
    """States every DT, and the samples (n, 7: t, f, w) between them, with biases in the samples."""
    n = round(duration / DT)
    imu = np.zeros((n, 7))
    place = math.radians(37.759), math.radians(45.978), 1468.0
    x = [State(*place, *motion(0.0, still), ba, bg)]
    for k in range(n):
        v, C_nb = motion((k + 1) * DT, still)
        f, w = inverse_step(x[k], v, C_nb, DT)
        imu[k] = (k + 1) * DT, *f, *w
        x.append(State(*moved(x[k], v, DT), v, C_nb, ba, bg))
    return x, imu


def fix_at(
    x: State,
    t: float,
    noise_p: Array,
    noise_v: Array,
    sigma_p: float,
    sigma_v: float,
    delay: float = 0.0,
) -> Fix:
    """A fix of state x, antenna at the IMU, with noise (m N E U, m/s)."""
    R_N, R_E = radii(x.latitude)
    return Fix(
        t=t,
        arrival=t + delay,
        latitude=x.latitude + noise_p[0] / (R_N + x.height),
        longitude=x.longitude + noise_p[1] / ((R_E + x.height) * math.cos(x.latitude)),
        height=x.height + noise_p[2],
        quality=RTK_FIXED,
        sigma_p=np.full(3, sigma_p),
        v_n=x.v_n + noise_v,
        sigma_v=np.full(3, sigma_v),
        key=round(t / DT),
    )


def drive(x: list[State], imu: Array, step: int = 100, phase: int = 3, delay: float = 0.0) -> Drive:
    """A drive with a perfect fix every `step` samples, `delay` s late."""
    zero = np.zeros(3)
    fixes = [
        fix_at(x[k], k * DT, zero, zero, 0.01, 0.05, delay) for k in range(phase, len(x), step)
    ]
    return Drive(imu, fixes)
