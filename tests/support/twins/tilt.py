"""The tilt filters of core/attitude/tilt.cpp in readable numpy (E-72 to E-76)."""

import numpy as np

from inertial.attitude.tilt import ILL_CONDITIONED
from inertial.elementary import atan2, cos, norm, sin, tan
from inertial.rotation import from_rotation_vector, multiply, normalised, rotate

NO_TURN = np.array([1.0, 0.0, 0.0, 0.0])
TO_ARTICLE = np.array([1.0, -1.0, -1.0])  # of a vector's components, b to a; a half turn about x


def onto_up(b_n: np.ndarray) -> np.ndarray:
    """Shortest turn from a direction in n onto up (0, 0, -1): quaternion (1 + b . up, b x up)."""
    north, east, down = b_n
    if 1.0 - down < 1e-12:
        return np.array([0.0, -1.0, 0.0, 0.0])
    return normalised([1.0 - down, -east, north, 0.0])


def pulled_up(q_nb: np.ndarray, f_b: np.ndarray, part: float) -> np.ndarray:
    """q_nb turned by a part of the way that brings f_b's direction onto n's up (E-76)."""
    if norm(f_b) == 0.0:
        return q_nb
    blend = rotate(q_nb, f_b) / norm(f_b) * part - np.array([0.0, 0.0, 1.0 - part])
    if norm(blend) < 1e-9:
        return q_nb
    return multiply(onto_up(blend / norm(blend)), q_nb)


class PublishedTilt:
    """R by two projection angles and the direction felt, weighted (E-72 to E-75)."""

    def __init__(self, period: float, w_gyro: float) -> None:
        self.period, self.w_gyro = period, w_gyro
        self.R_a: np.ndarray | None = None
        self.before = np.zeros(2)

    def step(self, f_b: np.ndarray, omega_b: np.ndarray) -> np.ndarray:
        """q_nb after a sample."""
        f_a, rates = f_b * TO_ARTICLE, np.array([omega_b[1], omega_b[0]])
        felt = f_a / norm(f_a) if norm(f_a) > 0.0 else None
        if self.R_a is not None:
            R = self.turned(rates)
            R = R if felt is None else felt + self.w_gyro * R
            self.R_a = R / norm(R) if norm(R) > 1e-9 else self.R_a
        else:
            self.R_a = felt
        self.before = rates
        up_a = np.zeros(3) if self.R_a is None else self.R_a
        return pulled_up(NO_TURN, up_a * TO_ARTICLE, 1.0)

    def turned(self, rates: np.ndarray) -> np.ndarray:
        """R by the gyros alone."""
        x, y, z = self.R_a
        if abs(z) < ILL_CONDITIONED:
            return self.R_a
        xz = atan2(x, z) + self.period * 0.5 * (rates[0] + self.before[0])
        yz = atan2(y, z) + self.period * 0.5 * (rates[1] + self.before[1])
        across_x, across_y = cos(xz) * tan(yz), cos(yz) * tan(xz)
        x = sin(xz) / np.sqrt(1.0 + across_x * across_x)
        y = sin(yz) / np.sqrt(1.0 + across_y * across_y)
        return np.array([x, y, np.sign(z) * np.sqrt(max(0.0, 1.0 - x * x - y * y))])


class VectorTilt:
    """The same weighting on whole rotations (E-76)."""

    def __init__(self, period: float, w_gyro: float) -> None:
        self.period, self.part = period, 1.0 / (1.0 + w_gyro)
        self.q_nb, self.before, self.started = NO_TURN, np.zeros(3), False

    def step(self, f_b: np.ndarray, omega_b: np.ndarray) -> np.ndarray:
        """q_nb after a sample."""
        if self.started:
            turn = 0.5 * self.period * (omega_b + self.before)
            turned = multiply(self.q_nb, from_rotation_vector(turn))
            self.q_nb = normalised(pulled_up(turned, f_b, self.part))
        elif f_b.any():
            self.q_nb, self.started = pulled_up(NO_TURN, f_b, 1.0), True
        self.before = omega_b
        return self.q_nb
