"""What is called valid is borne out by the data, whatever the laboratory does."""

import numpy as np
import pytest

from inertial.constants import MILLI_G
from inertial.layouts.catalogue import CUBE
from inertial.rate import sight
from inertial.rate.estimators import ESTIMATORS, ProductsRate, leave_out
from inertial.simulation.disturbed import CONDITIONS, record
from inertial.simulation.profiles import PLATEAU, Profile, Ramp
from inertial.simulation.table import SensorModel

LIMIT = 4095 * 3.9 * MILLI_G  # m/s^2, of the cube's axes
HONEST = ("products-ekf", "products-ukf", "products-mhe", "least-squares", "products-rls")


def judged(log, name="products-ekf"):
    """Errors over sigma (n, 3), what is valid (n, 3), and the columns."""
    said = ESTIMATORS[name](CUBE(0.05)).feed(log.t_s, log.readings)
    sigma = np.sqrt(np.einsum("kii->ki", said.P))
    return (said.omega_b - log.omega_b) / sigma, said.sight == sight.VALID, said


@pytest.mark.parametrize("profile", ["published", "wobble", "fast"])
@pytest.mark.parametrize("condition", [c for c in CONDITIONS if "loss" not in c])
def test_valid_is_borne_out(condition, profile):
    """Seeds that were wrong for most of the time before noise was measured, and others."""
    beyond, nees, share = [], [], []
    for seed in (1, 2, 6):
        ratio, valid, _ = judged(record(seed, profile, **CONDITIONS[condition]))
        beyond.append((np.abs(ratio) > 5.0)[valid].mean())
        nees.append((ratio[valid] ** 2).mean())
        share.append(valid.mean())
    assert np.mean(beyond) < 0.002
    assert 0.3 < np.mean(nees) < 2.0
    assert np.mean(share) > 0.8


def sudden_stop(seed):
    """171 deg/s, then nearly nothing within 0.09 s, sampled at 100 Hz without a low-pass."""
    rest, up, hold = Ramp(5.0, 0.0, 0.0), Ramp(1.0, 0.0, PLATEAU), Ramp(5.0, PLATEAU, PLATEAU)
    profile = Profile("stop", [rest, up, hold, Ramp(0.12, PLATEAU, 0.0), Ramp(6.0, 0.0, 0.0)])
    return record(seed, profile, 2)


@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_a_sudden_stop_widens_sigma(seed):
    log = sudden_stop(seed)
    ratio, valid, _ = judged(log)
    after = (log.t_s > 11.0) & (log.t_s < 17.0)
    assert np.abs(ratio[after][valid[after]]).max() < 5.0
    assert valid[log.t_s > 13.5].mean() > 0.9


def jump(seed, at=1100):
    """The published turn, whose table stands within less than a sample: no ramp is ever seen."""
    log = record(seed, "published", 2)
    still = record(seed, "still", 2)
    readings, omega = log.readings.copy(), log.omega_b.copy()
    readings[at:], omega[at:] = still.readings[at:], 0.0
    return log.t_s, readings, omega


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_stop_that_no_sample_saw_is_not_slept_through(seed):
    t_s, readings, omega = jump(seed)
    said = ProductsRate(CUBE(0.05)).feed(t_s, readings)
    sigma = np.sqrt(np.einsum("kii->ki", said.P))
    wrong = (np.abs(said.omega_b - omega) > 5.0 * sigma) & (said.sight == sight.VALID)
    assert wrong[1300:].mean() < 0.001


@pytest.mark.parametrize("seed", [2, 6, 8, 10])
def test_bias_is_not_taken_for_motion(seed):
    log = record(seed, "still", sensor=SensorModel(bias=40 * MILLI_G))
    ratio, valid, said = judged(log)
    assert np.abs(ratio[valid]).max() < 5.0
    assert valid[400:].all() and said.still[400:].mean() > 0.9


def turning():
    return record(1, "published", 1)  # from 5 s on


@pytest.mark.parametrize("name", HONEST)
def test_readings_at_the_rail_say_nothing(name):
    log = turning()
    readings = log.readings.copy()
    readings[800:] = np.sign(readings[800:]) * LIMIT
    said = ESTIMATORS[name](CUBE(0.05)).feed(log.t_s, readings)
    assert (said.sight[801:] == sight.BLIND).all() and not said.still[804:].any()
    assert "no usable data" in said.sight_reason(900)
    assert (np.einsum("kii->k", said.P)[804:] > 100.0).all()


@pytest.mark.parametrize("name", HONEST)
def test_a_lower_rail_than_the_layout_says_is_seen_by_its_standing_still(name):
    log = turning()
    readings = log.readings.copy()
    readings[700:] = readings[700]
    said = ESTIMATORS[name](CUBE(0.05)).feed(log.t_s, readings)
    assert (said.sight[810:] == sight.BLIND).all()


@pytest.mark.parametrize("name", HONEST)
def test_stale_axes_say_nothing_until_they_are_fresh(name):
    log, estimator = turning(), ESTIMATORS[name](CUBE(0.05))
    estimator.feed(log.t_s[:400], log.readings[:400])
    assert leave_out(estimator, 0xFFF) is not None
    stale = estimator.feed(log.t_s[400:700], log.readings[400:700])
    assert (stale.sight == sight.BLIND).all() and not stale.still[4:].any()
    assert leave_out(estimator, 0) is None
    fresh = estimator.feed(log.t_s[700:], log.readings[700:])
    assert (fresh.sight[-1] != sight.VALID).any() or fresh.phase[-1] != stale.phase[-1]


def test_a_single_sample_at_the_rail_costs_no_more_than_a_sample():
    log = record(3, "published", 2)
    readings = log.readings.copy()
    readings[900, 4] = LIMIT
    said = ProductsRate(CUBE(0.05)).feed(log.t_s, readings)
    assert (said.sight[900] == sight.BLIND).all() and (said.sight[901] == sight.VALID).all()
    assert np.abs(said.omega_b[901:1400] - log.omega_b[901:1400]).max() < 0.08
