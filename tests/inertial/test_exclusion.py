"""After axes are left out, nothing that the others contradict is called valid: the past is told
anew by the axes that stay.
"""

import numpy as np
import pytest

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
            now = sum(1 << i for i, axis in enumerate(monitor.faults) if axis.excluded)
            if now != mask:
                leave_out(estimator, now)
                mask, ago = now, 0
            said = estimator.feed(block.t_s[k : k + 1], block.readings[k : k + 1])
            error.append(said.omega_b[0] - block.omega_b[k])
            sigma.append(np.sqrt(np.diag(said.P[0])))
            valid.append(said.sight[0] == sight.VALID)
            since.append(ago)
            ago += ago >= 0
    return np.array(error), np.array(sigma), np.array(valid), np.array(since)


@pytest.mark.parametrize("name", ["products-ekf", "products-ukf", "products-mhe", "least-squares"])
@pytest.mark.parametrize("fault", FAULTS)
def test_nothing_valid_is_contradicted_after_an_exclusion(fault, name):
    error, sigma, valid, since = followed(fault, "published", 3, name)
    after = since >= 0
    assert after.any()
    beyond = (np.abs(error) > 5.0 * sigma) & valid & after[:, None]
    assert beyond.sum() <= 0.001 * max(valid[after].sum(), 1)


def test_a_filter_goes_on_at_once_with_the_axes_that_stay():
    error, sigma, valid, since = followed("a21:swapped=a22@0", "published", 5, "products-ekf")
    soon = (since >= 0) & (since < 500)
    assert valid[soon].mean() > 0.9
    assert np.abs(error[soon]).max() < 0.15  # rad/s
