"""Strapdown mechanisation in numpy, one IMU sample at a time, as on paper (E-104, E-105): the twin
of inertial/core/navigation/mechanise.cpp, which carries the Earth's terms to first order instead.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from inertial.earth import earth_rate, gravity, radii, transport_rate
from inertial.rotation import rotation_vector, turn_matrix

Array = NDArray[np.float64]


@dataclass
class State:
    """Position, velocity, attitude and biases, as the core's Nominal names them."""

    latitude: float = 0.0  # rad
    longitude: float = 0.0
    height: float = 0.0  # m
    v_n: Array = field(default_factory=lambda: np.zeros(3))
    C_nb: Array = field(default_factory=lambda: np.eye(3))
    bias_accel: Array = field(default_factory=lambda: np.zeros(3))
    bias_gyro: Array = field(default_factory=lambda: np.zeros(3))

    @property
    def place(self) -> tuple[float, float, float]:
        """Latitude and longitude in rad, height in m."""
        return self.latitude, self.longitude, self.height


def rates(x: State) -> tuple[Array, Array]:
    """omega_ie_n and omega_en_n, (3,) rad/s each."""
    ie = np.array(earth_rate(x.latitude))
    return ie, np.array(transport_rate(x.latitude, x.height, x.v_n[0], x.v_n[1]))


def moved(x: State, v_next: Array, dt: float) -> tuple[float, float, float]:
    """The place after dt s, by the mean of the velocities (E-105)."""
    v = 0.5 * (x.v_n + v_next)
    R_N, R_E = radii(x.latitude)
    latitude = x.latitude + v[0] * dt / (R_N + x.height)
    cosine = np.cos(0.5 * (x.latitude + latitude))
    longitude = x.longitude + v[1] * dt / ((R_E + x.height) * cosine)
    return latitude, longitude, x.height - v[2] * dt


def step(x: State, f_b: Array, omega_b: Array, dt: float) -> State:
    """The state after dt s with readings f_b and omega_b, (3,) each (E-105)."""
    ie, en = rates(x)
    turned = turn_matrix(-(ie + en) * dt) @ x.C_nb @ turn_matrix((omega_b - x.bias_gyro) * dt)
    f_n = 0.5 * (x.C_nb + turned) @ (f_b - x.bias_accel)
    g_n = np.array([0.0, 0.0, gravity(x.latitude, x.height)])
    v_n = x.v_n + dt * (f_n + g_n - np.cross(2.0 * ie + en, x.v_n))
    return State(*moved(x, v_n, dt), v_n, turned, x.bias_accel, x.bias_gyro)


def inverse_step(x: State, v_next: Array, C_next: Array, dt: float) -> tuple[Array, Array]:
    """Readings f_b and omega_b, (3,) each, with which step takes x to v_next (3,) and C_next (3, 3)
    exactly (E-105).
    """
    ie, en = rates(x)
    turn = rotation_vector(x.C_nb.T @ turn_matrix((ie + en) * dt) @ C_next)
    g_n = np.array([0.0, 0.0, gravity(x.latitude, x.height)])
    f_n = (v_next - x.v_n) / dt + np.cross(2.0 * ie + en, x.v_n) - g_n
    f_b = np.linalg.solve(0.5 * (x.C_nb + C_next), f_n)
    return f_b + x.bias_accel, turn / dt + x.bias_gyro
