"""Attitude filters of a six-axis board behind one protocol, by name in ATTITUDES.

All give q_nb with n = north-east-down but for heading, which nothing here observes: it starts at an
arbitrary value and follows the gyro (the published form does not even have that). Their numbers
live in the core (core/attitude): the same bits on every processor, pickled exactly.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from inertial.attitude import tilt
from inertial.core import attitude

Array = NDArray[np.float64]


@dataclass(frozen=True)
class AttitudeState:
    """What a filter says after a sample."""

    q_nb: Array  # (4,) w x y z
    bias_omega_b: Array  # (3,) rad/s; zero for filters that do not estimate it
    resting: bool = False  # the filter takes the board to be at rest
    inclination_sigma: float = 0.0  # rad; 0: the filter does not say


class AttitudeFilter(Protocol):
    """One filter for samples of one period."""

    def step(self, f_b: Array, omega_b: Array) -> AttitudeState:
        """Take a sample: specific force (3,) m/s^2 and rate (3,) rad/s."""

    def batch(self, f_b: Array, omega_b: Array) -> Array:
        """q_nb (n, 4) after each of n samples (n, 3); the same numbers as step gives."""


class _Native:
    """A filter of the core, which pickles itself."""

    def __init__(self, native: object) -> None:
        self._native = native

    def step(self, f_b: Array, omega_b: Array) -> AttitudeState:
        """See AttitudeFilter."""
        return AttitudeState(self.batch(f_b[None, :], omega_b[None, :])[0], np.zeros(3))

    def batch(self, f_b: Array, omega_b: Array) -> Array:
        """See AttitudeFilter."""
        return self._native.batch(
            np.ascontiguousarray(f_b, np.float64), np.ascontiguousarray(omega_b, np.float64)
        )


class PublishedTilt(_Native):
    """The article's filter, letter by letter: two projection angles, a fixed weight, no third gyro
    (E-72 to E-75).
    """

    def __init__(self, period: float, w_gyro: float = tilt.W_GYRO) -> None:
        """period in s between samples."""
        super().__init__(attitude.PublishedTilt(period=period, w_gyro=w_gyro))


class VectorTilt(_Native):
    """The article's weighting on whole rotations, with all three gyros (E-76)."""

    def __init__(self, period: float, time_constant: float = tilt.TIME_CONSTANT) -> None:
        """period in s; the weight w_gyro is time_constant / period, so that it means the same at
        every rate.
        """
        super().__init__(attitude.VectorTilt(period=period, w_gyro=time_constant / period))


class VqfFilter(_Native):
    """Laidig and Seel's VQF (Information Fusion 91, 2023) without magnetometer, at its published
    settings (E-79c to E-79i).

    The accelerometer is low-passed in an almost inertial frame; gyro bias is estimated in motion
    and at rest.
    """

    def __init__(self, period: float) -> None:
        """period in s between samples."""
        super().__init__(attitude.vqf(period))

    def step(self, f_b: Array, omega_b: Array) -> AttitudeState:
        """See AttitudeFilter."""
        q_nb = self.batch(f_b[None, :], omega_b[None, :])[0]
        return AttitudeState(q_nb, self._native.bias_b, self._native.resting)


ATTITUDES: dict[str, Callable[[float], AttitudeFilter]] = {
    "vqf": VqfFilter,
    "tilt-vector": VectorTilt,
    "tilt-published": PublishedTilt,
}
"""Makers of filters by name; each takes the sample period in s. The first is the default."""
