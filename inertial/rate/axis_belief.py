"""What the axis monitor believes of axes that are good: their noise, as it is measured, and how
far their calibration may be off, widened where readings show that it is (H-5, H-11, H-12).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inertial.core import native
from inertial.layouts.layout import Layout
from inertial.rate import parity
from inertial.rate.health_config import STANDSTILL, Config
from inertial.rate.products_ekf import BIAS

Array = NDArray[np.float64]


class Width(NamedTuple):
    """How far the calibration of good axes may be off; the usual one adds nothing."""

    offset: float = 1.0  # times what is expected
    scale: float = 0.0  # of 1: scale errors and directions of all axes

    def beyond(self, other: "Width") -> bool:
        """Wider in one way, and in none narrower."""
        return self != other and self.offset >= other.offset and self.scale >= other.scale

    @property
    def text(self) -> str:
        """For people; empty for the usual width."""
        found = []
        if self.scale:
            found.append(f"scales or directions off by about {100.0 * self.scale / 1.5:.0f} %")
        if self.offset > 1.0:
            found.append(f"offsets {self.offset:g} times the expected ones")
        return "all axes fit one motion only with " + " and ".join(found) if found else ""


FIRST_OFFSET = 2.5  # m/s^2, beyond which an axis at its first standstill is not believed
# Sigmas of an uncalibrated offset that the rate filters bear; beyond it they see a motion.
FIRST_SIGMAS = 3.2
USUAL = Width()
WIDER = tuple(Width(o, s) for o in (1.0, 3.0) for s in (0.0, 0.03, 0.06, 0.12))[1:]


class Belief:
    """Variances of the axes of one layout, as the parity filter wants them."""

    def __init__(self, layout: Layout, config: Config, per_block: int) -> None:
        """per_block: samples whose mean is one block."""
        self.config = config
        self.noise = layout.noise
        self.limits = np.array([sensor.limit for sensor in layout.sensors])
        self.free = projection(layout.J)
        self.width = USUAL
        self._per_block = per_block
        self._J, self._Q = np.ascontiguousarray(layout.J), np.ascontiguousarray(layout.Q)
        errors = np.array([sensor.scale_error for sensor in layout.sensors])
        self._theta = layout.theta_b
        self._uncalibrated = np.array([sensor.bias for sensor in layout.sensors])
        self._borne = np.maximum(self._uncalibrated, BIAS)
        self._scale = max(config.scale, config.scale_sigmas * float(errors.max()))
        sigma = config.offset_sigmas * self._uncalibrated
        n = layout.axes
        self.ratio = 1.0  # of the measured variance of the noise to the configured
        self.rounded = 0.0
        self.white = self.noise**2 / per_block
        self.offset = sigma**2
        self.bias, self.reference = np.zeros(n), np.zeros(n)
        self.learned = np.zeros(n, dtype=bool)

    def hear(self, ratio: float, rounded: float = 0.0) -> None:
        """The measured variance of the noise, over the configured one; what readings are rounded
        to, m/s^2, where that hides their noise: a mean of equal readings is no better than one.
        """
        if (ratio, rounded) != (self.ratio, self.rounded):
            self.ratio, self.rounded = ratio, rounded
            self.white = self.noise**2 * (ratio / self._per_block) + rounded**2 / 12.0

    def constants(self, width: Width | None = None) -> parity.Constants:
        """What is known of the axes, at this width or the present one."""
        offset = self.offset * (width or self.width).offset ** 2
        return parity.Constants(self._J, self._Q, self.bias, self.reference, self.white, offset)

    def tuning(self, width: Width | None = None) -> parity.Tuning:
        """How freely the body moves and how far scales may be off."""
        c, scale = self.config, (width or self.width).scale
        return parity.Tuning(c.sigma_alpha, c.sigma_force, max(self._scale, scale), scale)

    def credible(self, mean: Array, used: NDArray[np.bool_]) -> bool:
        """May good axes have the offsets that a standstill of these mean readings (N,) shows?"""
        return self._offsets(mean, used) is not None

    def _offsets(self, mean: Array, used: NDArray[np.bool_]) -> Array | None:
        """Offsets (N,) that a standstill of these mean readings (N,) shows; None where they are
        beyond belief. More is believed of axes that were never seen at rest.
        """
        off = parity.offsets_at_rest(self._theta, mean, used)
        allowed = self.constants().offset + self.white + (self.tuning().scale * 9.8) ** 2 * 0.1
        most = 20.0 * allowed
        if not self.learned.any():
            most = np.maximum(most, np.minimum(9.0 * most, FIRST_OFFSET**2))
        return None if np.any((off - self.bias)[used] ** 2 > most[used]) else off

    def far_off(self, mean: Array, used: NDArray[np.bool_]) -> dict[int, float]:
        """The used axes whose offset at a first standstill of these mean readings (N,) is beyond
        what the rate filters bear, and that offset, m/s^2; none where they are so many that the
        others cannot tell (H-13).
        """
        rest, found = used.copy(), {}
        while np.count_nonzero(rest) > 6:
            off = parity.offsets_at_rest(self._theta, mean, rest)
            apart = np.diag(projection(self._theta[rest])).clip(1e-12)  # what is not taken for p
            sigmas = np.abs(off[rest]) / (self._borne[rest] * np.sqrt(apart))
            worst = int(np.argmax(sigmas))
            if sigmas[worst] <= FIRST_SIGMAS:
                break
            axis = int(np.flatnonzero(rest)[worst])
            rest[axis] = False
            found[axis] = 0.0
        if len(found) > len(used) // 6:
            return {}
        off = parity.offsets_at_rest(self._theta, mean, rest)
        return {axis: float(off[axis]) for axis in found}

    def steady(self, window: Array, used: NDArray[np.bool_]) -> bool:
        """Does nothing but noise change over blocks (n, N)? Vibration shakes all axes alike and is
        taken for noise; the mean may not wander beyond it.
        """
        if len(window) < 4:
            return True
        mean = window.mean(axis=0)
        apart = window - mean
        alone = native.product(np.ascontiguousarray(apart), self.free)[:, used]
        if np.mean(alone**2 / self.white[used]) > 1.5 * np.mean(np.diag(self.free)[used]):
            return False
        half = len(window) // 2
        trend = np.abs(window[:half].mean(axis=0) - window[half:].mean(axis=0))[used]
        noise = np.maximum(self.white, np.mean(np.diff(window, axis=0) ** 2, axis=0) / 2.0)
        return not np.any(trend > 6.0 * np.sqrt(4.0 * noise[used] / len(window)))

    def standing(self, blocks: list[Array], used: NDArray[np.bool_]) -> Array | None:
        """Mean readings (N,) of the newest blocks; None where these are not of a standstill."""
        window = np.array(blocks[-STANDSTILL:])
        return window.mean(axis=0) if self.steady(window, used) else None

    def learn(self, mean: Array, used: NDArray[np.bool_]) -> bool:
        """Offsets of the used axes at a standstill of these mean readings (N,); False where they
        are beyond belief.
        """
        off = self._offsets(mean, used)
        if off is None:
            return False
        self.bias = np.where(used, off, self.bias)
        self.reference = np.where(used, mean, self.reference)
        self.offset = np.where(used, self.config.offset_left**2, self.offset)
        self.learned = self.learned | used
        return True


def projection(J: Array) -> Array:
    """(N, N) onto readings that no angular acceleration and specific force make; J (N, 6)."""
    left, sigma, _ = native.svd(np.ascontiguousarray(J / np.linalg.norm(J, axis=0).clip(1e-12)))
    seen = np.ascontiguousarray(left[:, sigma > 1e-6 * sigma.max(initial=1e-12)])
    return np.eye(len(J)) - native.product(seen, np.ascontiguousarray(seen.T))
