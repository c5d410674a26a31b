"""Vehicles that are no car: what an ideal inertial unit feels in an aircraft, on a walker, in a
body that rolls; and a car in a city whose receiver hears nothing for a minute.

A navigator that takes every vehicle for a car is to be tried on these, and on those of craft.py.
Frames: n north-east-down, b forward-right-down of the unit, which need not be
the vehicle's: a walker carries it askew. SI, rad.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_simpson
from scipy.spatial.transform import Rotation

from inertial.constants import GRAVITY
from inertial.navigation.fix import Fix
from inertial.simulation.craft import CRAFT, MOUNTED, mounted
from inertial.simulation.craft_rare import RARE
from inertial.simulation.drive import (
    REALISTIC,
    Condition,
    Sensors,
    SimulatedDrive,
    observe,
    simulate,
)
from inertial.simulation.drive_path import drive_truth
from inertial.simulation.motion import DEG, STEP, Motion, random_steps, smooth, truth_of

Array = NDArray[np.float64]


def aircraft(seed: int, seconds: float = 300.0, still: float = 20.0) -> Motion:
    """A light aeroplane: take-off, climb, coordinated turns banked to 45 deg, a wind of 8 m/s that
    it crabs into, an angle of attack of some degrees.
    """
    draw = np.random.default_rng([seed, 31])
    t = STEP * np.arange(round(seconds / STEP) + 1)
    airspeed = smooth(np.clip((t - still) * 2.5, 0.0, draw.uniform(48.0, 60.0)), 1.5)
    airborne = smooth((airspeed > 30.0).astype(float), 2.0)
    bank = DEG * random_steps(draw, t, (6.0, 20.0), [-45.0, -30.0, 0.0, 0.0, 30.0, 45.0])
    bank = airborne * smooth(np.where(t > still + 45.0, bank, 0.0), 1.5)
    turning = GRAVITY * np.tan(bank) / np.maximum(airspeed, 20.0)
    heading = draw.uniform(-np.pi, np.pi) + cumulative_simpson(turning, dx=STEP, initial=0.0)
    climb = airborne * smooth(random_steps(draw, t, (15.0, 40.0), [-2.0, 0.0, 3.0]), 3.0)
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
    walking = smooth((t > still).astype(float), 0.4)
    speed = walking * 1.4
    turns = DEG * random_steps(draw, t, (1.0, 1.0), [0, 0, 0, 0, 0, 0, 90.0, -90.0])
    way = draw.uniform(-np.pi, np.pi) + cumulative_simpson(
        smooth(np.where(t > still + 10.0, turns, 0.0), 0.4), dx=STEP, initial=0.0
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
    moving = smooth((t > still).astype(float), 1.5)
    speed = moving * (6.0 + 1.5 * np.sin(2.0 * np.pi * t / 37.0))
    turns = DEG * random_steps(draw, t, (8.0, 20.0), [-12.0, -6.0, 0.0, 6.0, 12.0])
    course = draw.uniform(-np.pi, np.pi) + cumulative_simpson(
        moving * smooth(turns, 1.5), dx=STEP, initial=0.0
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
    **CRAFT,
    **RARE,
}
CITY = Condition("town drive, one minute without fixes", REALISTIC, outages=((150.0, 60.0),))
WALKING = replace(REALISTIC, accel_noise=0.02, gyro_noise=0.02 * DEG)


def _small_sigmas(fix: Fix) -> Fix:
    return replace(fix, sigma_p=fix.sigma_p / 3.0, sigma_v=fix.sigma_v / 3.0)


def _no_velocity(fix: Fix) -> Fix:
    return replace(fix, v_n=None, sigma_v=None)


def _no_velocity_for_a_while(fix: Fix) -> Fix:
    return _no_velocity(fix) if 100.0 <= fix.t < 180.0 else fix


# a car's receiver that is worse than it says, or says less
RECEIVERS: dict[str, Callable[[Fix], Fix]] = {
    "car, sigmas a third": _small_sigmas,
    "car, positions only": _no_velocity,
    "car, no velocity for 80 s": _no_velocity_for_a_while,
}
FAST = replace(REALISTIC, fix_hz=10)
RIDES = ("car", "city", *VEHICLES, *MOUNTED, *RECEIVERS, "car, 10 Hz")


def travel(name: str, seed: int, seconds: float = 300.0) -> SimulatedDrive:
    """Samples, fixes and truth of a ride: a name of RIDES.

    Raises KeyError for another name.
    """
    if name == "car":
        return simulate(seed, "B", seconds)
    if name == "car, 10 Hz":
        return simulate(seed, Condition(name, FAST), seconds)
    if name == "city":
        return simulate(seed, CITY, seconds)
    if name in RECEIVERS:
        drive = simulate(seed, "B", seconds)
        return replace(drive, fixes=[RECEIVERS[name](fix) for fix in drive.fixes])
    if name in MOUNTED:
        turn = Rotation.from_euler("xyz", MOUNTED[name], degrees=True)
        return observe(seed, mounted(drive_truth(seed, seconds), turn), Condition(name))
    sensors: Sensors = WALKING if name == "walker" else REALISTIC
    return observe(seed, truth_of(VEHICLES[name](seed, seconds)), Condition(name, sensors))
