"""The rate estimator on a table that a physics engine turned: other equations, other noise."""

import numpy as np
import pytest
from support.second_model import turned

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
