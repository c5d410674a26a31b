"""Vehicles that are no car: what an ideal inertial unit feels in an aircraft, on a walker, in a
body that rolls; and a car in a city whose receiver hears nothing for a minute.

A navigator that takes every vehicle for a car is to be tried on these. Motion is written down in n
and carried to specific force and rate by drive_path.felt (E-60 to E-63), which knows none of the
filters' formulas. Frames: n north-east-down, b forward-right-down of the unit, which need not be
the vehicle's: a walker carries it askew. SI, rad.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_simpson
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from inertial.constants import GRAVITY
from inertial.simulation.drive import (
    REALISTIC,
    Condition,
    Sensors,
    SimulatedDrive,
    observe,
    simulate,
)
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


def _smooth(values: Array, seconds: float) -> Array:
    return gaussian_filter1d(values, seconds / STEP, axis=0)


def _random_steps(
    draw: np.random.Generator, t: Array, every: tuple[float, float], choices
) -> Array:
    """A level that changes now and then, (n,)."""
    out, at = np.zeros_like(t), 0.0
    while at < t[-1]:
        length = draw.uniform(*every)
        out[(t >= at) & (t < at + length)] = draw.choice(choices)
        at += length
    return out


def aircraft(seed: int, seconds: float = 300.0, still: float = 20.0) -> Motion:
    """A light aeroplane: take-off, climb, coordinated turns banked to 45 deg, a wind of 8 m/s that
    it crabs into, an angle of attack of some degrees.
    """
    draw = np.random.default_rng([seed, 31])
    t = STEP * np.arange(round(seconds / STEP) + 1)
    airspeed = _smooth(np.clip((t - still) * 2.5, 0.0, draw.uniform(48.0, 60.0)), 1.5)
    airborne = _smooth((airspeed > 30.0).astype(float), 2.0)
    bank = DEG * _random_steps(draw, t, (6.0, 20.0), [-45.0, -30.0, 0.0, 0.0, 30.0, 45.0])
    bank = airborne * _smooth(np.where(t > still + 45.0, bank, 0.0), 1.5)
    turning = GRAVITY * np.tan(bank) / np.maximum(airspeed, 20.0)
    heading = draw.uniform(-np.pi, np.pi) + cumulative_simpson(turning, dx=STEP, initial=0.0)
    climb = airborne * _smooth(_random_steps(draw, t, (15.0, 40.0), [-2.0, 0.0, 3.0]), 3.0)
    through_air = airspeed[:, None] * np.column_stack([np.cos(heading), np.sin(heading), 0 * t])
    toward = draw.uniform(-np.pi, np.pi)
    wind = 8.0 * airborne[:, None] * np.array([np.cos(toward), np.sin(toward), 0.0])
    v_n = through_air + wind + np.column_stack([0 * t, 0 * t, -climb])
    attack = airborne * DEG * (3.0 + 3.0 * (1.0 / np.cos(bank) - 1.0))
    pitch = attack + np.arctan2(climb, np.maximum(airspeed, 20.0))
    return Motion(t, v_n, Rotation.from_euler("ZYX", np.column_stack([heading, pitch, bank])))


def walker(seed: int, seconds: float = 300.0, still: float = 20.0) -> Motion:
    """Somebody who walks with the unit in a swinging hand, turned against the way: 1.4 m/s, 1.8
    steps a second, quarter turns.
    """
    draw = np.random.default_rng([seed, 32])
    t = STEP * np.arange(round(seconds / STEP) + 1)
    walking = _smooth((t > still).astype(float), 0.4)
    speed = walking * 1.4
    turns = DEG * _random_steps(draw, t, (1.0, 1.0), [0, 0, 0, 0, 0, 0, 90.0, -90.0])
    way = draw.uniform(-np.pi, np.pi) + cumulative_simpson(
        _smooth(np.where(t > still + 10.0, turns, 0.0), 0.4), dx=STEP, initial=0.0
    )
    phase = 2.0 * np.pi * 1.8 * t
    sway = walking * 0.15 * np.sin(0.5 * phase)
    surge, heave = walking * 0.25 * np.sin(phase), walking * 0.35 * np.cos(phase)
    along, across = speed + surge, sway
    v_n = np.column_stack(
        [
            along * np.cos(way) - across * np.sin(way),
            along * np.sin(way) + across * np.cos(way),
            heave,
        ]
    )
    held = DEG * draw.uniform(20.0, 40.0) * draw.choice((-1.0, 1.0))
    swing = walking * 12.0 * DEG * np.sin(0.5 * phase + 0.4)
    roll = walking * 5.0 * DEG * np.sin(0.5 * phase)
    euler = np.column_stack([way + held, 10.0 * DEG + swing, roll])
    return Motion(t, v_n, Rotation.from_euler("ZYX", euler))


def rolling_body(seed: int, seconds: float = 300.0, still: float = 20.0) -> Motion:
    """A body that rolls about its long axis and slides sideways: a boat in a swell, a robot on
    mecanum wheels.
    """
    draw = np.random.default_rng([seed, 33])
    t = STEP * np.arange(round(seconds / STEP) + 1)
    moving = _smooth((t > still).astype(float), 1.5)
    speed = moving * (6.0 + 1.5 * np.sin(2.0 * np.pi * t / 37.0))
    turns = DEG * _random_steps(draw, t, (8.0, 20.0), [-12.0, -6.0, 0.0, 6.0, 12.0])
    course = draw.uniform(-np.pi, np.pi) + cumulative_simpson(
        moving * _smooth(turns, 1.5), dx=STEP, initial=0.0
    )
    slip = moving * DEG * (8.0 + 4.0 * np.sin(2.0 * np.pi * t / 23.0))
    roll = moving * DEG * 25.0 * np.sin(2.0 * np.pi * t / 6.0)
    pitch = moving * DEG * 5.0 * np.sin(2.0 * np.pi * t / 5.0 + 1.0)
    heave = moving * 0.5 * np.cos(2.0 * np.pi * t / 5.0)
    v_n = np.column_stack([speed * np.cos(course), speed * np.sin(course), heave])
    euler = np.column_stack([course + slip, pitch, roll])
    return Motion(t, v_n, Rotation.from_euler("ZYX", euler))


VEHICLES: dict[str, Callable[..., Motion]] = {
    "aircraft": aircraft,
    "walker": walker,
    "rolling body": rolling_body,
}
CITY = Condition("town drive, one minute without fixes", REALISTIC, outages=((150.0, 60.0),))
WALKING = replace(REALISTIC, accel_noise=0.02, gyro_noise=0.02 * DEG)


def travel(name: str, seed: int, seconds: float = 300.0) -> SimulatedDrive:
    """Samples, fixes and truth of a vehicle: a name of VEHICLES, "car" or "city".

    Raises KeyError for another name.
    """
    if name == "car":
        return simulate(seed, "B", seconds)
    if name == "city":
        return simulate(seed, CITY, seconds)
    sensors: Sensors = WALKING if name == "walker" else REALISTIC
    return observe(seed, truth_of(VEHICLES[name](seed, seconds)), Condition(name, sensors))
