"""The products filter: derivatives, exactness, consistency, the published figures, faults."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimator.layouts.layout import CUBE, LAYOUTS, GeometryError, Layout
from estimator.rate import products_model as model
from estimator.rate.estimators import LeastSquaresRate, ProductsRate
from estimator.simulation.table import IDEAL, TableTest

law = settings(deadline=None, max_examples=40)  # the first call compiles
numbers = st.floats(-5.0, 5.0)
states = st.lists(numbers, min_size=18, max_size=18).map(np.array)
vectors = st.lists(numbers, min_size=3, max_size=3).map(np.array)


def numeric(function, x, h=1e-5):
    """Central differences of function at x."""
    return np.stack([(function(x + h * e) - function(x - h * e)) / (2 * h) for e in np.eye(len(x))], axis=1)


def run(estimator, table, seconds=30.0, damage=lambda index, a: a):
    """(states, true rates) of every sample."""
    states, omegas, block = [], [], None
    for index in range(int(seconds / table.period_s)):
        if index % 1000 == 0:
            block = table.block(index // 1000)
        row = index % 1000
        states.append(estimator.step(index, block.t_s[row], damage(index, block.readings[row])))
        omegas.append(block.omega_b[row])
    return states, np.array(omegas)


def rms_deg(states, omegas):
    """Rate error RMS by axis, deg/s."""
    error = np.array([s.omega_b for s in states]) - omegas
    return np.rad2deg(np.sqrt(np.mean(error**2, axis=0)))


@pytest.fixture(scope="module")
def published():
    """The demo profile with two seeds, by both estimators."""
    out = []
    for seed in (1, 2):
        table = TableTest(seed)
        out.append((run(ProductsRate(table.layout), table), run(LeastSquaresRate(table.layout), table)))
    return out


@law
@given(x=states, alpha=vectors, turning=st.booleans())
def test_transition_jacobian_matches_central_differences(x, alpha, turning):
    dt = 0.002
    F = model.transition_jacobian(x, model.transition(x, alpha, dt, turning), dt, turning)
    expected = numeric(lambda x: model.transition(x, alpha, dt, turning), x)
    np.testing.assert_allclose(F, expected, atol=1e-4)  # second order in the turn of one sample


@law
@given(x=states)
def test_products_jacobian_matches_central_differences(x):
    np.testing.assert_allclose(model.products_jacobian(x), numeric(model.measured_products, x), atol=1e-7)


@law
@given(x=states)
def test_force_jacobian_matches_central_differences(x):
    np.testing.assert_allclose(model.force_jacobian(), numeric(model.measured_force, x), atol=1e-7)


def test_spread_of_the_products_is_that_of_random_rates():
    root = np.array([[1.0, 0.0, 0.0], [0.4, 0.8, 0.0], [-0.3, 0.2, 0.6]])
    e = np.random.default_rng(1).normal(size=(200_000, 3)) @ root.T
    z = np.column_stack([e[:, i] * e[:, j] for i, j in zip(model.FIRST, model.SECOND, strict=True)])
    mean, covariance = model.products_spread(root @ root.T)
    np.testing.assert_allclose(mean, z.mean(axis=0), atol=0.01)
    np.testing.assert_allclose(covariance, np.cov(z.T), atol=0.04)


def test_perfect_data_give_the_truth():
    table = TableTest(1, sensor=IDEAL)
    states, omegas = run(ProductsRate(table.layout), table, 16.0)
    omega = np.array([s.omega_b for s in states])
    np.testing.assert_allclose(omega[600:1400], omegas[600:1400], atol=2e-3)
    assert states[-1].angle_z == pytest.approx(np.deg2rad(-1539.0), abs=0.01)


def test_the_published_test_is_followed_below_4_deg_per_s(published):
    for (by_products, omegas), _ in published:
        assert rms_deg(by_products, omegas).max() < 1.5


def test_products_beat_integration_on_the_published_test(published):
    for by_products, by_integration in published:
        assert rms_deg(*by_products).max() < 0.3 * rms_deg(*by_integration).max()


def test_angle_and_attitude_come_back_after_30_s(published):
    for (states, _), _ in published:
        assert abs(np.rad2deg(states[-1].angle_z)) < 10.0


def test_nees_and_nis_are_within_their_bands():
    """3 degrees of freedom; errors of one run hang together, so the band is for the mean over runs."""
    nees, nis = [], []
    for seed in range(11, 17):
        table = TableTest(seed)
        states, omegas = run(ProductsRate(table.layout), table, 15.0)
        for k in range(650, 1400, 50):
            e = states[k].omega_b - omegas[k]
            nees.append(e @ np.linalg.solve(states[k].P, e))
        nis += [s.nis for s in states[520:1500] if s.nis_dof == 6]
    assert 1.0 < np.mean(nees) < 5.0
    assert 4.8 < np.mean(nis) < 7.2


def test_same_samples_same_bits():
    table = TableTest(3)
    first, again = (run(ProductsRate(table.layout), table, 7.0)[0] for _ in range(2))
    for a, b in zip(first, again, strict=True):
        assert a.omega_b.tobytes() == b.omega_b.tobytes() and a.P.tobytes() == b.P.tobytes()


def test_a_stuck_axis_shows_in_the_nis():
    """What must rise: the NIS, by far; the innovation names no axis, but it does not stay small."""
    table = TableTest(1)
    stuck = {}

    def damage(index, a):
        if index < 900:
            return a
        a = a.copy()
        a[0] = stuck.setdefault("value", a[0])
        return a

    healthy, _ = run(ProductsRate(table.layout), table, 16.0)
    states, _ = run(ProductsRate(table.layout), table, 16.0, damage)
    assert np.mean([s.nis for s in states[1400:1600]]) > 1.3 * np.mean([s.nis for s in healthy[1400:1600]])


def test_one_damaged_sample_is_refused_and_counted():
    table = TableTest(1)
    estimator = ProductsRate(table.layout)

    def damage(index, a):
        return a + 30.0 * (np.arange(12) == 7) if index == 1000 else a

    states, omegas = run(estimator, table, 12.0, damage)
    assert estimator.refused["products"] == 1
    assert states[1000].nis > 60.0
    assert np.rad2deg(np.abs(states[-1].omega_b - omegas[-1])).max() < 5.0


def test_missing_samples_are_bridged():
    table = TableTest(1)
    estimator, block = ProductsRate(table.layout), None
    for index in range(1300):
        if index % 1000 == 0:
            block = table.block(index // 1000)
        if 800 <= index < 820:
            estimator.skip(1)
            continue
        state = estimator.step(index, block.t_s[index % 1000], block.readings[index % 1000])
    assert np.rad2deg(np.abs(state.omega_b - block.omega_b[299])).max() < 4.0


def test_a_layout_that_does_not_see_the_products_is_refused():
    with pytest.raises(GeometryError, match="layout nine: 9 accelerometer axes observe only 6 of the 12"):
        ProductsRate(LAYOUTS["nine"](0.05))
    cube = CUBE(0.05)
    with pytest.raises(GeometryError, match="observe only 9 of the 12"):
        ProductsRate(Layout("flat", cube.r_b * [1, 1, 0], cube.theta_b, 0.05))
