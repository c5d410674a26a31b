"""After axes are left out, nothing that the others contradict is called valid: the past is told
anew by the axes that stay.
"""

import numpy as np
import pytest
from support import wrong_axes

from inertial.layouts.catalogue import CUBE
from inertial.rate import sight
from inertial.rate.estimators import ESTIMATORS, leave_out
from inertial.rate.health import HealthMonitor
from inertial.simulation.faults import Faults, parse
from inertial.simulation.table import TableTest

NAMES = CUBE(0.05).axis_names
FAULTS = (
    "a21:swapped=a22@0",
    "a12:swapped=a33@0",
    "a21:stuck@4",
    "a21:stuck@7",
    "a31:flipped@6.5",
    "a11:biased=3@6",
    "a23:spiking@6",
    "a13:saturated@12",
    "a21:stuck@7 a22:biased=2@12",
)


def followed(fault: str, profile: str, seed: int, name: str, until_s: float = 30.0):
    """An estimator whose axes the monitor takes away: error and sigma (n, 3), called valid (n, 3),
    samples since the last change of axes (n,); -1 before the first.
    """
    table = TableTest(seed=seed, profile=profile)
    faults = Faults([parse(text, NAMES) for text in fault.split()])
    monitor, estimator = HealthMonitor(table.layout), ESTIMATORS[name](table.layout)
    error, sigma, valid, since = [], [], [], []
    mask, ago = 0, -1
    for number in range(int(np.ceil(until_s / 10.0))):
        block = faults.into(table.block(number))
        for k, t in enumerate(block.t_s):
            readings = block.readings[k]
            monitor.step(float(t), readings)
            if monitor.mask != mask:
                mask, ago = monitor.mask, 0
                leave_out(estimator, mask)
            said = estimator.feed(block.t_s[k : k + 1], block.readings[k : k + 1])
            error.append(said.omega_b[0] - block.omega_b[k])
            sigma.append(np.sqrt(np.diag(said.P[0])))
            valid.append(said.sight[0] == sight.VALID)
            since.append(ago)
            ago += ago >= 0
    return np.array(error), np.array(sigma), np.array(valid), np.array(since)


@pytest.mark.parametrize("name", ["products-ekf", "products-ukf", "products-mhe", "least-squares"])
@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("profile, seed", [("published", 3), ("wobble", 1)])
def test_nothing_valid_is_contradicted_after_an_exclusion(fault, name, profile, seed):
    error, sigma, valid, since = followed(fault, profile, seed, name)
    after = since >= 0
    assert after.any()
    beyond = (np.abs(error) > 5.0 * sigma) & valid & after[:, None]
    assert beyond.sum() <= 0.001 * max(valid[after].sum(), 1)


@pytest.mark.parametrize("name", ["products-ekf", "products-ukf", "products-mhe"])
@pytest.mark.parametrize("fault", ["a13:biased=2@0", "a43:biased=-2@0", "a22:biased=3@0"])
@pytest.mark.parametrize("profile, seed", [("published", 2), ("wobble", 1)])
def test_an_axis_that_was_always_far_off_is_left_out_and_no_motion(fault, name, profile, seed):
    """Nothing is valid before; afterwards sigma is right with each of the axes missing."""
    error, sigma, valid, since = followed(fault, profile, seed, name)
    assert (since >= 0).any() and valid.mean() > 0.7
    beyond = (np.abs(error) > 5.0 * sigma) & valid
    assert beyond.sum() <= 0.001 * valid.sum()
    nees = [np.mean((error[v, k] / sigma[v, k]) ** 2) for k, v in enumerate(valid.T)]
    assert max(nees) < 2.5, nees


def test_a_filter_goes_on_at_once_with_the_axes_that_stay():
    error, sigma, valid, since = followed("a21:swapped=a22@0", "published", 5, "products-ekf")
    soon = (since >= 0) & (since < 500)
    assert valid[soon].mean() > 0.9
    assert np.abs(error[soon]).max() < 0.15  # rad/s


@pytest.mark.parametrize("name", ["products-ekf", "products-ukf", "products-mhe", "least-squares"])
@pytest.mark.parametrize("seed", [1, 2])
def test_single_samples_far_off_cost_no_truth(name, seed):
    """60 readings of 1 to 15 g anywhere in 36 000."""
    table, draw = TableTest(seed=seed), np.random.default_rng(seed)
    blocks = [table.block(k) for k in range(3)]
    t_s, readings, omega = (
        np.concatenate([getattr(b, k) for b in blocks]) for k in ("t_s", "readings", "omega_b")
    )
    rows, axes = draw.integers(0, len(t_s), 60), draw.integers(0, 12, 60)
    readings = readings.copy()
    readings[rows, axes] += draw.choice([-1.0, 1.0], 60) * draw.uniform(9.8, 147.0, 60)
    said = ESTIMATORS[name](table.layout).feed(t_s, readings)
    sigma = np.sqrt(np.einsum("kii->ki", said.P))
    valid = said.sight == sight.VALID
    assert ((np.abs(said.omega_b - omega) > 5.0 * sigma) & valid).sum() <= 0.001 * valid.sum()


@pytest.mark.parametrize("profile", ["published", "wobble"])
@pytest.mark.parametrize("seed", [1, 2])
def test_readings_rounded_to_more_than_their_noise_are_no_stuck_axes(profile, seed):
    """16 g at ten bits: 31 mg, and noise of 4 mg."""
    run = wrong_axes.followed(wrong_axes.CASES["rounded to 31 mg"](profile, seed))
    assert not run.masks.any()
    assert run.valid.mean() > 0.7
    ratio = (run.error / run.sigma)[run.valid]
    assert np.mean(np.abs(ratio) > 5.0) < 0.005 and np.mean(ratio**2) < 3.0


def test_where_many_axes_do_not_fit_none_is_believed():
    """Two triads exchanged: whichever axes are named, the others are no judges."""
    table = TableTest(seed=5)
    monitor, estimator = HealthMonitor(table.layout), ESTIMATORS["products-ekf"](table.layout)
    for number in range(3):
        block = table.block(number)
        readings = block.readings[:, [3, 4, 5, 0, 1, 2, *range(6, 12)]]
        for k in range(0, len(readings), 50):
            part = slice(k, k + 50)
            for _, mask, _ in monitor.feed(block.t_s[part], readings[part]):
                error = leave_out(estimator, mask)
    assert monitor.mask == 0xFFF and "none is believed" in monitor.message
    assert error is not None and "wiring" in str(error)


def test_until_contradicting_readings_are_explained_nothing_is_valid():
    """Two axes are exchanged while the table turns: doubted first, then named."""
    table = TableTest(seed=5)
    layout, a, b = table.layout, NAMES.index("a11"), NAMES.index("a22")
    monitor, estimator = HealthMonitor(layout), ESTIMATORS["least-squares"](layout)
    doubted, named = [], []
    for block in (table.block(0), table.block(1)):
        readings = block.readings.copy()
        turned = block.t_s >= 7.0
        readings[np.ix_(turned, [a, b])] = readings[np.ix_(turned, [b, a])]
        begin = 0
        for end, mask, doubt in monitor.feed(block.t_s, readings):
            estimator.doubt(doubt)
            said = estimator.feed(block.t_s[begin:end], readings[begin:end])
            if doubt:
                doubted.append(block.t_s[begin])
                assert (said.sight == sight.BLIND).all()
                assert "contradict" in said.sight_reason(0)
            if mask:
                named.append(block.t_s[begin])
            begin = end
    assert 7.0 < doubted[0] < 7.5 and doubted[0] < named[0]
    assert not monitor.doubted
