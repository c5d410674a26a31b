"""Vehicles that hardly anybody tries a navigator on: a ship in a swell, a helicopter that stands in
the air and turns, a tractor that works backwards, a lift, a tram, a tracked machine that turns on
the spot, a merry-go-round, a glider in a thermal, a car on a ferry.

Profiles as in craft.py: velocity in n, attitude of the unit against n, at steps of STEP. SI, rad.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_simpson
from scipy.spatial.transform import Rotation

from inertial.constants import GRAVITY
from inertial.simulation.craft import begin, flown
from inertial.simulation.motion import DEG, STEP, Motion, random_steps, smooth

Array = NDArray[np.float64]


def _along(t: Array, heading: Array, ahead: Array, aside: Array, down: Array) -> Array:
    """Velocity (n, 3) in n from what the vehicle does ahead, to its right, and down."""
    return np.column_stack(
        [
            ahead * np.cos(heading) - aside * np.sin(heading),
            ahead * np.sin(heading) + aside * np.cos(heading),
            down + 0.0 * t,
        ]
    )


def _attitude(heading: Array, pitch: Array, roll: Array) -> Rotation:
    return Rotation.from_euler("ZYX", np.column_stack([heading, pitch, roll]))


def _headed(draw: np.random.Generator, turning: Array) -> Array:
    """Heading (n,) from a rate of turn, begun anywhere."""
    return draw.uniform(-np.pi, np.pi) + cumulative_simpson(turning, dx=STEP, initial=0.0)


def ship(seed: int, seconds: float = 300.0, still: float = 20.0) -> Motion:
    """A ship that has its way on and heaves, rolls and pitches from the first moment: it never
    stands still, not in harbour either.
    """
    draw, t, moving = begin(seed, 51, seconds, still, 8.0)
    turns = DEG * smooth(random_steps(draw, t, (25.0, 60.0), [-2.0, 0.0, 0.0, 2.0]), 5.0)
    heading = _headed(draw, moving * turns)
    wave = 2.0 * np.pi * t / draw.uniform(7.0, 11.0)
    swell = 0.25 + 0.75 * moving
    v_n = _along(
        t,
        heading,
        moving * 8.0 + 0.4 * swell * np.sin(wave),
        swell * 0.5 * np.cos(wave + 0.6),
        swell * 1.2 * np.cos(wave),
    )
    yaw = heading + swell * 1.5 * DEG * np.sin(0.8 * wave)
    pitch = swell * 3.0 * DEG * np.sin(wave + 0.5)
    roll = swell * 12.0 * DEG * np.sin(0.7 * wave + 1.0)
    return Motion(t, v_n, _attitude(yaw, pitch, roll))


def hovering_helicopter(seed: int, seconds: float = 300.0, still: float = 20.0) -> Motion:
    """Flies to a place, then stands in the air and turns about its mast, most of the time."""
    draw, t, moving = begin(seed, 52, seconds, still, 2.0)
    legs = [-15.0, 0.0, 0.0, 0.0, 0.0, 15.0]
    v = np.column_stack(
        [smooth(random_steps(draw, t, (12.0, 25.0), legs), 3.0) for _ in "NE"]
        + [smooth(random_steps(draw, t, (10.0, 20.0), [-2.0, 0.0, 0.0, 0.0, 2.0]), 2.0)]
    )
    v += 0.15 * smooth(draw.normal(size=v.shape), 1.0) / np.sqrt(STEP)
    turning = DEG * smooth(random_steps(draw, t, (5.0, 15.0), [-30.0, 0.0, 0.0, 30.0]), 1.0)
    return flown(t, moving[:, None] * v, _headed(draw, moving * turning))


def tractor(seed: int, seconds: float = 300.0, still: float = 20.0) -> Motion:
    """Works a field backwards at 2 m/s, rocks on rough ground, turns at the ends, a slope under it
    that it slips down by two degrees.
    """
    draw, t, moving = begin(seed, 53, seconds, still, 1.5)
    laps = np.where((t - still) % 75.0 < 60.0, 0.0, np.pi / 15.0)
    heading = _headed(draw, moving * smooth(laps, 1.5))
    slope = draw.uniform(3.0, 6.0) * DEG
    fall = heading - draw.uniform(-np.pi, np.pi)
    rough = moving[:, None] * 0.02 * smooth(draw.normal(size=(len(t), 2)), 0.35) / np.sqrt(STEP)
    ahead = -2.0 * moving
    v_n = _along(t, heading, ahead, 0.07 * moving * np.sin(fall), np.tan(slope) * ahead * 0.3)
    pitch = -0.3 * slope + rough[:, 0]
    return Motion(t, v_n, _attitude(heading, pitch, slope * np.sin(fall) + rough[:, 1]))


def lift(seed: int, seconds: float = 300.0, still: float = 20.0) -> Motion:
    """A glass lift outside a tower: up and down, never anywhere else."""
    draw, t, moving = begin(seed, 54, seconds, still, 0.7)
    spells = random_steps(draw, t, (8.0, 16.0), [-2.5, 0.0, 2.5])
    down = moving * smooth(spells, 0.7)
    heading = np.full_like(t, draw.uniform(-np.pi, np.pi))
    return Motion(t, _along(t, heading, 0 * t, 0 * t, down), _attitude(heading, 0 * t, 0 * t))


def tram(seed: int, seconds: float = 300.0, still: float = 20.0) -> Motion:
    """Stops for 15 s every minute, brakes smoothly, goes through narrow curves without cant."""
    draw, t, _ = begin(seed, 55, seconds, still, 2.0)
    running = ((t - still) % 60.0 < 42.0) & (t > still)
    speed = 11.0 * smooth(running.astype(float), 3.0)
    curves = smooth(random_steps(draw, t, (8.0, 20.0), [-0.02, 0.0, 0.0, 0.02]), 1.5)
    heading = _headed(draw, speed * curves)
    return Motion(t, _along(t, heading, speed, 0 * t, 0 * t), _attitude(heading, 0 * t, 0 * t))


def tracked(seed: int, seconds: float = 300.0, still: float = 20.0) -> Motion:
    """A machine on tracks: straight on or back at 3 m/s, stops, turns on the spot; the unit sits
    1.5 m behind the point that it turns about.
    """
    draw, t, moving = begin(seed, 56, seconds, still, 0.7)
    ahead, turning = np.zeros_like(t), np.zeros_like(t)
    at = still + 2.0
    while at < t[-1]:
        drive, turn = draw.uniform(8.0, 20.0), draw.uniform(2.0, 5.0)
        ahead[(t >= at) & (t < at + drive)] = draw.choice([3.0, 3.0, -3.0])
        at += drive + 1.5
        turning[(t >= at) & (t < at + turn)] = draw.choice([-1.0, 1.0]) * 25.0 * DEG
        at += turn + 1.5
    rate = moving * smooth(turning, 0.5)
    heading = _headed(draw, rate)
    v_n = _along(t, heading, moving * smooth(ahead, 0.6), -1.5 * rate, 0 * t)
    return Motion(t, v_n, _attitude(heading, 0 * t, 0 * t))


def merry_go_round(seed: int, seconds: float = 300.0, still: float = 20.0) -> Motion:
    """A seat 8 m from the axle at 40 deg/s, nose outward: always sideways, swung out."""
    draw, t, moving = begin(seed, 57, seconds, still, 6.0)
    rate = moving * 40.0 * DEG
    heading = _headed(draw, rate)
    v_n = _along(t, heading, 0 * t, 8.0 * rate, 0 * t)
    return Motion(t, v_n, _attitude(heading, np.arctan2(8.0 * rate**2, GRAVITY) * 0.9, 0 * t))


def glider(seed: int, seconds: float = 300.0, still: float = 20.0) -> Motion:
    """Towed off, then circles in thermals at 40 deg of bank for minutes, carried by the wind."""
    draw, t, _ = begin(seed, 58, seconds, still, 2.0)
    airspeed = smooth(np.clip((t - still) * 2.0, 0.0, 28.0), 1.5)
    airborne = smooth((airspeed > 18.0).astype(float), 2.0)
    side = draw.choice([-1.0, 1.0])
    bank = np.where((t - still) % 110.0 > 35.0, side * 40.0 * DEG, 0.0)
    bank = airborne * smooth(np.where(t > still + 35.0, bank, 0.0), 2.0)
    heading = _headed(draw, GRAVITY * np.tan(bank) / np.maximum(airspeed, 12.0))
    toward = draw.uniform(-np.pi, np.pi)
    v_n = _along(t, heading, airspeed, 0 * t, -airborne * 1.5)
    v_n += 6.0 * airborne[:, None] * np.array([np.cos(toward), np.sin(toward), 0.0])
    return Motion(t, v_n, _attitude(heading, airborne * 4.0 * DEG, bank))


def car_on_a_ferry(seed: int, seconds: float = 300.0, still: float = 20.0) -> Motion:
    """A car that drives for two minutes, then stands on a ferry which sails off sideways."""
    draw, t, moving = begin(seed, 59, seconds, still, 1.5)
    driving = smooth(((t > still) & (t < 130.0)).astype(float), 1.5)
    speed = driving * (10.0 + 2.0 * np.sin(2.0 * np.pi * t / 31.0))
    turns = driving * DEG * smooth(random_steps(draw, t, (4.0, 12.0), [-12.0, 0.0, 12.0]), 1.0)
    sailing = smooth((t > 160.0).astype(float), 6.0)
    yawing = sailing * DEG * smooth(random_steps(draw, t, (20.0, 40.0), [-1.0, 0.0, 1.0]), 5.0)
    heading = _headed(draw, turns + yawing)
    v_n = _along(t, heading, speed + 3.0 * sailing, 5.0 * sailing, 0 * t)
    roll = sailing * 0.5 * DEG * np.sin(2.0 * np.pi * t / 9.0)
    return Motion(t, v_n, _attitude(heading, 0 * t, roll))


RARE: dict[str, Callable[..., Motion]] = {
    "ship": ship,
    "hovering helicopter": hovering_helicopter,
    "tractor": tractor,
    "lift": lift,
    "tram": tram,
    "tracked": tracked,
    "merry-go-round": merry_go_round,
    "glider": glider,
    "car on a ferry": car_on_a_ferry,
}
