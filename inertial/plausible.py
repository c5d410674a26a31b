"""Are the numbers what their units say? Gravity at rest, the period, the size of a rate.

A log in another unit looks like a log: its rates are wrong by a factor and nothing crashes. Three
things are known of every board, wherever it stands: at rest it reads one g, it samples more often
than four times a second, and gravity turns in the body as the gyroscope says. What contradicts them
is said in a sentence that names the likely unit. SI throughout.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inertial.constants import GRAVITY

Array = NDArray[np.float64]

WINDOW = 25  # samples of a quiet window
QUIETEST = 0.05  # share of the windows that stand for rest: the quietest ones
FAR = 0.12  # relative error of one g that no bias explains
NEAR = 0.06  # relative distance at which a factor is named
LONGEST_PERIOD_S = 0.25  # the slowest output rate of an ADXL345 is 6.25 Hz
SHORTEST_PERIOD_S = 2e-5
FROZEN = 100  # samples of a log in which no axis ever changes by a count
REVERSED = 1.0  # rad^2/s^2, of a squared rate below zero that no noise explains
TURNING = 0.02  # rad, of gravity over a window; less tells nothing of a rate's unit
ALIKE = 0.7  # correlation of both turns, below which acceleration rules
FASTEST_GYRO = 70.0  # rad/s, 4000 deg/s: beyond what such gyroscopes measure
ADXL345_MG = {
    3.9: "full resolution",
    7.8: "10 bit at 4 g",
    15.6: "10 bit at 8 g",
    31.2: "10 bit at 16 g",
}


@dataclass(frozen=True)
class Doubt:
    """A number that contradicts what is known."""

    subject: str  # "time", "gravity", "rate"
    text: str  # what was found, what was wanted, what to do


def doubt_of_time(period_s: float, name: str = "t_s") -> Doubt | None:
    """Is a period between samples one of seconds?"""
    if SHORTEST_PERIOD_S <= period_s <= LONGEST_PERIOD_S:
        return None
    if period_s < SHORTEST_PERIOD_S:
        return Doubt("time", f"{name}: {period_s:.3g} s between samples; want seconds")
    for unit, size in (("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)):
        if SHORTEST_PERIOD_S <= period_s * size <= 1.0:
            hertz = 1.0 / (period_s * size)
            return Doubt(
                "time",
                f"{name}: {period_s:.4g} s between samples; in {unit} it would be {hertz:.4g} Hz:"
                f" name the column t_{unit}, or divide it by {1.0 / size:.0f}",
            )
    return Doubt("time", f"{name}: {period_s:.4g} s between samples; want seconds, below 0.25")


def quiet_mean(values: Array, window: int = WINDOW) -> Array:
    """Mean (k, m) of values (n, m) over windows, the quietest first; k >= 1."""
    n = max(1, len(values) // window)
    parts = (
        values[: n * window].reshape(n, -1, values.shape[1])
        if len(values) >= window
        else (values[None])
    )
    scatter = parts.var(axis=1).sum(axis=1)
    order = np.argsort(scatter, kind="stable")[: max(1, int(np.ceil(QUIETEST * n)))]
    return parts[order].mean(axis=1)


def doubt_of_gravity(f_b: Array, lsb_mg: float | None = None, live: bool = False) -> Doubt | None:
    """Does a body at rest read one g? f_b (n, 3) is the specific force of its centre, m/s^2.

    lsb_mg is what a count was taken for, where the log has counts. live: of a board, whose scale is
    to be mended and not a log's columns.
    """
    size = float(np.median(np.linalg.norm(f_b if live else quiet_mean(f_b), axis=1)))
    ratio = size / GRAVITY
    if abs(ratio - 1.0) <= FAR:
        return None
    found = f"at its quietest the body reads {size:.3g} m/s^2, {ratio:.3g} g; want 1 g"
    if lsb_mg is not None and ratio > 0.0:
        fits = lsb_mg / ratio
        mode = next((mg for mg in ADXL345_MG if abs(fits / mg - 1.0) < NEAR), None)
        named = "" if mode is None else f" ({ADXL345_MG[mode]})"
        fits = fits if mode is None else mode
        return Doubt(
            "gravity", f"{found}: {fits:.3g} mg per count would fit{named}; say --lsb-mg {fits:.3g}"
        )
    g, mps2, mg = _REMEDIES[live]
    if abs(ratio * GRAVITY - 1.0) <= FAR:
        return Doubt("gravity", f"{found}: {g}")
    if abs(ratio / GRAVITY - 1.0) <= FAR:
        return Doubt("gravity", f"{found}: {mps2}")
    if abs(ratio * 1e-3 - 1.0) <= FAR or abs(ratio * 1e-3 * GRAVITY - 1.0) <= FAR:
        return Doubt("gravity", f"{found}: {mg}")
    if live and ratio > 0.0:
        return Doubt(
            "gravity", f"{found}: counts or g? {1.0 / ratio:.3g} times the scale would fit"
        )
    return Doubt("gravity", f"{found}: check the unit and the scale of the axes")


# By whether it is a board: what to do about g for m/s^2, m/s^2 for g, mg.
_REMEDIES = {
    False: (
        "these are g, not m/s^2; name the columns _g",
        "m/s^2 was taken for g; name the columns _mps2",
        "these look like mg; name the columns _mg",
    ),
    True: (
        "counts or g? the board sends g as m/s^2; 9.81 times its scale would fit",
        "counts or g? the board's m/s^2 are taken for g; its scale over 9.81 would fit",
        "counts or g? the board sends mg; a thousandth of its scale would fit",
    ),
}


def doubt_of_frozen(values: Array) -> Doubt | None:
    """Does anything ever change? values (n, m) as read; a real sensor has noise."""
    if len(values) < FROZEN or np.any(values != values[0]):
        return None
    return Doubt(
        "frozen",
        f"all {values.shape[1]} columns read the same in all {len(values)} samples: frozen or stale"
        " data, which say nothing of a rate; check the logger",
    )


def doubt_of_sense(square: Array) -> Doubt | None:
    """Is the squared rate (n,), rad^2/s^2, that the axes show below zero where the body turns?

    Against the log's beginning, which is at rest: offsets of the axes drop out.
    """
    n = len(square) // WINDOW
    if n < 4:
        return None
    mean = square[: n * WINDOW].reshape(n, WINDOW).mean(axis=1)
    mean = mean - mean[0]
    steps = np.abs(np.diff(square))
    noise = 1.05 * float(np.median(steps)) / math.sqrt(WINDOW)  # one sigma of a window
    low, high = (float(q) for q in np.quantile(mean, [0.05, 0.95]))
    if -low < max(REVERSED, 6.0 * noise) or high > -0.25 * low:
        return None
    return Doubt(
        "sense",
        f"the squared rate that the axes show falls by {-low:.3g} rad^2/s^2 from the log's"
        " beginning and hardly rises, which no rotation from rest does: axes of the wrong sign,"
        " turned or mixed sensors, or a log that begins while turning; do not trust its rates",
    )


def doubt_of_rate(t_s: Array, f_b: Array, omega_b: Array) -> Doubt | None:
    """Does gravity turn in the body as the gyroscope says? t_s (n,) s, f_b and omega_b (n, 3)."""
    largest = float(np.abs(omega_b).max()) if len(omega_b) else 0.0
    factor = rate_factor(t_s, f_b, omega_b)
    if factor is not None and abs(factor * 180.0 / math.pi - 1.0) < 0.25:
        return Doubt(
            "rate",
            f"gravity turns {1.0 / factor:.0f} times slower than the rate says (largest"
            f" {largest:.0f} rad/s): these are deg/s; name the columns _degps",
        )
    if factor is not None and abs(factor * math.pi / 180.0 - 1.0) < 0.25:
        return Doubt(
            "rate",
            f"gravity turns {factor:.0f} times faster than the rate says: rad/s was taken for"
            " deg/s; name the columns _radps",
        )
    if largest > FASTEST_GYRO:
        return Doubt(
            "rate",
            f"rates up to {largest:.0f} rad/s ({math.degrees(largest):.0f} deg/s); want below"
            f" {FASTEST_GYRO:.0f}: are these deg/s? name the columns _degps",
        )
    return None


def rate_factor(t_s: Array, f_b: Array, omega_b: Array) -> float | None:
    """How fast gravity really turns in the body over how fast omega_b says; None where it hardly
    turns. Least squares over windows of u' = u x omega, u the direction of the specific force.
    """
    n = len(t_s) // WINDOW
    if n < 4:
        return None
    shape = (n, WINDOW, 3)
    u = f_b[: n * WINDOW].reshape(shape).mean(axis=1)
    size = np.linalg.norm(u, axis=1)
    steady = np.abs(size[1:] - size[:-1]) < 0.05 * np.median(size)
    u = u / np.maximum(size, 1e-9)[:, None]
    omega = omega_b[: n * WINDOW].reshape(shape).mean(axis=1)
    seconds = np.diff(t_s[: n * WINDOW].reshape(n, WINDOW).mean(axis=1))
    turned = u[1:] - u[:-1]
    middle, rate = 0.5 * (u[1:] + u[:-1]), 0.5 * (omega[1:] + omega[:-1])
    told = np.cross(middle, rate) * seconds[:, None]
    use = (
        steady & (np.linalg.norm(turned, axis=1) > TURNING) & (np.linalg.norm(turned, axis=1) < 0.7)
    )
    along = float((told[use] * turned[use]).sum())
    told_size, size = float((told[use] ** 2).sum()), float((turned[use] ** 2).sum())
    if use.sum() < 4 or along <= ALIKE * math.sqrt(told_size * size):
        return None
    # total least squares would be fairer; the answer wanted is 1 or 57
    return size / along
