"""Error model of the strapdown mechanisation: its states and the noise that drives them.

Error state, error = computed - true, positions in metres, with its segments:
    psi_n (3, rad)  dv_n (3, m/s)  dN dE dh (m)  B (3, m/s^2)  D (3, rad/s)
with C_true = Exp(psi) C_computed, B and D what is left of the biases after the current estimates.
Further states stand at the end where a filter asks for them. Equations E-106 to E-111 of
docs/equations-ins.md; inertial/core/navigation/ carries them, and each entry is tested against
finite differences of the mechanisation.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inertial.core import navigation as core

Array = NDArray[np.float64]

STATES = 15
PSI, DV, DP, B, D = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 12), slice(12, 15)
TILT = slice(0, 2)

SCALE = {"scale_accel": 3, "scale_gyro": 3}
LAG = {"lag_position": 1, "lag_velocity": 1}
CAR = {"mount_pitch": 1, "mount_yaw": 1, "axle": 1}


@dataclass(frozen=True)
class ImuNoise:
    """Noise of a consumer IMU in a moving car, vibration included."""

    accel: float = 0.05  # m/s^2/sqrt(Hz)
    gyro: float = math.radians(0.1)  # rad/s/sqrt(Hz)
    sigma_bias_accel: float = 0.03  # m/s^2, Gauss-Markov
    sigma_bias_gyro: float = math.radians(0.05)  # rad/s, Gauss-Markov
    tau: float = 300.0  # s, of both
    # share of the readings' shaking from sample to sample that is noise to navigation (E-131)
    shake: float = 1.0
    turn: float = 0.007  # of 1, scale and cross-axis errors of the gyros (E-139)
    cross: float = 0.005  # of 1, cross-axis errors alone: where scale errors are states
    axes: float = 0.007  # rad, of the sensors' axes against one another (E-142)
    turn_length: float = 5.0  # s, over which a turn keeps its direction
    position: float = 1e-3  # m/sqrt(s), keeps the position covariance from closing completely

    def density(self) -> Array:
        """(15,): diagonal of the noise density G (E-109)."""
        psi, v, p = self.gyro**2, self.accel**2, self.position**2
        ba = 2.0 / self.tau * self.sigma_bias_accel**2
        bg = 2.0 / self.tau * self.sigma_bias_gyro**2
        return np.repeat([psi, v, p, ba, bg], 3)

    def decay(self) -> Array:
        """(15,) 1/s: attitude, velocity and position do not, biases do."""
        rate = 1.0 / self.tau
        return np.repeat([0.0, 0.0, 0.0, rate, rate], 3)


def make_model(noise: ImuNoise, scale: bool = False, lag: bool = False, car: bool = False) -> Any:
    """The core's Model of a filter; options as in FilterConfig. Further states are constants."""
    segments: dict[str, int] = {}
    for wanted, more in ((scale, SCALE), (lag, LAG), (car, CAR)):
        segments.update(more if wanted else {})
    places, states = {}, STATES
    for name, size in segments.items():
        places[name] = states
        states += size
    extra = np.zeros(states - STATES)
    return core.Model(
        states=states,
        density=np.concatenate([noise.density(), extra]),
        decay=np.concatenate([noise.decay(), extra]),
        shake=noise.shake,
        axes=noise.axes,
        turn=(noise.cross if scale else noise.turn) ** 2 * noise.turn_length,
        **places,
    )
