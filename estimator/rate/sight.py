"""What is known of each component of omega: valid, ambiguous (sign unknown), blind (integration only), and why (E-43).

blind      the products of one second would tell the component no better than BLIND_SIGMA, and what integration
           has gathered since is worse than that too
ambiguous  omega and -omega fit the products, and the integral through zero does not tell them apart
"""

import numpy as np
from numpy.typing import NDArray

from estimator.rate.observed import Sensor
from estimator.rate.products_model import squares_jacobian

Array = NDArray[np.float64]

VALID, AMBIGUOUS, BLIND = 0, 1, 2  # the values of RateEstimate.Sight
BLIND_SIGMA = 0.05  # rad/s
SURE = 9.0  # of omega^2 over the variance of its sign
DEG = 180.0 / np.pi


def information(omega_b: Array, s: Sensor) -> Array:
    """Fisher information (3,) of one sample's products on each component of omega, (rad/s)^-2."""
    m = int(s["m"])
    if m == 0:
        return np.zeros(3)
    H = s["M"][:m] @ squares_jacobian(omega_b)
    return np.einsum("ki,ki->i", H, np.linalg.solve(s["R_c"][:m, :m], H))


def judge(omega_b: Array, P: Array, sign_variance: float, still: bool, two_signs: bool, s: Sensor, dt: float) -> tuple:
    """((x, y, z) of VALID, AMBIGUOUS, BLIND; reason for people, empty when all are valid)."""
    if still:
        return (VALID, VALID, VALID), ""
    informed = information(omega_b, s) / dt * BLIND_SIGMA**2 > 1.0
    sigma = np.sqrt(np.diag(P))
    size = float(omega_b @ omega_b)
    lost = two_signs or (size < SURE * sign_variance and bool(informed.any()))
    sights, reasons = [VALID] * 3, []
    for k, axis in enumerate("xyz"):
        if lost and omega_b[k] ** 2 > SURE * P[k, k]:
            sights[k] = AMBIGUOUS
        elif not informed[k] and sigma[k] > BLIND_SIGMA:
            sights[k] = BLIND
            reasons.append(f"{axis}: integration only, now {sigma[k] * DEG:.1f} deg/s uncertain")
    if AMBIGUOUS in sights:
        why = "began while turning" if two_signs else f"passed zero with {np.sqrt(sign_variance) * DEG:.1f} deg/s"
        reasons.insert(0, f"sign unknown: {why}")
    return tuple(sights), "; ".join(reasons)
