"""How far navigation without fixes goes astray: the closed form for a body at rest, level.

Equations E-85 and E-86 of docs/equations-gyro-free-navigation.md.
"""

import numpy as np
from numpy.typing import NDArray

from inertial.constants import GRAVITY

Array = NDArray[np.float64]


def position_error(b_mps2: Array, d_radps: Array, t_s: Array, g: float = GRAVITY) -> Array:
    """Position error (n, 3) in m of unaided navigation after t_s (n,) s from rest, level: the
    closed form (27) (E-85).

    b (3,) is the accelerometers' equivalent bias in n, d (3,) the equivalent drift of the rate.
    """
    t = np.asarray(t_s, dtype=np.float64)[:, None]
    return 0.5 * np.asarray(b_mps2) * t**2 + np.cross(d_radps, [0.0, 0.0, -g]) * t**3 / 6.0


def equivalent_drift(error_m: float, b_mps2: float, t_s: float, g: float = GRAVITY) -> float:
    """Rate drift in rad/s that by (27) gives a horizontal error after t_s s beside that of a bias
    (E-86).

    Both horizontal, as lengths; 0 where the bias alone explains more than the error.
    """
    return max(0.0, error_m - 0.5 * b_mps2 * t_s**2) * 6.0 / (g * t_s**3)
