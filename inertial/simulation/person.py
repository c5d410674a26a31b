"""A person who turns a table by hand to a rate that is asked: late, past it and back, never quite
even; and who lets go for a moment, if told so.
"""

import numpy as np

LATE_S = (0.4, 1.0)  # until the hand begins
QUICK, DAMPING = 3.0, 0.5  # rad/s and share of the critical one: overshoots by a sixth
STRONG = np.radians(150.0)  # rad/s^2
UNEVEN, UNEVEN_HZ = 0.008, 0.7  # of the rate
SLIP_AFTER_S, SLIP_S, SLIP = 2.5, 0.7, 0.5  # at the rate for so long, then half of it for so long
STANDS = np.radians(1.0)  # rad/s; a hand stops what is slower
THERE = 0.03  # of the rate


class Person:
    """`slips`: how often he lets go while he should hold a rate."""

    def __init__(self, seed: int, slips: int = 0) -> None:
        self._draw = np.random.default_rng([seed, 51])
        self._slips = slips
        self._wanted, self._late_s = 0.0, 0.0
        self._rate, self._change = 0.0, 0.0
        self._held_s = self._t = 0.0

    def step(self, wanted: float, seconds: float) -> float:
        """The table's rate (rad/s) that many seconds later, while he is asked for `wanted`."""
        self._t += seconds
        if wanted != self._wanted:
            self._wanted, self._held_s = wanted, 0.0
            self._late_s = float(self._draw.uniform(*LATE_S))
        if self._late_s > 0.0:
            self._late_s -= seconds
            return self._rate
        aim = wanted * self._slip(seconds)
        self._change += (
            QUICK * (QUICK * (aim - self._rate) - 2.0 * DAMPING * self._change) * seconds
        )
        self._change = float(np.clip(self._change, -STRONG, STRONG))
        self._rate += self._change * seconds
        if wanted == 0.0 and abs(self._rate) < STANDS:
            self._rate = self._change = 0.0
        return self._rate * (1.0 + UNEVEN * np.sin(2.0 * np.pi * UNEVEN_HZ * self._t))

    def _slip(self, seconds: float) -> float:
        """Share of the rate that he holds now."""
        if not self._slips or self._wanted == 0.0:
            return 1.0
        there = abs(self._rate - self._wanted) < THERE * abs(self._wanted)
        if there or self._held_s > 0.0:
            self._held_s += seconds
        if self._held_s < SLIP_AFTER_S:
            return 1.0
        if self._held_s > SLIP_AFTER_S + SLIP_S:
            self._slips, self._held_s = self._slips - 1, 0.0
        return SLIP
