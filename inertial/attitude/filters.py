"""Attitude filters of a six-axis board behind one protocol, by name in ATTITUDES.

All give q_nb with n = north-east-down but for heading, which nothing here observes: it starts at an
arbitrary value and follows the gyro (the published form does not even have that).
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from vqf import VQF

from inertial.attitude import tilt

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


class PublishedTilt:
    """The article's filter, letter by letter: two projection angles, a fixed weight, no third gyro
    (E-72 to E-75).
    """

    def __init__(self, period: float, w_gyro: float = tilt.W_GYRO) -> None:
        """period in s between samples."""
        self._period, self._w_gyro = period, w_gyro
        self._state = np.zeros(6)

    def step(self, f_b: Array, omega_b: Array) -> AttitudeState:
        """See AttitudeFilter."""
        return AttitudeState(self.batch(f_b[None, :], omega_b[None, :])[0], np.zeros(3))

    def batch(self, f_b: Array, omega_b: Array) -> Array:
        """See AttitudeFilter."""
        R_a = np.empty((len(f_b), 3))
        rates = tilt.published_rates(omega_b)
        tilt.published(self._state, f_b * tilt.TO_ARTICLE, rates, self._period, self._w_gyro, R_a)
        return tilt.upright_from(R_a * tilt.TO_ARTICLE)


class VectorTilt:
    """The article's weighting on whole rotations, with all three gyros (E-76)."""

    def __init__(self, period: float, time_constant: float = tilt.TIME_CONSTANT) -> None:
        """period in s; the weight w_gyro is time_constant / period, so that it means the same at
        every rate.
        """
        self._period, self._w_gyro = period, time_constant / period
        self._state = np.zeros(8)
        self._state[0] = 1.0

    def step(self, f_b: Array, omega_b: Array) -> AttitudeState:
        """See AttitudeFilter."""
        return AttitudeState(self.batch(f_b[None, :], omega_b[None, :])[0], np.zeros(3))

    def batch(self, f_b: Array, omega_b: Array) -> Array:
        """See AttitudeFilter."""
        q_nb = np.empty((len(f_b), 4))
        f, w = np.ascontiguousarray(f_b), np.ascontiguousarray(omega_b)
        tilt.vector_form(self._state, f, w, self._period, self._w_gyro, q_nb)
        return q_nb


class VqfFilter:
    """Laidig and Seel's VQF (Information Fusion 91, 2023) without magnetometer, at its published
    settings.

    The accelerometer is low-passed in an almost inertial frame; gyro bias is estimated in motion
    and at rest.
    """

    def __init__(self, period: float) -> None:
        """period in s between samples."""
        self._period = period
        self._vqf = VQF(period)

    def __getstate__(self) -> tuple[float, dict[str, object]]:
        """For a process that goes on after a crash: all numbers of the compiled filter."""
        return self._period, self._vqf.state

    def __setstate__(self, saved: tuple[float, dict[str, object]]) -> None:
        """Go on, to the bit, where __getstate__ was asked."""
        self._period = saved[0]
        self._vqf = VQF(self._period)
        self._vqf.state = saved[1]

    def step(self, f_b: Array, omega_b: Array) -> AttitudeState:
        """See AttitudeFilter."""
        self._vqf.update(np.ascontiguousarray(omega_b), np.ascontiguousarray(f_b))
        bias = np.asarray(self._vqf.getBiasEstimate()[0])
        return AttitudeState(
            to_ned(self._vqf.getQuat6D()[None, :])[0], bias, bool(self._vqf.getRestDetected())
        )

    def batch(self, f_b: Array, omega_b: Array) -> Array:
        """See AttitudeFilter."""
        return to_ned(
            self._vqf.updateBatch(np.ascontiguousarray(omega_b), np.ascontiguousarray(f_b))[
                "quat6D"
            ]
        )


def to_ned(q_eb: Array) -> Array:
    """q_nb (n, 4) of q_eb (n, 4), e east-north-up: (0, 1, 1, 0) / sqrt(2) swaps x and y and turns z
    down.
    """
    k = np.sqrt(0.5)
    w, x, y, z = q_eb.T
    return k * np.column_stack([-x - y, w + z, w - z, y - x])


ATTITUDES: dict[str, Callable[[float], AttitudeFilter]] = {
    "vqf": VqfFilter,
    "tilt-vector": VectorTilt,
    "tilt-published": PublishedTilt,
}
"""Makers of filters by name; each takes the sample period in s. The first is the default."""
