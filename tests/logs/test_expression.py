"""Expressions that people type: right ones are computed, all others are refused with a sentence."""

import math
import string

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from logs.figures.expression import (
    MOST_CURVES,
    MOST_NODES,
    evaluate,
    many,
    read,
    unit_of,
)
from logs.figures.quantity import FUNCTIONS, HINTS, ExpressionError, Quantity
from logs.figures.units import spelt, times, unit

N = 50
T = np.linspace(0.0, 1.0, N)
UNITS = {"a": "°/s", "b": "°/s", "f": "m/s²", "angle": "°", "plain": "", "t": "s"}
VALUES = {
    "a": np.sin(9 * T),
    "b": 3.0 * T - 1.0,
    "f": 9.8 + T,
    "angle": 40.0 * T,
    "plain": np.where(T > 0.5, np.nan, T),
    "t": T,
}
CHANNELS = {name: Quantity(VALUES[name], unit(UNITS[name])) for name in UNITS}


def drawn(line):
    found = evaluate(read(line), CHANNELS)
    return np.asarray(found.values), spelt(found.unit)


@pytest.mark.parametrize(
    ("line", "values", "of"),
    [
        ("norm(a, b)", np.hypot(VALUES["a"], VALUES["b"]), "°/s"),
        ("a - b", VALUES["a"] - VALUES["b"], "°/s"),
        ("sqrt(f**2 + f**2)", math.sqrt(2) * VALUES["f"], "m/s²"),
        ("-a + 3", 3 - VALUES["a"], "°/s"),
        ("f * t", VALUES["f"] * T, "m·s/s²".replace("·s/s²", "/s")),
        ("a / b * f", VALUES["a"] / VALUES["b"] * VALUES["f"], "m/s²"),
        ("1/t", np.append(np.nan, 1 / T[1:]), "1/s"),
        ("sin(angle)", np.sin(np.radians(VALUES["angle"])), ""),
        ("atan2(a, b)", np.degrees(np.arctan2(VALUES["a"], VALUES["b"])), "°"),
        ("max(a, b, 0)", np.maximum(np.maximum(VALUES["a"], VALUES["b"]), 0), "°/s"),
        ("a - mean(a)", VALUES["a"] - VALUES["a"].mean(), "°/s"),
        ("a + f [odd]", VALUES["a"] + VALUES["f"], "odd"),
        ("plain * 2", 2 * VALUES["plain"], ""),
    ],
)
def test_what_is_typed_is_computed_with_its_unit(line, values, of):
    found, spelling = drawn(line)
    np.testing.assert_allclose(found, values, rtol=1e-12, equal_nan=True)
    assert spelling == of == unit_of(read(line), {n: unit(u) for n, u in UNITS.items()})


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("", "Type an expression"),
        ("a +", "cannot be read"),
        ("omga_z", "no channel omga_z"),
        ("bb - a", "Is b meant"),
        ("norn(a, b)", "Is norm meant"),
        ("norm + a", "write norm("),
        ("norm(a)", "2 to 12 arguments"),
        ("a + f", "°/s and m/s²"),
        ("sin(a)", "wants an angle"),
        ("a ** b", "A power is a number"),
        ("9**9**9 * a", "at most 8"),
        ("a ^ 2", "write **"),
        ("3 + 4", "names no channel"),
        ("a.real", "cannot stand here"),
        ("__import__('os').system('id')", "cannot stand here"),
        ("[b for b in a] + a", "cannot stand here"),
        ("a if b else f", "cannot stand here"),
        ("(lambda: a)()", "cannot stand here"),
        ("norm(*a)", "2 to 12 arguments"),
        ("norm(a, b=b)", "cannot stand here"),
        ("'a' * 9", "cannot stand here"),
        ("f'{a}'", "cannot stand here"),
        ("a and b", "cannot stand here"),
        ("a[0] + a", "cannot stand here"),
        ("a = 3", "cannot be read"),
        ("True + a", "is no number"),
        ("1j * a", "is no number"),
        ("1e999 * a", "cannot stand here"),
        ("(" * 90 + "a", "cannot be read"),
        ("-" * 120 + "a", "nested deeper"),
        ("+".join("a" * 70), "nested deeper"),
        ("norm(" + ",".join(["a*b*a*b*a*b"] * 6) + ")", "parts"),
        ("a" * 201, "characters"),
        ("a [\x00]", "no unit"),
    ],
)
def test_what_cannot_be_drawn_says_why(line, says):
    with pytest.raises(ExpressionError) as caught:
        drawn(line)
    assert says in str(caught.value) and str(caught.value).rstrip().endswith((".", "?"))


@given(
    st.one_of(
        st.text(max_size=260),
        st.text(string.ascii_lowercase + "abft0123456789.+-*/()_, []", max_size=220),
        st.lists(
            st.sampled_from([*UNITS, *FUNCTIONS, *"+-*/(),.[]^%@~|&<>=!:;", "**", "8", "1e9", " "]),
            max_size=80,
        ).map("".join),
    )
)
def test_no_text_does_anything_but_draw_or_be_refused(text):
    try:
        found = evaluate(read(text), CHANNELS)
    except ExpressionError as error:
        assert str(error)
    else:
        assert found.values.shape == (N,) and found.values.dtype == np.float64
        assert not np.isinf(found.values).any()


NUMBERS = st.sampled_from(["2", "0.5", "1e3", "7"])
TREES = st.recursive(
    st.sampled_from([*UNITS]) | NUMBERS,
    lambda inner: st.one_of(
        st.tuples(inner, st.sampled_from("+-*/"), inner).map(lambda p: f"({''.join(p)})"),
        st.tuples(inner, st.sampled_from(["2", "0.5", "-1"])).map(lambda p: f"({p[0]})**{p[1]}"),
        st.tuples(st.sampled_from(["abs", "sqrt", "sin", "log"]), inner).map(
            lambda p: f"{p[0]}({p[1]})"
        ),
        st.tuples(inner, inner).map(lambda p: f"norm({p[0]},{p[1]})"),
    ),
    max_leaves=12,
)
PLAIN = {
    "abs": np.abs,
    "sqrt": np.sqrt,
    "sin": np.sin,
    "log": np.log,
    "norm": lambda x, y: np.sqrt(x * x + y * y),
}


@given(TREES)
def test_a_unit_that_is_given_never_changes_the_values(line):
    """Against Python itself, without angles, whose unit counts in sin()."""
    line = line.replace("angle", "plain")
    try:
        with np.errstate(all="ignore"):
            found = evaluate(read(f"{line} [x]"), CHANNELS)
    except ExpressionError:
        return  # too long, or a number alone
    with np.errstate(all="ignore"):
        wanted = np.broadcast_to(eval(line, {"__builtins__": {}}, PLAIN | VALUES), (N,))
    wanted = np.where(np.isfinite(wanted), wanted, np.nan)
    np.testing.assert_allclose(found.values, wanted, rtol=1e-9, equal_nan=True)


@given(st.dictionaries(st.sampled_from(["m", "s", "°", "kg"]), st.integers(-6, 6)))
def test_a_unit_is_spelt_as_it_is_read(powers):
    one = times({}, powers)
    assert unit(spelt(one)) == one


def test_an_arrangement_is_bounded_and_none_stands_twice():
    assert many("a; b;;a ;") == ["a", "b"]
    assert len(many(";".join(f"a + {k}" for k in range(50)))) == MOST_CURVES
    assert set(HINTS) == set(FUNCTIONS) and MOST_NODES < 100
