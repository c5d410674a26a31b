"""What an estimator says of its own rate, and what follows wherever it is shown: a value that it
does not vouch for is a word and no number, and counts in no mean (docs/estimators.md).
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]
Sight = NDArray[Any]  # (n,) of RateEstimate.Sight; NaN where nothing is said

WORDS = ("valid", "ambiguous", "blind")  # by RateEstimate.Sight


def word(sight: float) -> str:
    """`ambiguous` or `blind`, also for a number of a later version; empty where the value stands,
    or nothing is said.
    """
    return WORDS[min(int(sight), len(WORDS) - 1)] if sight > 0 else ""


def worst(sight: Sight | None) -> str:
    """The worst word of many; empty where all values stand."""
    unsure = sight[sight > 0] if sight is not None else ()
    return word(float(np.max(unsure))) if len(unsure) else ""


def vouched(values: Array, sight: Sight | None) -> Array:
    """Values (n,), NaN where the estimator does not vouch for them."""
    return values if sight is None else np.where(sight > 0, np.nan, values)
