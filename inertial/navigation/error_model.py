"""Error model of the strapdown mechanisation: its states and the noise that drives them. leg.py
carries it.

Error state (15,), error = computed - true, positions in metres:
    psi_n (3, rad)  dv_n (3, m/s)  dN dE dh (m)  B (3, m/s^2)  D (3, rad/s)
with C_true = Exp(psi) C_computed, B and D what is left of the biases after the current estimates.
Equations E-26 to E-31 of docs/equations-ins.md (inmotion-alignment, sections 3 to 5, metres form;
each entry is tested against finite differences of the mechanisation).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

STATES = 15
PSI, DV, DP, B, D = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 12), slice(12, 15)


@dataclass(frozen=True)
class ImuNoise:
    """Noise of a consumer IMU in a moving car, vibration included."""

    accel: float = 0.05  # m/s^2/sqrt(Hz)
    gyro: float = math.radians(0.1)  # rad/s/sqrt(Hz)
    sigma_bias_accel: float = 0.03  # m/s^2, Gauss-Markov
    sigma_bias_gyro: float = math.radians(0.05)  # rad/s, Gauss-Markov
    tau: float = 300.0  # s, of both
    # share of the readings' shaking from sample to sample that is noise to navigation (E-51)
    shake: float = 1.0
    position: float = 1e-3  # m/sqrt(s), keeps the position covariance from closing completely

    def vector(self) -> Array:
        """(17,): diagonal of the noise density G (15), then the two Gauss-Markov rates 1/tau."""
        a = 1.0 / self.tau
        psi, v, p = self.gyro**2, self.accel**2, self.position**2
        ba, bg = 2.0 * a * self.sigma_bias_accel**2, 2.0 * a * self.sigma_bias_gyro**2
        return np.array([psi] * 3 + [v] * 3 + [p] * 3 + [ba] * 3 + [bg] * 3 + [a, a])
