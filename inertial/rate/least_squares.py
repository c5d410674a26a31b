"""The paper's way: angular acceleration by least squares, Runge-Kutta to rate and angle.

    [omega'; p] = S (a - q(omega))                                                           (E-3)

Biases come from the standstill at the start, after which nothing corrects the integral any more:
its error is what the other estimators are measured against. Works with every layout that sees
omega' and p (rank 6). What is done at each sample: inertial/core/rate/least_squares.cpp.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inertial.core import native
from inertial.layouts.layout import Layout
from inertial.rate import still as stillness
from inertial.rate.observed import sensor
from inertial.rate.rows import Rows, after

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Config:
    """Settings of the estimator."""

    still: stillness.Config = field(default_factory=stillness.Config)
    shortest_standstill: int = 100  # samples that biases need
    longest_step_s: float = 0.5  # s; a longer silence is a gap


class LeastSquares:
    """Memory and constants of the estimator for one layout."""

    def __init__(self, layout: Layout, config: Config = Config(), excluded: int = 0) -> None:
        """Raises GeometryError when the layout cannot see omega' and p."""
        self.layout, self.config, self.excluded = layout, config, excluded
        self.sensor = sensor(layout, config.still.sigma_axis, excluded)
        limits = native.RateLeastSquaresLimits()
        limits.still = stillness.limits(config.still)
        limits.shortest_standstill = config.shortest_standstill
        limits.longest_step_s = config.longest_step_s
        self.native = native.RateLeastSquares(self.sensor, limits)

    def __getstate__(self) -> tuple[Any, ...]:
        return self.layout, self.config, self.excluded, self.native.snapshot()

    def __setstate__(self, state: tuple[Any, ...]) -> None:
        *made_of, image = state
        LeastSquares.__init__(self, *made_of)
        self.native.restore(image)

    def rows(self, t_s: Array, f_axis: Array) -> Rows:
        """Samples (n, N), m/s^2, at t_s (n,), s, both checked: a row after each. A long silence
        starts anew.
        """
        return after(self.native, t_s, f_axis)

    def gap(self) -> None:
        """Samples are missing: the next step integrates across, with omega' linear in between."""
        self.native.gap()

    def exclude(self, mask: int) -> None:
        """Go on without some axes: what their biases were in the sum is not known, so the bias of
        the rest stays.

        Raises GeometryError when the rest does not see omega' and p.
        """
        if mask != self.excluded:
            self.sensor = sensor(self.layout, self.config.still.sigma_axis, mask)
            self.excluded = mask
            self.native.exclude(self.sensor)
