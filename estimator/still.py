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
from numpy.typing import NDArray

from estimator.layout import Layout

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


class StillDetector:
    """Ring of the newest samples; `update` answers for the newest. Deterministic, no time of day."""

    def __init__(self, axes: int, quiet_map: Array, config: Config = Config()) -> None:
        """quiet_map (m, axes): what must not move, angular acceleration and (where seen) products."""
        self.config = config
        self._map = np.ascontiguousarray(quiet_map)
        covariance = config.sigma_axis**2 * quiet_map @ quiet_map.T
        self._covariance = covariance
        self._weight = {n: self._weights(n, 0) for n in (config.window, config.short_window)}
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
        for n in self._weight:
            self._weight[n] = self._weights(n, samples)

    def mean(self) -> Array:
        """Mean of the window, (axes,), m/s^2."""
        return self._ring.mean(axis=0)

    def update(self, f_axis: Array, omega_b: Array, P: Array, dt: float) -> bool:
        """True when still, by axis readings (N,), the caller's rate (3,) and its covariance (3, 3)."""
        c = self.config
        self._ring[self._next] = f_axis
        self._next = (self._next + 1) % c.window
        self._filled = min(self._filled + 1, c.window)
        mean = self._ring.mean(axis=0)
        if self._filled < c.window or not self._spread_is_noise(mean):
            self._quiet_for = self._slow_for = 0
            return False
        W = P + c.rate_slack**2 * np.eye(3)
        slow = bool(omega_b @ np.linalg.solve(W, omega_b) < c.rate_limit)
        if self._is_quiet(mean):
            self._quiet_for, self._slow_for = self._quiet_for + 1, 0
            return slow or self._quiet_for * dt >= c.patience_s
        self._quiet_for, self._slow_for = 0, self._slow_for + 1 if slow else 0
        return self._slow_for * dt >= 2.0 * c.patience_s

    def _spread_is_noise(self, mean: Array) -> bool:
        c = self.config
        scatter = np.sum((self._ring - mean) ** 2)
        return bool(scatter <= c.spread_limit * (c.window - 1) * self._ring.shape[1] * c.sigma_axis**2)

    def _is_quiet(self, mean: Array) -> bool:
        c = self.config
        if self._reference_samples == 0:
            return True
        newest = self._ring[(self._next - 1 - np.arange(c.short_window)) % c.window].mean(axis=0)
        for n, value in ((c.window, mean), (c.short_window, newest)):
            off = self._map @ value - self._reference
            if off @ self._weight[n] @ off > c.quiet_limit:
                return False
        return True

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
