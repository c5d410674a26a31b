"""State of one accelerometer axis, and the evidence for taking it back."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from inertial.rate import parity

Array = NDArray[np.float64]


class AxisState(IntEnum):
    """Values of the bus contract's AxisHealth.State."""

    GOOD = 0
    STUCK = 1
    SATURATED = 2
    SWAPPED = 3
    FLIPPED = 4
    SPIKING = 5
    BIASED = 6
    STALE = 7
    SUSPECT = 8


def axis_word(state: int, excluded: bool) -> str:
    """A state as people read it; an axis that is only looked into is good."""
    good = state == AxisState.GOOD or (state == AxisState.SUSPECT and not excluded)
    return "good" if good else AxisState(state).name.lower()


@dataclass
class Fault:
    """What is known of one axis; GOOD axes have one too."""

    state: AxisState = AxisState.GOOD
    excluded: bool = False
    since_s: float = 0.0  # board's clock
    text: str = ""
    kind: int = parity.NONE
    partner: int = -1
    offset: float = 0.0
    evidence: float = 0.0
    fits: int = 0  # blocks in a row
    relapses: int = 0
    ended_s: float = -np.inf

    @property
    def word(self) -> str:
        """The state as people read it; an axis that is only looked into is good."""
        return axis_word(self.state, self.excluded)

    def favours_good(
        self, i: int, block: Array, bias: Array, reference: Array, residual: float, sigma: float
    ) -> float:
        """-2 log likelihood ratio of one block (N,) for "axis i is good" against this fault, -10 to
        10 (H-10).
        """
        if self.kind == parity.IGNORE:
            return 10.0
        if self.kind == parity.OFFSET_OF:
            other = residual - self.offset
        else:
            j = self.partner if self.partner >= 0 else i
            other = (
                residual
                + parity.altered(block, bias, reference, self.kind, i, j)[i]
                - (block[i] - bias[i])
            )
        return float(np.clip((other**2 - residual**2) / sigma**2, -10.0, 10.0))
