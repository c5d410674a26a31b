"""A planned motion, and what an ideal inertial unit feels of it.

Motion is written down in n and carried to specific force and rate by drive_path.felt (E-60 to
E-63), which knows none of the filters' formulas. SI, rad.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from inertial.simulation.drive_path import RATE, Truth, felt, interval_mean, position_of

Array = NDArray[np.float64]

DEG = np.pi / 180.0
STEP = 0.5 / RATE  # s, between the points at which motion is written down


@dataclass(frozen=True)
class Motion:
    """A planned motion: times (n,), velocity (n, 3) m/s, attitude of b against n."""

    t: Array
    v_n: Array
    nb: Rotation


def truth_of(motion: Motion) -> Truth:
    """Samples of a planned motion."""
    latitude, longitude, height = position_of(motion.v_n, STEP)
    f_b, omega_b = felt(motion.t, latitude, longitude, height, motion.v_n, motion.nb)
    at = slice(None, None, 2)
    return Truth(
        motion.t[at],
        latitude[at],
        longitude[at],
        height[at],
        motion.v_n[at],
        motion.nb.as_matrix()[at],
        interval_mean(f_b),
        interval_mean(omega_b),
    )


def smooth(values: Array, seconds: float) -> Array:
    """Values at steps of STEP, smoothed by a bell of that width."""
    return gaussian_filter1d(values, seconds / STEP, axis=0)


def random_steps(draw: np.random.Generator, t: Array, every: tuple[float, float], choices) -> Array:
    """A level that changes now and then, (n,)."""
    out, at = np.zeros_like(t), 0.0
    while at < t[-1]:
        length = draw.uniform(*every)
        out[(t >= at) & (t < at + length)] = draw.choice(choices)
        at += length
    return out
