"""More vehicles that a navigator may not take for a car: helicopter, drone, drifting boat, leaning
bicycle, train, a car that backs up; and units that are put in askew.

A profile is a planned motion as in vehicles.py: velocity in n, attitude of the unit against n, at
steps of STEP. SI, rad.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_simpson
from scipy.spatial.transform import Rotation

from inertial.constants import GRAVITY
from inertial.simulation.drive_path import Truth
from inertial.simulation.motion import DEG, STEP, Motion, random_steps, smooth

Array = NDArray[np.float64]


def begin(seed: int, kind: int, seconds: float, still: float, rise: float):
    """The draws, the times, and a share of motion that rises from 0 to 1 after the standstill."""
    draw = np.random.default_rng([seed, kind])
    t = STEP * np.arange(round(seconds / STEP) + 1)
    return draw, t, smooth((t > still).astype(float), rise)


def flown(t: Array, v_n: Array, heading: Array) -> Motion:
    """What hangs on rotors: it tilts so that its thrust gives the acceleration, whatever way its
    nose points.
    """
    thrust = np.gradient(v_n, STEP, axis=0) - np.array([0.0, 0.0, GRAVITY])
    ahead = thrust[:, 0] * np.cos(heading) + thrust[:, 1] * np.sin(heading)
    right = thrust[:, 1] * np.cos(heading) - thrust[:, 0] * np.sin(heading)
    pitch = np.arctan2(-ahead, -thrust[:, 2])
    roll = np.arctan2(right, np.hypot(ahead, thrust[:, 2]))
    return Motion(t, v_n, Rotation.from_euler("ZYX", np.column_stack([heading, pitch, roll])))


def helicopter(seed: int, seconds: float = 300.0, still: float = 20.0) -> Motion:
    """Hovers, flies sideways and backwards as often as ahead, turns on the spot."""
    draw, t, moving = begin(seed, 41, seconds, still, 1.5)
    v = np.column_stack(
        [smooth(random_steps(draw, t, (8.0, 20.0), [-8.0, 0.0, 0.0, 8.0]), 2.0) for _ in "NE"]
        + [smooth(random_steps(draw, t, (10.0, 30.0), [-1.5, 0.0, 1.5]), 2.0)]
    )
    turning = DEG * smooth(random_steps(draw, t, (4.0, 12.0), [-20.0, 0.0, 0.0, 20.0]), 1.0)
    heading = draw.uniform(-np.pi, np.pi) + cumulative_simpson(
        moving * turning, dx=STEP, initial=0.0
    )
    return flown(t, moving[:, None] * v, heading)


def drone(seed: int, seconds: float = 300.0, still: float = 20.0) -> Motion:
    """A small multirotor: up to 12 m/s any way, brisk, its nose turning at will."""
    draw, t, moving = begin(seed, 42, seconds, still, 0.7)
    v = np.column_stack(
        [
            smooth(random_steps(draw, t, (3.0, 9.0), [-12.0, -5.0, 0.0, 5.0, 12.0]), 1.0)
            for _ in "NE"
        ]
        + [smooth(random_steps(draw, t, (5.0, 15.0), [-2.0, 0.0, 2.0]), 1.0)]
    )
    turning = DEG * smooth(random_steps(draw, t, (2.0, 8.0), [-45.0, 0.0, 45.0]), 0.5)
    heading = draw.uniform(-np.pi, np.pi) + cumulative_simpson(
        moving * turning, dx=STEP, initial=0.0
    )
    return flown(t, moving[:, None] * v, heading)


def boat(seed: int, seconds: float = 300.0, still: float = 20.0) -> Motion:
    """A boat at 5 m/s in a current of 1.5 m/s across its way, with leeway and a light swell."""
    draw, t, moving = begin(seed, 43, seconds, still, 3.0)
    turns = DEG * smooth(random_steps(draw, t, (10.0, 25.0), [-8.0, 0.0, 0.0, 8.0]), 2.0)
    heading = draw.uniform(-np.pi, np.pi) + cumulative_simpson(moving * turns, dx=STEP, initial=0.0)
    set_by = draw.uniform(-np.pi, np.pi)
    way = 5.0 * moving
    leeway = 0.4 * moving * np.sin(heading - set_by)
    v_n = np.column_stack(
        [
            way * np.cos(heading) - leeway * np.sin(heading) + 1.5 * moving * np.cos(set_by),
            way * np.sin(heading) + leeway * np.cos(heading) + 1.5 * moving * np.sin(set_by),
            0.3 * moving * np.cos(2.0 * np.pi * t / 4.0),
        ]
    )
    pitch = 3.0 * DEG * moving * np.sin(2.0 * np.pi * t / 4.0)
    roll = 6.0 * DEG * moving * np.sin(2.0 * np.pi * t / 3.1 + 1.0)
    return Motion(t, v_n, Rotation.from_euler("ZYX", np.column_stack([heading, pitch, roll])))


def bicycle(seed: int, seconds: float = 300.0, still: float = 20.0) -> Motion:
    """6 m/s, leaning into every curve so that no side force is felt, and swaying a little."""
    draw, t, moving = begin(seed, 44, seconds, still, 1.5)
    speed = moving * (6.0 + 1.5 * np.sin(2.0 * np.pi * t / 41.0))
    turns = DEG * moving * smooth(random_steps(draw, t, (3.0, 10.0), [-18.0, 0.0, 0.0, 18.0]), 0.8)
    heading = draw.uniform(-np.pi, np.pi) + cumulative_simpson(turns, dx=STEP, initial=0.0)
    lean = np.arctan2(speed * turns, GRAVITY) + 2.0 * DEG * moving * np.sin(2.0 * np.pi * t / 1.1)
    v_n = np.column_stack([speed * np.cos(heading), speed * np.sin(heading), 0.0 * t])
    return Motion(t, v_n, Rotation.from_euler("ZYX", np.column_stack([heading, 0 * t, lean])))


def train(seed: int, seconds: float = 300.0, still: float = 20.0) -> Motion:
    """Long gentle curves up to 35 m/s, slow to gather speed."""
    draw, t, _ = begin(seed, 45, seconds, still, 2.0)
    speed = smooth(np.clip(0.5 * (t - still), 0.0, draw.uniform(25.0, 35.0)), 2.0)
    curvature = smooth(random_steps(draw, t, (15.0, 40.0), [-1 / 800, 0.0, 0.0, 1 / 800]), 4.0)
    heading = draw.uniform(-np.pi, np.pi) + cumulative_simpson(
        speed * curvature, dx=STEP, initial=0.0
    )
    v_n = np.column_stack([speed * np.cos(heading), speed * np.sin(heading), 0.0 * t])
    cant = 0.5 * np.arctan2(speed**2 * curvature, GRAVITY)
    return Motion(t, v_n, Rotation.from_euler("ZYX", np.column_stack([heading, 0 * t, cant])))


def backing_car(seed: int, seconds: float = 300.0, still: float = 20.0) -> Motion:
    """A car that backs out at 5 m/s for a while first, and does so again and again."""
    draw, t, moving = begin(seed, 46, seconds, still, 0.8)
    spells = random_steps(draw, t, (12.0, 30.0), [9.0, 12.0, -4.5])
    spells[t < still + draw.uniform(12.0, 20.0)] = -5.0
    speed = moving * smooth(spells, 1.2)
    curvature = smooth(random_steps(draw, t, (4.0, 10.0), [-0.04, 0.0, 0.0, 0.04]), 1.0)
    heading = draw.uniform(-np.pi, np.pi) + cumulative_simpson(
        speed * curvature, dx=STEP, initial=0.0
    )
    v_n = np.column_stack([speed * np.cos(heading), speed * np.sin(heading), 0.0 * t])
    return Motion(t, v_n, Rotation.from_euler("ZYX", np.column_stack([heading, 0 * t, 0 * t])))


def car_on_ice(seed: int, seconds: float = 300.0, still: float = 20.0) -> Motion:
    """A car that holds its way for 150 s, and from then on drifts through every curve."""
    draw, t, moving = begin(seed, 47, seconds, still, 1.5)
    speed = moving * (9.0 + 2.0 * np.sin(2.0 * np.pi * t / 37.0))
    turns = DEG * moving * smooth(random_steps(draw, t, (4.0, 12.0), [-12.0, 0.0, 12.0]), 1.0)
    course = draw.uniform(-np.pi, np.pi) + cumulative_simpson(turns, dx=STEP, initial=0.0)
    slip = smooth(np.where(t > 150.0, 1.2 * turns, 0.0), 1.0)
    v_n = np.column_stack([speed * np.cos(course), speed * np.sin(course), 0.0 * t])
    return Motion(
        t, v_n, Rotation.from_euler("ZYX", np.column_stack([course + slip, 0 * t, 0 * t]))
    )


def mounted(truth: Truth, turn: Rotation) -> Truth:
    """The same ride felt by a unit that is turned against the vehicle's axes by `turn`."""
    M = turn.as_matrix()
    return replace(truth, C_nb=truth.C_nb @ M, f_b=truth.f_b @ M, omega_ib_b=truth.omega_ib_b @ M)


CRAFT: dict[str, Callable[..., Motion]] = {
    "helicopter": helicopter,
    "drone": drone,
    "boat": boat,
    "bicycle": bicycle,
    "train": train,
    "backing car": backing_car,
    "car on ice": car_on_ice,
}
# a unit that is put in askew: roll, pitch, yaw in deg, of a car's
MOUNTED = {
    "car, unit turned by 30 deg": (0.0, 0.0, 30.0),
    "car, unit across": (0.0, 0.0, 90.0),
    "car, unit upside down": (180.0, 0.0, 0.0),
}
