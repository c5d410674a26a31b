"""The core's elementary functions: near the exact value everywhere, equal bits in both builds."""

import math

import numpy as np
import pytest

from inertial import core
from inertial.core import _core_plain

RNG = np.random.default_rng(5)
ANGLES = np.concatenate([RNG.uniform(-1e5, 1e5, 20_000), RNG.normal(0, 1, 20_000), [0.0, -0.0]])
SIZES = np.concatenate([10.0 ** RNG.uniform(-300, 300, 20_000), RNG.uniform(0.5, 2.0, 20_000)])
ARGUMENTS = {
    "sin": ANGLES,
    "cos": ANGLES,
    "atan": np.concatenate([ANGLES, 10.0 ** RNG.uniform(-12, 12, 10_000)]),
    "asin": RNG.uniform(-1, 1, 20_000),
    "acos": RNG.uniform(-1, 1, 20_000),
    "exp": np.concatenate([RNG.uniform(-740, 709, 20_000), RNG.normal(0, 0.1, 10_000)]),
    "log": SIZES,
    "tan": RNG.normal(0, 1, 20_000),
}


@pytest.mark.parametrize("name", ARGUMENTS)
def test_elementary_functions_are_within_a_few_units_in_the_last_place(name):
    x = ARGUMENTS[name]
    exact = np.array([getattr(math, name)(v) for v in x])
    error = np.abs(getattr(core.native, name)(x) - exact) / np.maximum(
        np.spacing(np.abs(exact)), 1e-320
    )
    assert error.max() <= 3.0, (name, x[error.argmax()], error.max())


def test_atan2_knows_all_quadrants_and_zeros():
    y, x = RNG.normal(0, 1, (2, 20_000))
    x[::7] *= 1e-9
    got = np.array([core.native.atan2(b, a) for a, b in zip(x, y, strict=True)])
    exact = np.arctan2(y, x)
    assert np.max(np.abs(got - exact) / np.spacing(np.abs(exact))) <= 3.0
    for b in (0.0, -0.0):
        for a in (0.0, -0.0, 1.0, -1.0, math.inf, -math.inf):
            assert math.copysign(1, core.native.atan2(b, a)) == math.copysign(1, math.atan2(b, a))
            assert core.native.atan2(b, a) == math.atan2(b, a)


def test_what_is_no_number_stays_none():
    for name in ARGUMENTS:
        assert math.isnan(getattr(core.native, name)(math.nan)) or name in ("asin", "acos")
    assert math.isnan(core.native.sin(math.inf)) and math.isnan(core.native.log(-1.0))
    assert core.native.exp(1000.0) == math.inf and core.native.exp(-1000.0) == 0.0
    assert core.native.log(0.0) == -math.inf and core.native.log(math.inf) == math.inf


@pytest.mark.parametrize("name", ARGUMENTS)
def test_both_builds_give_the_same_bits(name):
    x = ARGUMENTS[name]
    assert getattr(core.native, name)(x).tobytes() == getattr(_core_plain, name)(x).tobytes()


def test_products_and_factors_solve_what_they_say():
    A, B = RNG.normal(size=(7, 5)), RNG.normal(size=(5, 3))
    np.testing.assert_allclose(core.native.product(A, B), A @ B, rtol=1e-13, atol=1e-14)
    C = A @ A.T + np.eye(7)
    np.testing.assert_allclose(core.native.solve_positive(C, A), np.linalg.solve(C, A), atol=1e-13)
    L = core.native.cholesky(C)
    np.testing.assert_allclose(L @ L.T, C, atol=1e-13)
    with pytest.raises(ValueError, match="not positive definite"):
        core.native.cholesky(-C)
    with pytest.raises(ValueError, match="do not fit"):
        core.native.product(A, A)
