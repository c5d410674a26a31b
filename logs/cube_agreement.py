"""How well the axes of a log agree: what is left of their readings once every motion of a rigid
body is taken out, where a layout has more axes than the field has unknowns (E-4).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inertial.layouts.layout import RANK_TOLERANCE, Layout
from inertial.rate.observed import axis_noise

Array = NDArray[np.float64]

DISAGREE = 2.0  # times the noise; less is what a good calibration leaves


@dataclass(frozen=True)
class Agreement:
    """RMS of one axis' part that no motion explains, m/s^2; noise: of the layout."""

    noise: float
    still: float
    turning: float

    @property
    def sigma_axis(self) -> float:
        """Noise that the axes really have while the body turns, m/s^2."""
        return max(self.noise, self.turning)

    @property
    def text(self) -> str:
        """For people; empty where the axes agree."""
        if self.turning < DISAGREE * self.noise:
            return ""
        return (
            f"no motion of a rigid body explains {self.turning:.2f} m/s² RMS of each axis while it"
            f" turns, {self.turning / self.noise:.0f} times its noise ({self.still:.2f} m/s² at"
            " rest): sensors that do not sample together, a body that is not rigid, or positions"
            " and directions that are not these; the bound is that of this noise"
        )


def agreement(shape: Layout, f_axis: Array, turning: NDArray[np.bool_]) -> Agreement | None:
    """Of readings f_axis (n, N), m/s^2; turning (n,). None where every reading could be a motion,
    or nothing turns.
    """
    F = shape.field_matrix
    left, sigma, _ = np.linalg.svd(F / np.linalg.norm(F, axis=0).clip(1e-12))
    rank = int(np.sum(sigma > RANK_TOLERANCE * sigma.max()))
    if rank == shape.axes or not turning.any():
        return None
    rest = f_axis[~turning] if (~turning).any() else f_axis
    apart = (f_axis - np.median(rest, axis=0)) @ left[:, rank:]
    square = np.mean(apart**2, axis=1)
    still = float(np.sqrt(square[~turning].mean())) if (~turning).any() else 0.0
    return Agreement(axis_noise(shape), still, float(np.sqrt(square[turning].mean())))
