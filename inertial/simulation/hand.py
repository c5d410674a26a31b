"""A tilt board in somebody's hand: moves from pose to pose, what its sensors feel, and any wiring
of them.

b forward-right-down, n north-east-down. A move turns about one axis of b by the smoothest cubic;
the board's centre does not accelerate, a hand's tremor apart.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from inertial.constants import GRAVITY

Array = NDArray[np.float64]

RATE_HZ = 100.0
QUARTER = math.pi / 2.0
POSES = {  # against level, rad, about axes of b
    "level": (0.0, 0.0, 0.0),
    "nose up": (0.0, QUARTER, 0.0),
    "right down": (QUARTER, 0.0, 0.0),
    "turned right": (0.0, 0.0, QUARTER),
}
GUIDED = ("level", "nose up", "level", "right down", "level", "turned right")


@dataclass(frozen=True)
class Errors:
    """Of the sensors: drawn per sample, and once."""

    force_noise: float = 0.03  # m/s^2
    rate_noise: float = math.radians(0.3)  # rad/s
    rate_bias: float = math.radians(0.8)  # rad/s
    size: float = 0.06  # rad, how far from a quarter turn a hand stops


class Hand:
    """The board's attitude sample by sample; move_to() says where to go next, step() takes it
    there.
    """

    def __init__(self, seed: int, errors: Errors = Errors()) -> None:
        self.attitude = Rotation.identity()  # b to n
        self.errors = errors
        self._draw = np.random.default_rng([seed, 40])
        self._bias = self._draw.normal(size=3) * errors.rate_bias
        self._from, self._turn = self.attitude, np.zeros(3)
        self._at, self._length = 0, 0  # samples of the move under way

    @property
    def resting(self) -> bool:
        """No move is under way."""
        return self._at >= self._length

    def move_to(self, goal: Rotation, seconds: float) -> None:
        """Begin a move to an attitude."""
        self._from, self._turn = self.attitude, (self.attitude.inv() * goal).as_rotvec()
        self._at, self._length = 0, max(1, round(seconds * RATE_HZ))

    def pose(self, name: str) -> Rotation:
        """A pose of POSES as a hand takes it: roughly. Level keeps the heading of now."""
        heading = Rotation.from_euler("z", self.attitude.as_euler("ZYX")[0])
        off = self._draw.normal(size=3) * self.errors.size * (0.3 if name == "level" else 1.0)
        return heading * Rotation.from_rotvec(
            np.array(POSES[name]) + off * (np.array(POSES[name]) != 0.0)
        )

    def step(self) -> tuple[Array, Array]:
        """The next sample: specific force (3,) m/s^2 and rate (3,) rad/s in b, as the sensors give
        them.
        """
        rate = np.zeros(3)
        if not self.resting:
            self._at += 1
            x, dt = self._at / self._length, self._length / RATE_HZ
            self.attitude = self._from * Rotation.from_rotvec(self._turn * (3.0 - 2.0 * x) * x * x)
            rate = self._turn * 6.0 * x * (1.0 - x) / dt
        f = self.attitude.inv().apply([0.0, 0.0, -GRAVITY])
        e = self.errors
        return (
            f + self._draw.normal(size=3) * e.force_noise,
            rate + self._bias + self._draw.normal(size=3) * e.rate_noise,
        )


def guided(
    seed: int,
    poses: Sequence[str] = GUIDED,
    rest_s: float = 3.0,
    move_s: float = 1.5,
    errors: Errors = Errors(),
) -> tuple[Array, Array, Array]:
    """A whole detection: force (n, 3), rate (n, 3) and the true q_nb (n, 4), w x y z, at
    RATE_HZ.
    """
    hand, force, rate, q = Hand(seed, errors), [], [], []
    for name in poses:
        hand.move_to(hand.pose(name), move_s)
        for _ in range(round((move_s + rest_s) * RATE_HZ)):
            f, w = hand.step()
            force.append(f)
            rate.append(w)
            q.append(hand.attitude.as_quat(canonical=True)[[3, 0, 1, 2]])
    return np.array(force), np.array(rate), np.array(q)


@dataclass(frozen=True)
class AnalogueWiring:
    """Which input of the converter carries which article's axis, and which way: x y z of force,
    rates xz and yz.

    A sixth one is a gyroscope about +z_b, which the article's board does not have.
    """

    inputs: tuple[int, ...] = (0, 1, 2, 3, 4)
    signs: tuple[int, ...] = (1, 1, 1, -1, -1)  # as the Acc_Gyro board
    channels: int = 5
    bits: int = 12
    vref: float = 3.3  # V
    zero_g: float = 1.65  # V
    per_g: float = 0.4785  # V
    zero_rate: float = 1.23  # V
    per_dps: float = 0.002  # V

    def counts(self, force: Array, rate: Array) -> NDArray[np.int64]:
        """(n, channels) counts of force (n, 3) m/s^2 and rate (n, 3) rad/s in b; open inputs read
        half a volt.
        """
        a = force / GRAVITY * [1.0, -1.0, -1.0]
        turning = np.degrees(
            rate[:, [1, 0, 2][: len(self.inputs) - 3]]
        )  # RateAxz is about +y_b, RateAyz about +x_b
        signs = np.array(self.signs)
        volts = np.full((len(force), self.channels), 0.5)
        volts[:, list(self.inputs[:3])] = self.zero_g + self.per_g * a * signs[:3]
        volts[:, list(self.inputs[3:])] = self.zero_rate + self.per_dps * turning * signs[3:]
        full = 2**self.bits - 1
        return np.clip(np.rint(volts / self.vref * full), 0, full).astype(np.int64)


def misread(values: Array, order: tuple[int, ...], signs: tuple[int, ...]) -> Array:
    """A three-axis sensor on its board the wrong way: column k shows signs[k] times axis order[k]
    of (n, 3).
    """
    return values[:, list(order)] * np.array(signs)
