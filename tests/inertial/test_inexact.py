"""Axes that are not what they should be: scales, directions, places, wiring, a start without rest.
What is called valid is borne out all the same (E-90).
"""

from functools import cache

import numpy as np
import pytest
from support.wrong_axes import CASES, followed, published

from inertial.layouts.catalogue import CUBE
from inertial.rate.estimators import ProductsRate

PROFILES = ("published", "wobble", "fast")
SEEDS = (1, 2, 3)


@cache
def judged(case, profile, seed):
    """Share of what is called valid that is beyond 5 sigma, mean NEES per component, and the share
    called valid.
    """
    run = followed(CASES[case](profile, seed))
    ratio = (run.error / run.sigma)[run.valid]
    return np.mean(np.abs(ratio) > 5.0), np.mean(ratio**2), run.valid.mean()


LESS_EXACT = (
    "imperfect device",
    "position 2 mm",
    "scale 5 %",
    "all scales 1.1",
    "all scales 0.9",
)
ONE_AXIS = ("scale 1.2",)


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("case", LESS_EXACT + ONE_AXIS)
def test_axes_of_a_wrong_scale_direction_or_place_widen_sigma(case, profile):
    beyond, nees, share = np.mean([judged(case, profile, seed) for seed in SEEDS], axis=0)
    assert beyond < 0.005
    assert nees < 2.5
    assert share > 0.5


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("case, most", [("scale 0.7", 0.002), ("swap", 0.006), ("triads", 0.05)])
def test_while_axes_mislead_nothing_is_valid(case, most, profile):
    """Innovations that no error of 2 % explains, and a monitor that has not found out yet (E-91,
    H-15). It was 11 % with one axis times 0.7, 6 % with two exchanged, 32 % with six.
    """
    assert np.mean([judged(case, profile, seed)[0] for seed in SEEDS]) < most


def followed_by(estimator, log):
    """omega (n, 3), and its derivative by the axes' errors (n, 3, 3 N) by eighth sample."""
    omega, by = [], []
    for k in range(0, len(log.t_s), 8):
        said = estimator.feed(log.t_s[k : k + 8], log.f_axis[k : k + 8])
        omega.append(said.omega_b[-1].copy())
        now = estimator.core.native.inexact[2]
        by.append(now if now.size else np.zeros((3, 36)))  # before it has begun
    return np.array(omega), np.array(by)


@pytest.mark.parametrize("axis", [1, 6])
def test_what_an_axis_error_does_to_the_rate_is_what_the_derivative_says(axis):
    """The filter itself, with and without a small scale error."""
    log, error = published("published", 2), 2e-4
    plain, by = followed_by(ProductsRate(CUBE(0.05)), log)
    log.f_axis[:, axis] *= 1.0 + error
    changed, _ = followed_by(ProductsRate(CUBE(0.05)), log)
    theta = CUBE(0.05).theta_b[axis]
    predicted = error * by[:, :, 3 * axis : 3 * axis + 3] @ theta
    change = changed - plain
    size, wanted = np.sqrt(np.mean(predicted**2)), np.sqrt(np.mean(change**2))
    assert 0.6 < size / wanted < 1.6
    assert np.mean(predicted * change) > 0.8 * size * wanted
