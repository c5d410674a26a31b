"""Numbers in another unit are questioned, and the likely unit is named; right ones never are."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from inertial.layouts.catalogue import CUBE
from inertial.plausible import (
    doubt_of_frozen,
    doubt_of_gravity,
    doubt_of_rate,
    doubt_of_sense,
    doubt_of_time,
)
from inertial.rotation import from_rotation_vector, multiply, to_matrix
from logs.cube_log import squared_rate

G = 9.80665


def tumbled(seed: int, seconds: float = 30.0, noise: float = 0.05, bias: float = 0.02):
    """A hand-held unit that is turned about all axes: times, specific force, rate."""
    draw = np.random.default_rng(seed)
    t = np.arange(0.0, seconds, 0.01)
    waves = draw.uniform(0.2, 1.0, (3, 2)), draw.uniform(0.0, 6.28, (3, 2))
    omega = np.stack(
        [
            (draw.uniform(0.2, 0.8) * np.sin(waves[0][k] * t[:, None] + waves[1][k])).sum(axis=1)
            for k in range(3)
        ],
        axis=1,
    )
    omega[:300] = 0.0
    q, f = np.array([1.0, 0.0, 0.0, 0.0]), np.empty((len(t), 3))
    for k, w in enumerate(omega):
        f[k] = to_matrix(q).T @ np.array([0.0, 0.0, -G])
        q = multiply(q, from_rotation_vector(w * 0.01))
    f += draw.normal(0.0, noise, f.shape) + draw.normal(0.0, 0.2, 3)
    return t, f, omega + draw.normal(0.0, 0.01, omega.shape) + draw.normal(0.0, bias, 3)


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10_000))
def test_right_units_are_not_doubted_and_wrong_ones_are_named(seed):
    t, f, omega = tumbled(seed)
    assert doubt_of_gravity(f) is None and doubt_of_rate(t, f, omega) is None
    assert "_degps" in doubt_of_rate(t, f, np.degrees(omega)).text
    assert "_radps" in doubt_of_rate(t, f, np.radians(omega)).text
    assert "_g" in doubt_of_gravity(f / G).text
    assert "_mps2" in doubt_of_gravity(f * G).text
    assert "31.2" in doubt_of_gravity(f / 8.0, lsb_mg=3.9).text
    assert "10 bit at 16 g" in doubt_of_gravity(f / 8.0, lsb_mg=3.9).text


@pytest.mark.parametrize(
    ("period", "word"),
    [
        (10.0, "t_ms"),
        (0.01, None),
        (2.5e-4, None),
        (20.0, "t_ms"),
        (1e4, "t_us"),
        (1e7, "t_ns"),
        (1e-7, "want seconds"),
    ],
)
def test_a_period_says_which_unit_the_times_have(period, word):
    doubt = doubt_of_time(period)
    assert (doubt is None) if word is None else (word in doubt.text)
    assert "t_ms" in doubt_of_time(12.0).text


@settings(max_examples=40, deadline=None, derandomize=True)
@given(st.integers(0, 2**32 - 1))
def test_axes_of_the_wrong_sign_are_doubted_and_right_ones_are_not(seed):
    rng = np.random.default_rng(seed)
    shape = CUBE(rng.choice([0.02, 0.05, 0.15]))
    t = np.arange(0.0, 15.0, rng.choice([0.01, 0.02]))
    rate = rng.uniform(3.0, 9.0) * np.clip((t - 2.0) / 3.0, 0.0, 1.0)
    axis = rng.normal(size=3)
    omega = rate[:, None] * axis / np.linalg.norm(axis)
    f = np.array([shape.J[:, 3:] @ [0.0, 0.0, 9.81] + shape.quadratic(w) for w in omega])
    f += rng.normal(0.0, 0.04, f.shape) + rng.normal(0.0, 0.1, f.shape[1])
    assert doubt_of_sense(squared_rate(f, shape)) is None
    doubt = doubt_of_sense(squared_rate(-f, shape))
    assert doubt is not None and "wrong sign" in doubt.text


def test_a_log_in_which_nothing_ever_changes_is_doubted():
    frozen = np.tile(np.arange(12.0), (300, 1))
    assert "frozen" in doubt_of_frozen(frozen).text
    frozen[200, 3] += 1.0
    assert doubt_of_frozen(frozen) is None
