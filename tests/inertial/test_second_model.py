"""The rate estimator on a table that a physics engine turned: other equations, other noise."""

import numpy as np
import pytest
from support.second_model import G, turned

from inertial.layouts.catalogue import CUBE
from inertial.rate import sight
from inertial.rate.estimators import ProductsRate


def smooth(t, begin, end):
    x = np.clip((t - begin) / (end - begin), 0.0, 1.0)
    return x * x * (3.0 - 2.0 * x)


def profile(t):
    """5 s still, up to 172 deg/s, held, and still again; rad/s."""
    return 3.0 * (smooth(t, 5.0, 7.0) - smooth(t, 14.0, 16.0))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_what_is_called_valid_is_borne_out_by_another_model(seed):
    table = turned(seed, profile)
    said = ProductsRate(CUBE(0.05)).feed(table.t_s, table.readings)
    error = said.omega_b - table.omega_b
    sigma = np.sqrt(np.einsum("kii->ki", said.P))
    valid = said.sight == sight.VALID
    assert valid.mean() > 0.9
    assert np.count_nonzero(valid & (np.abs(error) > 5.0 * sigma)) <= 0.001 * valid.sum()
    assert np.degrees(np.sqrt(np.mean(error[valid.all(axis=1)] ** 2, axis=0))).max() < 1.2


def stopping(t):
    """172 deg/s that end at 12 s within a few samples."""
    return 3.0 * smooth(t, 5.0, 7.0) * np.where(t < 12.0, 1.0, np.exp(-(t - 12.0) / 0.09))


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize(
    "rate, other", [(profile, {"noise": 6e-3 * G}), (stopping, {}), (stopping, {"jitter_s": 0.001})]
)
def test_other_noise_and_a_sudden_stop_are_told_too(seed, rate, other):
    table = turned(seed, rate, **other)
    said = ProductsRate(CUBE(0.05)).feed(table.t_s, table.readings)
    ratio = (said.omega_b - table.omega_b) / np.sqrt(np.einsum("kii->ki", said.P))
    valid = said.sight == sight.VALID
    assert valid.mean() > 0.85
    assert np.count_nonzero(np.abs(ratio[valid]) > 5.0) <= 0.001 * valid.sum()
    assert np.mean(ratio[valid] ** 2) < 2.0
