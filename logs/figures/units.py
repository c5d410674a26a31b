"""Units as products of powers of symbols, so that an expression over curves tells its own."""

from collections.abc import Mapping
from fractions import Fraction

Unit = Mapping[str, Fraction]  # symbol -> power; empty: a plain number

NONE: Unit = {}
RAISED = str.maketrans("0123456789-/", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻ᐟ")
LOWERED = {ord(raised): plain for plain, raised in zip("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻", strict=True)}


def unit(text: str) -> Unit:
    """A unit as it is written on charts: `m/s²`, `°/s`, `m·s`; what stands behind the first stroke
    divides.
    """
    found: dict[str, Fraction] = {}
    for side, part in zip((1, -1), text.split("/", 1), strict=False):
        for factor in part.replace("/", "·").split("·"):
            symbol = factor.rstrip("".join(map(chr, LOWERED)))
            power = factor[len(symbol) :].translate(LOWERED)
            if symbol not in ("", "1"):
                found = times(found, {symbol: Fraction(side * int(power or 1))})
    return found


def times(a: Unit, b: Unit, power: Fraction | int = 1) -> dict[str, Fraction]:
    """The unit of a times b to a power."""
    both = {symbol: a.get(symbol, Fraction(0)) + power * b.get(symbol, 0) for symbol in {*a, *b}}
    return {symbol: both[symbol] for symbol in sorted(both) if both[symbol]}


def raised(a: Unit, power: Fraction) -> dict[str, Fraction]:
    """The unit of a to a power."""
    return times(NONE, a, power)


def spelt(a: Unit) -> str:
    """For people: `m²/s⁴`; empty for a plain number."""
    over = [_factor(symbol, power) for symbol, power in a.items() if power > 0]
    under = [_factor(symbol, -power) for symbol, power in a.items() if power < 0]
    if not under:
        return "·".join(over)
    return "/".join(["·".join(over) or "1", *under])


def _factor(symbol: str, power: Fraction) -> str:
    return symbol if power == 1 else symbol + str(power).translate(RAISED)
