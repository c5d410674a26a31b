"""Where a simulated car really is: speed, curves and hills drawn from a seed, and what an ideal IMU
in it feels.

Nothing here uses the filters' mechanisation. The motion is written down in n and carried to the
Earth-fixed frame e, where specific force and rate follow from one time derivative each (E-60 to
E-63 of docs/equations-in-motion.md), so transport rate and the n frame's own turning are never
computed by the formulas that the filters use.

Frames: n north-east-down at the car, b forward-right-down, e Earth-centred Earth-fixed. SI, rad.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_simpson
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from inertial.constants import EARTH_RATE
from inertial.earth import gravity, radii

Array = NDArray[np.float64]

PLACE = (np.radians(37.759), np.radians(45.978), 1468.0)  # Azarshahr: rad, rad, m
RATE = 100  # Hz, of the samples; the motion is made at twice that
SMOOTH = 0.5  # s, sigma of the window that rounds the corners of speed and curvature
ROLL_PER_LATERAL = 0.006  # rad per m/s^2: a car leans out of its curves
PITCH_PER_FORWARD = 0.006  # rad per m/s^2: and lifts its nose under way
SLIP_PER_LATERAL = 0.002  # rad per m/s^2: its heading is not quite its course


@dataclass(frozen=True)
class Truth:
    """The real motion of the IMU every 1/RATE s; row 0 at t = 0."""

    t: Array  # (n,) s
    latitude: Array  # (n,) rad
    longitude: Array  # (n,) rad
    height: Array  # (n,) m above the ellipsoid
    v_n: Array  # (n, 3) m/s
    C_nb: Array  # (n, 3, 3)
    f_b: Array  # (n, 3) m/s^2, mean over the interval that ends at t; row 0 repeats row 1
    omega_ib_b: Array  # (n, 3) rad/s, likewise

    @property
    def q_nb(self) -> Array:
        """(n, 4), w x y z, w >= 0."""
        q = Rotation.from_matrix(self.C_nb).as_quat(canonical=True)
        return q[:, [3, 0, 1, 2]]


def drive_truth(
    seed: int, seconds: float = 300.0, still: float = 20.0, climb: float = 20.0
) -> Truth:
    """A town drive that begins with `still` s of standstill; hills give about `climb` m of height
    change.

    Raises ValueError when no 60 s are left to drive in.
    """
    if not 0.0 <= still <= seconds - 60.0:
        raise ValueError(
            f"standstill of {still:g} s in a drive of {seconds:g} s, want at least 60 s of driving"
        )
    draw = np.random.default_rng([seed, 10])
    dt = 0.5 / RATE
    t = dt * np.arange(round(seconds / dt) + 1)
    speed, curvature = _plan(draw, t, still)
    way = cumulative_simpson(speed, dx=dt, initial=0.0)
    slope = _slope(draw, way, climb)
    heading = draw.uniform(-np.pi, np.pi) + cumulative_simpson(
        speed * curvature, dx=dt, initial=0.0
    )
    v_n = speed[:, None] * np.column_stack(
        [np.cos(slope) * np.cos(heading), np.cos(slope) * np.sin(heading), -np.sin(slope)]
    )
    lateral, forward = speed**2 * curvature, np.gradient(speed, dt)
    euler = np.column_stack(
        [
            heading - SLIP_PER_LATERAL * lateral,
            slope + PITCH_PER_FORWARD * forward,
            -ROLL_PER_LATERAL * lateral,
        ]
    )
    nb = Rotation.from_euler("ZYX", euler)
    latitude, longitude, height = position_of(v_n, dt)
    f_b, omega_b = felt(t, latitude, longitude, height, v_n, nb)
    at = slice(None, None, 2)
    return Truth(
        t[at],
        latitude[at],
        longitude[at],
        height[at],
        v_n[at],
        nb.as_matrix()[at],
        interval_mean(f_b),
        interval_mean(omega_b),
    )


def _plan(draw: np.random.Generator, t: Array, still: float) -> tuple[Array, Array]:
    """Speed (m/s, never negative) and curvature (1/m, right positive) along time, from corners,
    bends and stops.
    """
    knots, curve = [(0.0, 0.0), (still, 0.0)], np.zeros_like(t)
    now, speed = still, 0.0
    while now < t[-1]:
        kind = draw.choice(["straight", "bend", "corner", "corner", "stop"])
        target = {
            "straight": draw.uniform(9, 16),
            "bend": draw.uniform(7, 12),
            "corner": 6.0,
            "stop": 0.0,
        }[kind]
        change = abs(target - speed) / draw.uniform(1.0, 2.2)  # at 1 to 2.2 m/s^2
        hold = {
            "straight": draw.uniform(4, 10),
            "bend": draw.uniform(5, 9),
            "corner": 3.0,
            "stop": draw.uniform(3, 8),
        }
        begin, end = now + change, now + change + hold[kind]
        side = draw.choice([-1.0, 1.0])
        if kind == "corner":  # a quarter turn
            curve[(t >= begin) & (t < end)] = (
                side * draw.uniform(0.8, 1.1) * 0.5 * np.pi / (target * hold[kind])
            )
        elif kind == "bend":
            curve[(t >= begin) & (t < end)] = side * draw.uniform(0.5, 2.5) / target**2
        knots += [(begin, target), (end, target)]
        now, speed = end, target
    times, speeds = np.array(knots).T
    width = SMOOTH / (t[1] - t[0])
    raw = np.interp(t, times, speeds)
    return np.maximum(gaussian_filter1d(raw, width), 0.0), gaussian_filter1d(curve, width)


def _slope(draw: np.random.Generator, way: Array, climb: float) -> Array:
    """Angle of the road, rad, as a function of the way: a few hills one after the other."""
    length = max(float(way[-1]), 1.0)
    hills = np.array([0.5, 1.5, 4.0])  # periods over the drive
    phase = draw.uniform(0.0, 2.0 * np.pi, 3)
    weight = np.array([0.8, 0.3, 0.05]) * 0.5 * climb
    k = 2.0 * np.pi * hills / length
    return np.arctan((weight * k * np.cos(k * way[:, None] + phase)).sum(axis=1))


def position_of(v_n: Array, dt: float) -> tuple[Array, Array, Array]:
    """Latitude, longitude and height of a velocity; latitude by three fixed-point rounds of the
    quadrature (E-60).
    """
    latitude0, longitude0, height0 = PLACE
    height = height0 - cumulative_simpson(v_n[:, 2], dx=dt, initial=0.0)
    latitude = np.full(len(v_n), latitude0)
    for _ in range(3):  # each round gains five digits: the radii hardly change over a drive
        meridian, normal = radii(latitude)
        latitude = latitude0 + cumulative_simpson(
            v_n[:, 0] / (meridian + height), dx=dt, initial=0.0
        )
    meridian, normal = radii(latitude)
    turn = v_n[:, 1] / ((normal + height) * np.cos(latitude))
    return latitude, longitude0 + cumulative_simpson(turn, dx=dt, initial=0.0), height


def felt(
    t: Array, latitude: Array, longitude: Array, height: Array, v_n: Array, nb: Rotation
) -> tuple[Array, Array]:
    """Specific force and rate in b at every time, from Newton's law in e (E-62, E-63)."""
    en = Rotation.from_euler("ZY", np.column_stack([longitude, -0.5 * np.pi - latitude]))
    v_e = en.apply(v_n)
    spin_e = np.array([0.0, 0.0, EARTH_RATE])
    down_e = en.apply([0.0, 0.0, 1.0])
    a_e = CubicSpline(t, v_e).derivative()(t)
    f_e = a_e + 2.0 * np.cross(spin_e, v_e) - gravity(latitude, height)[:, None] * down_e
    eb = en * nb
    angle = np.vstack([np.zeros(3), np.cumsum((eb[:-1].inv() * eb[1:]).as_rotvec(), axis=0)])
    turning = CubicSpline(t, angle).derivative()(
        t
    )  # small steps: the rotation vector's rate is the rate
    return eb.inv().apply(f_e), turning + eb.inv().apply(spin_e)


def interval_mean(values: Array) -> Array:
    """Mean over each sample's interval by Simpson's rule; (2 n + 1, 3) -> (n + 1, 3)."""
    mean = (values[:-2:2] + 4.0 * values[1:-1:2] + values[2::2]) / 6.0
    return np.vstack([mean[:1], mean])
