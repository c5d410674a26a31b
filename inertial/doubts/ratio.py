"""The tachometer over the rate of the axes is one number at every rate: pulses per revolution or
the half side is wrong, and a ramp tells which.

With s the true half side over the one that is set, the axes' products show omega sqrt(s) and their
angular acceleration shows omega' s (E-4). So its integral over a ramp is sqrt(s) times the rate of
the products, whatever the tachometer says; where it is not, the tachometer is the wrong one.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inertial.layouts.layout import Layout
from inertial.plausible import Doubt

Array = NDArray[np.float64]

LEAST = 0.06  # of the logarithm of the ratio; what an uncalibrated cube is off by stays below
ENOUGH = 6  # steady windows ...
STRETCHES = 2  # ... of so many plateaus
SCATTER = 0.03  # of the logarithm among plateaus: what is not one number is no setting
ONE_WAY = 0.07  # sigma of the logarithm of ramps one way round: directions 10 mrad off act with it
BOTH_WAYS = 0.025  # ... and of the mean of both ways, in which that drops out
SIGMAS = 3.0


@dataclass(frozen=True, eq=False)
class Steady:
    """A window at a steady rate."""

    stretch: int  # which plateau
    mean: Array  # (N,) m/s^2
    rest: Array  # (N,) m/s^2, before it
    tacho: float  # rad/s, without sign
    square: float  # rad^2/s^2, of the products over those at rest


@dataclass(frozen=True, eq=False)
class Ramp:
    """From rest to a plateau."""

    turned: Array  # (N,) m/s, readings over those at rest, integrated
    steady: Array  # (N,) m/s^2, those of the plateau's first window


def doubt_of_ratio(
    layout: Layout,
    steady: Sequence[Steady],
    ramps: Sequence[Ramp],
    pulses: int | None,
    live: bool = True,
) -> Doubt | None:
    """What would fit, where plateaus agree on a ratio that is not 1; pulses: per revolution, as set
    or None where nobody knows.
    """
    ratio = agreed(steady)
    if ratio is None:
        return None
    log_axes = -math.log(ratio)  # of the products' rate over the tachometer's
    by_ramp, sigma = _of_ramps(layout, ramps)
    of_side, of_pulses = abs(by_ramp - log_axes), abs(by_ramp)
    told = sigma is not None and max(of_side, of_pulses) > SIGMAS * max(
        sigma, min(of_side, of_pulses)
    )
    said = []
    if not told or of_pulses < of_side:
        said.append(_pulses(ratio, pulses))
    if not told or of_side < of_pulses:
        said.append(_side(layout, ratio, live))
    return Doubt("ratio", f"tachometer over estimate = {ratio:.3g} at every rate: " + _or(said))


def agreed(steady: Sequence[Steady]) -> float | None:
    """The ratio of the tachometer to the axes; None where it is 1, unsure, or not one number."""
    by_stretch: dict[int, list[float]] = {}
    for window in steady:
        if window.square <= 0.0:
            return None
        log = math.log(window.tacho) - 0.5 * math.log(window.square)
        by_stretch.setdefault(window.stretch, []).append(log)
    if len(by_stretch) < STRETCHES or sum(map(len, by_stretch.values())) < ENOUGH:
        return None
    means = [float(np.mean(logs)) for logs in by_stretch.values()]
    middle, scatter = float(np.median(means)), float(np.std(means))
    sigma = scatter / math.sqrt(len(means) - 1.0)
    if scatter > max(SCATTER, 0.05 * abs(middle)) or abs(middle) < LEAST + SIGMAS * sigma:
        return None
    return math.exp(middle)


def _of_ramps(layout: Layout, ramps: Sequence[Ramp]) -> tuple[float, float | None]:
    """Logarithm of the integral over the products, with its sigma; None without a ramp."""
    if not ramps:
        return 0.0, None
    ways: dict[bool, list[float]] = {}
    alpha, squares = layout.field_inverse[:3], layout.field_inverse[[6, 9, 11]].sum(axis=0)
    first_b = alpha @ ramps[0].turned
    for ramp in ramps:
        turned_b, square = alpha @ ramp.turned, float(squares @ ramp.steady)
        size = max(float(np.linalg.norm(turned_b)), 1e-6)
        ways.setdefault(bool(turned_b @ first_b > 0.0), []).append(
            math.log(size) - 0.5 * math.log(max(square, 1e-6))
        )
    middle = float(np.mean([np.median(logs) for logs in ways.values()]))
    return middle, BOTH_WAYS if len(ways) == 2 else ONE_WAY


def _pulses(ratio: float, pulses: int | None) -> str:
    if pulses is None:
        return f"check pulses per revolution: {ratio:.3g} times as many would fit"
    fits = pulses * ratio
    near = round(fits)
    if near < 1:
        return f"check pulses per revolution: set {pulses}, and less than one would fit"
    return f"check pulses per revolution: {near} would fit, {pulses} is set"


def _side(layout: Layout, ratio: float, live: bool) -> str:
    fits, now = 1e3 * layout.scale_m / ratio**2, 1e3 * layout.scale_m
    where = "half_side_m" if live else "--half-side"
    value = f"{1e-3 * fits:.3g}"
    return f"check the half side: {fits:.3g} mm would fit, {now:.3g} is set ({where} {value})"


def _or(said: Sequence[str]) -> str:
    """More than one: the ramps have not told which."""
    if len(said) == 1:
        return said[0]
    return f"{'; or '.join(said)}; starts from rest, both ways round, tell which"
