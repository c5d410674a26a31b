"""An exact drive: states and the IMU samples that the mechanisation turns into those states."""

import math

import numpy as np
from numpy.typing import NDArray

from inertial.navigation.earth import radii
from inertial.navigation.fix import RTK_FIXED, Fix
from inertial.navigation.strapdown import (
    BA,
    BG,
    LAT,
    LON,
    SIZE,
    C,
    H,
    V,
    euler_to_dcm,
    inverse_step,
)
from logs.score import Drive

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
    return v, euler_to_dcm(0.02 + 0.05 * math.sin(0.4 * s), climb + 0.01, yaw)


def exact(
    duration: float, still: float = 0.0, ba: Array = np.zeros(3), bg: Array = np.zeros(3)
) -> tuple[Array, Array]:
    """States (n + 1, 21) every DT and the samples (n, 7: t, f, w) between them, with biases in the
    samples.
    """
    n = round(duration / DT)
    x = np.zeros((n + 1, SIZE))
    imu = np.zeros((n, 7))
    v, C_nb = motion(0.0, still)
    x[0, LAT], x[0, LON], x[0, H] = math.radians(37.759), math.radians(45.978), 1468.0
    x[0, V], x[0, C], x[0, BA], x[0, BG] = v, C_nb.ravel(), ba, bg
    for k in range(n):
        a, b = x[k], x[k + 1]
        v, C_nb = motion((k + 1) * DT, still)
        f, w = inverse_step(a, v, C_nb, DT)
        imu[k] = (k + 1) * DT, *f, *w
        b[V], b[C], b[BA], b[BG] = v, C_nb.ravel(), ba, bg
        R_N, R_E = radii(a[LAT])
        vm = 0.5 * (a[V] + v)
        b[H] = a[H] - vm[2] * DT
        b[LAT] = a[LAT] + vm[0] * DT / (R_N + a[H])
        b[LON] = a[LON] + vm[1] * DT / ((R_E + a[H]) * math.cos(0.5 * (a[LAT] + b[LAT])))
    return x, imu


def fix_at(
    x: Array,
    t: float,
    noise_p: Array,
    noise_v: Array,
    sigma_p: float,
    sigma_v: float,
    delay: float = 0.0,
) -> Fix:
    """A fix of state x (21,), antenna at the IMU, with noise (m N E U, m/s)."""
    R_N, R_E = radii(x[LAT])
    return Fix(
        t=t,
        arrival=t + delay,
        latitude=x[LAT] + noise_p[0] / (R_N + x[H]),
        longitude=x[LON] + noise_p[1] / ((R_E + x[H]) * math.cos(x[LAT])),
        height=x[H] + noise_p[2],
        quality=RTK_FIXED,
        sigma_p=np.full(3, sigma_p),
        v_n=x[V] + noise_v,
        sigma_v=np.full(3, sigma_v),
        key=round(t / DT),
    )


def drive(x: Array, imu: Array, step: int = 100, phase: int = 3, delay: float = 0.0) -> Drive:
    """A drive with a perfect fix every `step` samples, `delay` s late."""
    zero = np.zeros(3)
    fixes = [
        fix_at(x[k], k * DT, zero, zero, 0.01, 0.05, delay) for k in range(phase, len(x), step)
    ]
    return Drive(imu, fixes)
