"""What is known of each component of omega: valid, ambiguous (sign unknown), blind (integration
only), and why (E-43).

blind      the products of one second would tell the component no better than BLIND_SIGMA, and what
integration
           has gathered since is worse than that too
ambiguous  omega and -omega fit the products, and the integral through zero does not tell them apart
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

VALID, AMBIGUOUS, BLIND = 0, 1, 2  # the values of RateEstimate.Sight
ALL_VALID, ALL_BLIND = (VALID,) * 3, (BLIND,) * 3
BLIND_SIGMA = 0.05  # rad/s
DEG = 180.0 / np.pi

DOUBTS = (
    "",
    "turning about a vertical axis or standing with large biases: not told apart yet",
    "the innovations contradict the estimate",
    "no usable data: axes at the end of their range, frozen or stale",
    "this estimator has no noise model: how far it may be off is not known while it turns",
)
"""Why nothing of an estimate is valid, for people, by the number that the core says (Doubt)."""


def reason(
    sights: tuple[int, int, int], variances: Array, sign_variance: float, two: bool, size: float
) -> str:
    """Why, for people; empty when all components are valid. variances (3,) of omega, size of it,
    rad/s.
    """
    said = []
    if AMBIGUOUS in sights:
        began = f"began while turning, at {size * DEG:.0f} °/s"
        said.append(f"sign unknown: {began if two else f'passed zero with {_deg(sign_variance)}'}")
    for k, axis in enumerate("xyz"):
        if sights[k] == BLIND:
            said.append(f"{axis}: integration only, now {_deg(variances[k])} uncertain")
    return "; ".join(said)


def _deg(variance: float) -> str:
    return f"{np.sqrt(variance) * DEG:.1f} °/s"
