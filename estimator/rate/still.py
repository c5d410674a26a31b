"""Is the body still? And what do the axes read then?

Three questions on the newest samples (E-20 to E-22):
  spread    do the axes scatter more than their noise?               chi-square of N (window - 1) degrees
  quiet     do the mean angular acceleration and the mean products
            differ from those of the last standstill?                chi-square of their dimension, two windows
  rate      does the caller's rate exclude zero?                     waived after `patience_s` of the others
When biases have moved for good, `quiet` would fail for ever: it is waived after twice `patience_s` of the others.

A body that turns steadily below about 10 deg/s reads the same as one that stands: products are too small. The third
question is for that; none of them can help when the rate is wrong as well.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from estimator.layouts.layout import Layout

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Config:
    """Limits of the still detector."""

    sigma_axis: float = 0.0408  # m/s^2, one sample of one axis: 4 mg noise and 3.9 mg counts (ADXL345, 100 Hz)
    window: int = 25  # samples
    short_window: int = 8  # samples; notices the start of a turn sooner
    spread_limit: float = 1.45  # mean square scatter over sigma_axis^2: 5 sigma above 1 for 12 axes and 25 samples
    quiet_limit: float = 38.0  # chi-square, 9 degrees: once in 50 000 windows by chance
    rate_limit: float = 25.0  # chi-square, 3 degrees
    rate_slack: float = 0.03  # rad/s, added to the caller's sigma
    patience_s: float = 2.0  # s of stillness by the axes alone that outweigh the caller's rate
    drift: float = 0.02  # 1/s^2, sigma by which biases of the quiet quantities may have moved since


def quiet_map(layout: Layout) -> Array:
    """What must not move at rest, from the axes: omega' (3) and, where the layout sees them, the products (6)."""
    if layout.rank < 12:
        return layout.S[:3]
    return np.delete(layout.field_inverse, slice(3, 6), axis=0)


@njit(cache=True)
def _statistics(
    ring: Array, newest: int, quiet: Array, reference: Array, long_weight: Array, short_weight: Array, short: int
) -> tuple[float, float, float]:
    """Mean square scatter, and chi-squares of the quiet quantities over the whole ring and its newest samples."""
    window, axes = ring.shape
    mean, recent, scatter = np.zeros(axes), np.zeros(axes), 0.0
    for k in range(window):
        mean += ring[k] / window
    for k in range(window):
        for i in range(axes):
            scatter += (ring[k, i] - mean[i]) ** 2
    for k in range(1, short + 1):
        recent += ring[(newest - k) % window] / short
    off, off_recent = quiet @ mean - reference, quiet @ recent - reference
    long_square = np.sum(off * (long_weight @ off))
    return scatter / ((window - 1) * axes), long_square, np.sum(off_recent * (short_weight @ off_recent))


@njit(cache=True)
def _exclusion(omega_b: Array, P: Array, slack: float) -> float:
    """Chi-square of zero rate."""
    W = P + slack * np.eye(3)
    return np.sum(omega_b * np.linalg.solve(W, omega_b))


class StillDetector:
    """Ring of the newest samples; `update` answers for the newest. Deterministic, no time of day."""

    def __init__(self, axes: int, quiet_map: Array, config: Config = Config()) -> None:
        """quiet_map (m, axes): what must not move, angular acceleration and (where seen) products."""
        self.config = config
        self._map = np.ascontiguousarray(quiet_map)
        covariance = config.sigma_axis**2 * quiet_map @ quiet_map.T
        self._covariance = covariance
        self._long = self._weights(config.window, 0)
        self._short = self._weights(config.short_window, 0)
        self._ring = np.zeros((config.window, axes))
        self._filled = 0
        self._next = 0
        self._reference = np.zeros(len(quiet_map))
        self._reference_samples = 0
        self._quiet_for = self._slow_for = 0  # samples

    def forget(self) -> None:
        """After a gap: the window must fill anew; the reference of the last standstill stays."""
        self._filled = self._next = self._quiet_for = self._slow_for = 0

    def learn(self, mean_axis: Array, samples: int) -> None:
        """The mean (axes,) of `samples` readings of a standstill becomes the reference of `quiet`."""
        self._reference = self._map @ mean_axis
        self._reference_samples = samples
        self._long = self._weights(self.config.window, samples)
        self._short = self._weights(self.config.short_window, samples)

    def mean(self) -> Array:
        """Mean of the window, (axes,), m/s^2."""
        return self._ring.mean(axis=0)

    def update(self, f_axis: Array, omega_b: Array, P: Array, dt: float) -> bool:
        """True when still, by axis readings (N,), the caller's rate (3,) and its covariance (3, 3)."""
        c = self.config
        self._ring[self._next] = f_axis
        self._next = (self._next + 1) % c.window
        self._filled = min(self._filled + 1, c.window)
        scatter, long, short = _statistics(
            self._ring, self._next, self._map, self._reference, self._long, self._short, c.short_window
        )
        if self._filled < c.window or scatter > c.spread_limit * c.sigma_axis**2:
            self._quiet_for = self._slow_for = 0
            return False
        slow = _exclusion(omega_b, P, c.rate_slack**2) < c.rate_limit
        if self._reference_samples == 0 or max(long, short) <= c.quiet_limit:
            self._quiet_for, self._slow_for = self._quiet_for + 1, 0
            return bool(slow or self._quiet_for * dt >= c.patience_s)
        self._quiet_for, self._slow_for = 0, self._slow_for + 1 if slow else 0
        return bool(self._slow_for * dt >= 2.0 * c.patience_s)

    def _weights(self, n: int, reference_samples: int) -> Array:
        covariance = self._covariance / n + self.config.drift**2 * np.eye(len(self._covariance))
        if reference_samples:
            covariance = covariance + self._covariance / reference_samples
        return np.linalg.inv(covariance)


class Standstill:
    """Mean of the axes over the running standstill, without its last `guard` samples, which may already move."""

    def __init__(self, axes: int, guard: int) -> None:
        self._guard = guard
        self.held: list[Array] = []  # newest samples, not in the mean
        self._sum = np.zeros(axes)
        self.samples = 0

    def add(self, f_axis: Array) -> None:
        """One more sample of standstill."""
        self.held.append(f_axis)
        if len(self.held) > self._guard:
            self._sum += self.held.pop(0)
            self.samples += 1

    def clear(self) -> None:
        """The body moved."""
        self.held.clear()
        self._sum[:] = 0.0
        self.samples = 0

    def mean(self) -> Array:
        """(axes,), m/s^2; raises ValueError before any sample has passed the guard."""
        if self.samples == 0:
            raise ValueError(f"standstill of at most {self._guard} samples, want more: keep the body still longer")
        return self._sum / self.samples
