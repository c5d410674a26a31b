"""Does a filter know how wrong it is? Its errors squared, over what it believes of them (NIS)."""

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaincinv

Array = NDArray[np.float64]
FEWEST = 20  # corrections that a verdict takes
MATTERS = 0.25  # share by which NIS may be off its degrees of freedom
TOO_FEW, HONEST = "too few to judge", "honest"
TOO_SURE, TOO_CAREFUL = "too sure of itself", "too careful"


def nis_verdict(nis: Array, dof: Array | float) -> str:
    """What values of NIS (n,) with their degrees of freedom say of a filter, for people: beyond
    the band that chance leaves them, and by so much that it matters.
    """
    total = float(np.sum(np.broadcast_to(np.maximum(dof, 1), np.shape(nis))))
    if len(nis) < FEWEST:
        return TOO_FEW
    mean = float(np.sum(nis)) / total
    low, high = (2.0 * gammaincinv(0.5 * total, p) for p in (0.025, 0.975))  # of chi-square
    if mean > max(high / total, 1.0 + MATTERS):
        return TOO_SURE
    return TOO_CAREFUL if mean < min(low / total, 1.0 - MATTERS) else HONEST
