"""A person at a crank: late, past the rate and back, and there in the end; a slip is one."""

import numpy as np
import pytest

from inertial.simulation.person import Person

STEP_S = 0.05


def turned(person, wanted, seconds):
    return np.array([person.step(wanted, STEP_S) for _ in range(round(seconds / STEP_S))])


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("wanted", [0.5, -1.5, 3.0])
def test_a_rate_is_overshot_and_then_held(seed, wanted):
    person = Person(seed)
    rates = turned(person, wanted, 12.0) / wanted
    assert not rates[: int(0.35 / STEP_S)].any() and 1.05 < rates.max() < 1.4
    assert np.abs(rates[int(8.0 / STEP_S) :] - 1.0).max() < 0.03
    assert turned(person, 0.0, 8.0)[-1] == 0.0


def test_a_slip_is_one():
    rates = turned(Person(1, slips=1), 1.0, 20.0)
    low = rates[int(5.0 / STEP_S) :] < 0.9
    assert low.any() and np.count_nonzero(np.diff(low.astype(int)) == 1) <= 1
    assert np.abs(rates[-int(5.0 / STEP_S) :] - 1.0).max() < 0.03
