"""Samples with their unit, and the arithmetic of an expression: all that may be called in one."""

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from logs.figures.units import NONE, Unit, raised, spelt, times, unit

LARGEST = 1e100  # of a number in an expression
HIGHEST = 8  # power
FINEST = 12  # greatest denominator of a power
ANGLE = unit("°")
GIVE = ": give the curve a unit, if that is meant."


class ExpressionError(ValueError):
    """An expression that cannot be drawn; the text is a sentence for the person who typed it."""


@dataclass(frozen=True)
class Quantity:
    """Values (n,), or one number, in a unit; a bare number of the text goes with any unit.

    `why` is a sentence when the unit does not follow: what was put together has none in common. The
    person may give one, so that is no error here.
    """

    values: NDArray[np.float64] | float
    unit: Unit
    bare: bool = False
    why: str = ""


def as_quantity(value: object) -> Quantity:
    """A number of the text as a quantity, a quantity as it is."""
    return value if isinstance(value, Quantity) else Quantity(float(value), NONE, bare=True)  # type: ignore[arg-type]


def _why(*parts: Quantity) -> str:
    return next((part.why for part in parts if part.why), "")


def _together(what: str, *given: object) -> tuple[list[NDArray[np.float64] | float], Quantity]:
    """Values that are added or compared, and a quantity with the unit that they have in common."""
    parts = [as_quantity(value) for value in given]
    held = [part for part in parts if not part.bare]
    why = _why(*parts)
    for part in held[1:]:
        if part.unit != held[0].unit and not why:
            a, b = (spelt(one.unit) or "a plain number" for one in (held[0], part))
            why = f"{what} of {a} and {b} has no unit{GIVE}"
    common = NONE if why or not held else held[0].unit
    return [part.values for part in parts], Quantity(0.0, common, not held, why)


def _like(one: Quantity, values: NDArray[np.float64] | float) -> Quantity:
    return replace(one, values=values)


def add(a: object, b: object) -> Quantity:
    (x, y), common = _together("The sum", a, b)
    return _like(common, x + y)


def subtract(a: object, b: object) -> Quantity:
    (x, y), common = _together("The difference", a, b)
    return _like(common, x - y)


def negative(a: object) -> Quantity:
    one = as_quantity(a)
    return _like(one, -one.values)


def multiply(a: object, b: object) -> Quantity:
    x, y = as_quantity(a), as_quantity(b)
    product = x.values * y.values
    return Quantity(product, times(x.unit, y.unit), x.bare and y.bare, _why(x, y))


def divide(a: object, b: object) -> Quantity:
    x, y = as_quantity(a), as_quantity(b)
    ratio = np.divide(x.values, y.values)
    return Quantity(ratio, times(x.unit, y.unit, -1), x.bare and y.bare, _why(x, y))


def power(a: object, b: object) -> Quantity:
    x, y = as_quantity(a), as_quantity(b)
    if not y.bare:
        raise ExpressionError("A power is a number, not a channel: use exp and log for that.")
    exponent = float(y.values)
    if not abs(exponent) <= HIGHEST:
        raise ExpressionError(f"A power is at most {HIGHEST}.")
    raised_to = Fraction(exponent).limit_denominator(FINEST)
    return Quantity(np.power(x.values, exponent), raised(x.unit, raised_to), x.bare, x.why)


def norm(*given: object) -> Quantity:
    """Length of a vector by its components."""
    values, common = _together("The norm", *given)
    return _like(common, np.sqrt(sum(np.square(one) for one in values)))


def least(*given: object) -> Quantity:
    values, common = _together("The least", *given)
    return _like(common, functools.reduce(np.minimum, values))


def greatest(*given: object) -> Quantity:
    values, common = _together("The greatest", *given)
    return _like(common, functools.reduce(np.maximum, values))


def root(a: object) -> Quantity:
    return power(a, 0.5)


def absolute(a: object) -> Quantity:
    one = as_quantity(a)
    return _like(one, np.abs(one.values))


def sign(a: object) -> Quantity:
    one = as_quantity(a)
    return Quantity(np.sign(one.values), NONE, one.bare)


def mean(a: object) -> Quantity:
    """Mean of the samples drawn."""
    one = as_quantity(a)
    values = np.atleast_1d(one.values)
    good = values[np.isfinite(values)]
    return _like(one, float(np.mean(good)) if len(good) else np.nan)


def _of_angle(name: str, function: Callable) -> Callable[[object], Quantity]:
    def applied(a: object) -> Quantity:
        one = as_quantity(a)
        fits = one.unit in (NONE, ANGLE)
        why = one.why or ("" if fits else f"{name} wants an angle, not {spelt(one.unit)}{GIVE}")
        scale = np.pi / 180.0 if one.unit == ANGLE else 1.0  # a plain number is in radians
        return Quantity(function(scale * one.values), NONE, one.bare, why)

    return applied


def _of_number(name: str, function: Callable, result: Unit = NONE) -> Callable[[object], Quantity]:
    def applied(a: object) -> Quantity:
        one = as_quantity(a)
        odd = f"{name} wants a plain number, not {spelt(one.unit)}{GIVE}"
        why = one.why or (odd if one.unit != NONE else "")
        scale = 180.0 / np.pi if result == ANGLE else 1.0
        return Quantity(scale * function(one.values), result, one.bare and not result, why)

    return applied


def arctan2(a: object, b: object) -> Quantity:
    """Angle of the vector (b, a), degrees."""
    (x, y), common = _together("The angle", a, b)
    return Quantity(np.degrees(np.arctan2(x, y)), ANGLE, why=common.why)


FUNCTIONS: Mapping[str, Callable[..., Quantity]] = {
    "norm": norm,
    "abs": absolute,
    "sqrt": root,
    "min": least,
    "max": greatest,
    "mean": mean,
    "sign": sign,
    "sin": _of_angle("sin", np.sin),
    "cos": _of_angle("cos", np.cos),
    "tan": _of_angle("tan", np.tan),
    "asin": _of_number("asin", np.arcsin, ANGLE),
    "acos": _of_number("acos", np.arccos, ANGLE),
    "atan": _of_number("atan", np.arctan, ANGLE),
    "atan2": arctan2,
    "exp": _of_number("exp", np.exp),
    "log": _of_number("log", np.log),
}
ARGUMENTS = {name: (1, 1) for name in FUNCTIONS} | {
    "norm": (2, 12),
    "min": (2, 12),
    "max": (2, 12),
    "atan2": (2, 2),
}
HINTS = {
    "norm": "length of a vector by its components",
    "abs": "without its sign",
    "sqrt": "square root",
    "min": "the least of several",
    "max": "the greatest of several",
    "mean": "mean of the samples drawn, as in omega_z - mean(omega_z)",
    "sign": "−1, 0 or 1",
    "sin": "sine of an angle",
    "cos": "cosine of an angle",
    "tan": "tangent of an angle",
    "asin": "angle of a sine, °",
    "acos": "angle of a cosine, °",
    "atan": "angle of a tangent, °",
    "atan2": "angle of the vector (second, first), °",
    "exp": "exponential of a plain number",
    "log": "natural logarithm of a plain number",
}
