"""The paper's estimator: exact on perfect data, honest about its drift on noisy data, loud about
bad data.
"""

import numpy as np
import pytest

from inertial.core import native
from inertial.layouts.catalogue import CUBE, LAYOUTS
from inertial.layouts.layout import GeometryError, Layout
from inertial.rate.estimators import ESTIMATORS, LeastSquaresRate
from inertial.rate.observed import sensor
from inertial.rate.products_model import squares
from inertial.rotation import multiply, to_matrix
from inertial.simulation.table import IDEAL, TableTest


def run(table, seconds=30.0, estimator=None, skip=()):
    """States and truths of every sample."""
    estimator = estimator or LeastSquaresRate(table.layout)
    states, omegas, block = [], [], None
    for index in range(int(seconds / table.period_s)):
        if index % 1000 == 0:
            block = table.block(index // 1000)
        row = index % 1000
        if index in skip:
            estimator.skip(1)
            continue
        states.append(estimator.step(index, block.t_s[row], block.readings[row]))
        omegas.append(block.omega_b[row])
    return states, np.array(omegas)


@pytest.mark.parametrize("name", ["cube", "nine", "edges-12", "stars-12"])
def test_perfect_data_give_the_truth_with_and_without_feedback(name):
    table = TableTest(1, sensor=IDEAL, layout=LAYOUTS[name](0.05))
    states, omegas = run(table, 16.0)
    omega = np.array([s.omega_b for s in states])
    np.testing.assert_allclose(omega[600:], omegas[600:], atol=4e-3)
    assert states[-1].angle_z == pytest.approx(np.deg2rad(-1539.0), abs=5e-3)


def test_perfect_data_give_the_position():
    states, _ = run(TableTest(1, sensor=IDEAL), 16.0)
    assert np.linalg.norm(states[-1].p_n) < 0.05


def test_drift_is_within_its_own_covariance():
    squares = []
    for seed in range(4):
        states, omegas = run(TableTest(seed), 14.0)
        for at in (900, 1350):
            e = states[at].omega_b - omegas[at]
            squares.append(e @ np.linalg.solve(states[at].P, e))
    assert (
        0.5 < np.mean(squares) < 8.0
    )  # 3 degrees of freedom, correlated in time; scale errors not in P


def test_biases_of_the_standstill_are_taken_away():
    table = TableTest(4)
    states, _ = run(table, 5.0)
    at_rest = table.bias + (table.scale - 1.0) * (table.layout.theta_b @ table.block(0).f_b[0])
    np.testing.assert_allclose(states[-1].bias[:3], (table.layout.S @ at_rest)[:3], atol=0.06)
    assert states[-1].phase == "still at the start"


def test_without_a_standstill_it_waits_and_says_so():
    table = TableTest(1, profile="wobble")
    estimator = LeastSquaresRate(table.layout)
    block = table.block(1)
    for row in range(200):
        state = estimator.step(row, block.t_s[row], block.readings[row])
    assert state.phase == "finding biases: keep still"
    assert state.P[2, 2] >= 100.0


def test_missing_samples_are_bridged():
    table = TableTest(1, sensor=IDEAL)
    states, omegas = run(table, 12.0, skip=range(700, 710))
    np.testing.assert_allclose(states[-1].omega_b, omegas[-1], atol=5e-3)


def test_a_long_silence_starts_anew():
    table = TableTest(1)
    estimator = LeastSquaresRate(table.layout)
    run(table, 8.0, estimator)
    state = estimator.step(900, 9.0, table.block(0).readings[900])
    assert state.phase == "finding biases: keep still"


def test_time_that_goes_back_is_refused():
    estimator = LeastSquaresRate(CUBE(0.05))
    estimator.step(0, 1.0, np.zeros(12))
    with pytest.raises(ValueError, match="time must grow"):
        estimator.step(1, 0.5, np.zeros(12))


@pytest.mark.parametrize("name", ESTIMATORS)
def test_axes_on_one_line_are_refused_by_every_estimator(name):
    line = Layout(
        "line", np.repeat([[0.0, 0, 0], [0.1, 0, 0]], 6, axis=0), np.tile(np.eye(3), (4, 1)), 0.1
    )
    with pytest.raises(GeometryError, match="place axes off one plane"):
        ESTIMATORS[name](line)


@pytest.mark.parametrize("name", ESTIMATORS)
def test_a_reading_that_is_no_number_is_refused_by_every_estimator(name):
    a = np.zeros(12)
    a[11] = np.nan
    with pytest.raises(ValueError, match="axis 12 of layout cube reads nan"):
        ESTIMATORS[name](CUBE(0.05)).step(0, 0.0, a)


def derivative(y, u, s):
    """dy/dt of (omega, q_nb, angle, v_n, p_n) by E-6, u = S a - bias."""
    omega, q = y[:3], y[3:7]
    x = u - np.vstack([s.SQ_alpha, s.SQ_force]) @ squares(omega)
    turned = 0.5 * multiply(q, np.concatenate([[0.0], omega]))
    force = to_matrix(q / np.linalg.norm(q)) @ x[3:] + np.array([0.0, 0.0, 9.80665])
    return np.concatenate([x[:3], turned, [omega[2]], force, y[8:11]])


def runge_kutta(y, before, after, s, dt):
    middle = 0.5 * (before + after)
    k1 = derivative(y, before, s)
    k2 = derivative(y + 0.5 * dt * k1, middle, s)
    k3 = derivative(y + 0.5 * dt * k2, middle, s)
    k4 = derivative(y + dt * k3, after, s)
    y = y + dt / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    y[3:7] /= np.linalg.norm(y[3:7])
    return y


@pytest.mark.parametrize("kind", ["cube", "edges-12"])
def test_the_core_integrates_as_the_equations_say(kind):
    s, draw = sensor(LAYOUTS[kind](0.05), 0.04), np.random.default_rng(7)
    for _ in range(20):
        y, before, after = draw.normal(size=14), draw.normal(size=6), draw.normal(size=6)
        y[3:7] /= np.linalg.norm(y[3:7])
        d = native.rate_derivative(y, before, s)
        np.testing.assert_allclose(d, derivative(y, before, s), rtol=1e-12, atol=1e-12)
        expected = runge_kutta(y, before, after, s, 0.01)
        said = native.rate_runge_kutta(y, before, after, s, 0.01)
        np.testing.assert_allclose(said, expected, rtol=1e-12, atol=1e-12)


def test_derivative_of_a_steady_turn():
    y = np.zeros(14)
    y[:4] = [0.0, 0.0, 2.0, 1.0]
    d = native.rate_derivative(y, np.zeros(6), sensor(CUBE(0.05), 0.04))
    np.testing.assert_allclose(d[3:7], [0.0, 0.0, 0.0, 1.0], atol=1e-15)
    assert d[7] == 2.0 and d[10] == 9.80665
