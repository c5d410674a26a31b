"""The article behind the fixed-weight tilt filter: direction cosines and projection angles.

Equations E-70 and E-71 of docs/equations-attitude.md (Starlino's guide to accelerometer and
gyroscope devices). The article's frame a reads +1 g on z when the board lies level: x_a = x_b,
y_a = -y_b, z_a = -z_b for a forward-right-down body. R is the direction of the specific force, so
for a body at rest it points up. The filters, E-72 to E-76, are core/attitude/tilt.cpp.
"""

import numpy as np
from numpy.typing import NDArray

from inertial.elementary import atan2, norm

Array = NDArray[np.float64]

W_GYRO = 10.0  # the article's range is 5 to 20, found by experiment
TIME_CONSTANT = 3.5  # s, of the vector form: its weight is this over the sample period
ILL_CONDITIONED = 0.1  # |Rz| below which the projection angles are not used (E-74)


def direction_cosines(R_a: Array) -> Array:
    """cos of the angles between R (..., 3) and the axes; their squares sum to 1 (E-70)."""
    return R_a / norm(R_a)[..., None]


def projection_angles(R_a: Array) -> tuple[Array, Array]:
    """Axz and Ayz, rad: angles between z and R's projection on the xz and the yz plane (E-71)."""
    return atan2(R_a[..., 0], R_a[..., 2]), atan2(R_a[..., 1], R_a[..., 2])
