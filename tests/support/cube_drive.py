"""The cube in a car: readings of its axes along a simulated drive, and the fixes of a receiver
beside it.
"""

import numpy as np
from numpy.typing import NDArray

from inertial.layouts.layout import Layout
from inertial.simulation.drive import SimulatedDrive
from inertial.simulation.table import SensorModel

Array = NDArray[np.float64]


def cube_readings(drive: SimulatedDrive, layout: Layout, sensor: SensorModel, seed: int) -> Array:
    """Readings (n, axes) in m/s^2 of a layout whose centre is the drive's IMU, from its truth; b as
    of the drive.

    f(r) = f + alpha x r + omega x (omega x r), alpha by differences of the true rate.
    """
    truth = drive.truth
    omega = truth.omega_ib_b[1:]
    alpha = np.gradient(omega, drive.truth.t[1:], axis=0)
    r = layout.r_b[None, :, :]
    w, a = omega[:, None, :], alpha[:, None, :]
    felt = truth.f_b[1:, None, :] + np.cross(a, r) + np.cross(w, np.cross(w, r))
    ideal = np.einsum("tki,ki->tk", felt, layout.theta_b)
    draw = np.random.default_rng([seed, 30])
    bias = draw.normal(size=layout.axes) * sensor.bias
    scale = 1.0 + draw.normal(size=layout.axes) * sensor.scale_error
    read = ideal * scale + bias + draw.normal(size=ideal.shape) * sensor.noise
    return np.rint(read / sensor.count) * sensor.count if sensor.count else read
