"""What is known of each component of omega: valid, ambiguous (sign unknown), blind (integration
only), and why (E-43).

blind      the products of one second would tell the component no better than BLIND_SIGMA, and what
integration
           has gathered since is worse than that too
ambiguous  omega and -omega fit the products, and the integral through zero does not tell them apart
"""

import numpy as np
from numpy.typing import NDArray

from inertial.rate.compiling import lean
from inertial.rate.observed import Sensor

Array = NDArray[np.float64]

VALID, AMBIGUOUS, BLIND = 0, 1, 2  # the values of RateEstimate.Sight
ALL_VALID, ALL_BLIND = (VALID,) * 3, (BLIND,) * 3
BLIND_SIGMA = 0.05  # rad/s
SURE = 9.0  # of omega^2 over the variance of its sign
DEG = 180.0 / np.pi


@lean
def information(w0: float, w1: float, w2: float, s: Sensor) -> tuple[float, float, float]:
    """Fisher information of one sample's products on each component of omega, (rad/s)^-2."""
    K = s.known
    x = 4.0 * w0 * w0 * K[0, 0] + w1 * w1 * K[1, 1] + w2 * w2 * K[2, 2]
    x += 2.0 * (2.0 * w0 * w1 * K[0, 1] + 2.0 * w0 * w2 * K[0, 2] + w1 * w2 * K[1, 2])
    y = w0 * w0 * K[1, 1] + 4.0 * w1 * w1 * K[3, 3] + w2 * w2 * K[4, 4]
    y += 2.0 * (2.0 * w0 * w1 * K[1, 3] + w0 * w2 * K[1, 4] + 2.0 * w1 * w2 * K[3, 4])
    z = w0 * w0 * K[2, 2] + w1 * w1 * K[4, 4] + 4.0 * w2 * w2 * K[5, 5]
    z += 2.0 * (w0 * w1 * K[2, 4] + 2.0 * w0 * w2 * K[2, 5] + 2.0 * w1 * w2 * K[4, 5])
    return x, y, z


@lean
def judge(
    omega: Array,
    variances: tuple[float, float, float],
    sign_variance: float,
    two: bool,
    s: Sensor,
    dt: float,
    out: Array,
) -> None:
    """out (3,) becomes VALID, AMBIGUOUS or BLIND by component of a turning body's omega (3,) with
    its variances.
    """
    known = information(omega[0], omega[1], omega[2], s)
    limit = dt / BLIND_SIGMA**2
    size = omega[0] ** 2 + omega[1] ** 2 + omega[2] ** 2
    lost = two or (
        size < SURE * sign_variance and (known[0] > limit or known[1] > limit or known[2] > limit)
    )
    for k in range(3):
        out[k] = VALID
        if lost and omega[k] ** 2 > SURE * variances[k]:
            out[k] = AMBIGUOUS
        elif not known[k] > limit and variances[k] > BLIND_SIGMA**2:
            out[k] = BLIND


def reason(
    sights: tuple[int, int, int], variances: Array, sign_variance: float, two: bool, size: float
) -> str:
    """Why, for people; empty when all components are valid. variances (3,) of omega, size of it,
    rad/s.
    """
    said = []
    if AMBIGUOUS in sights:
        began = f"began while turning, at {size * DEG:.0f} deg/s"
        said.append(f"sign unknown: {began if two else f'passed zero with {_deg(sign_variance)}'}")
    for k, axis in enumerate("xyz"):
        if sights[k] == BLIND:
            said.append(f"{axis}: integration only, now {_deg(variances[k])} uncertain")
    return "; ".join(said)


def _deg(variance: float) -> str:
    return f"{np.sqrt(variance) * DEG:.1f} deg/s"
