"""The products filter: derivatives, exactness, consistency, the published figures, faults."""

import os
import pickle
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support import rate_twin as twin

from inertial.core import native
from inertial.layouts.catalogue import CUBE, LAYOUTS
from inertial.layouts.layout import GeometryError, Layout
from inertial.rate import products_model as model
from inertial.rate.estimators import ESTIMATORS, LeastSquaresRate, ProductsRate
from inertial.rate.observed import sensor
from inertial.rate.products_ekf import Config, ProductsFilter, tuning
from inertial.rate.sight import AMBIGUOUS, BLIND, VALID
from inertial.simulation.profiles import PROFILES, TURNING
from inertial.simulation.table import IDEAL, TableTest

law = settings(deadline=None, max_examples=40)
numbers = st.floats(-5.0, 5.0)
states = st.lists(numbers, min_size=22, max_size=22).map(np.array)
vectors = st.lists(numbers, min_size=3, max_size=3).map(np.array)


def numeric(function, x, h=1e-5):
    """Central differences of function at x."""
    return np.stack(
        [(function(x + h * e) - function(x - h * e)) / (2 * h) for e in np.eye(len(x))], axis=1
    )


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
        out.append(
            (run(ProductsRate(table.layout), table), run(LeastSquaresRate(table.layout), table))
        )
    return out


SQ = np.random.default_rng(5).normal(size=(6, 6))  # of a layout with feedback
M = np.random.default_rng(6).normal(size=(6, 6))


@law
@given(x=states, alpha=vectors, turning=st.booleans())
def test_transition_jacobian_matches_central_differences(x, alpha, turning):
    dt = 0.002
    F = model.transition_jacobian(x, model.transition(x, alpha, SQ, dt, turning), SQ, dt, turning)
    expected = numeric(lambda x: model.transition(x, alpha, SQ, dt, turning), x)
    np.testing.assert_allclose(F, expected, atol=4e-4)  # second order in the turn of one sample


@law
@given(x=states)
def test_products_jacobian_matches_central_differences(x):
    expected = numeric(lambda x: model.measured_products(x, M), x)
    np.testing.assert_allclose(model.measured_products_jacobian(x, M), expected, atol=1e-6)


@law
@given(x=states, alpha=vectors)
def test_force_jacobian_matches_central_differences(x, alpha):
    expected = numeric(lambda x: model.measured_force(x, alpha, SQ), x)
    np.testing.assert_allclose(model.measured_force_jacobian(x, alpha, SQ), expected, atol=1e-6)


def covariance(seed):
    root = np.random.default_rng(seed).normal(size=(22, 22)) * 0.1
    return root @ root.T


def agrees(said, expected):
    """x, P and, where there was an innovation, NIS and density of the core and of its twin."""
    x, P, *likelihood = expected
    np.testing.assert_allclose(said[0], x, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(said[1], P, atol=1e-8)
    assert (said[1] == said[1].T).all()
    for a, b in zip(said[2:], likelihood, strict=False):
        assert a == pytest.approx(b, rel=1e-6)


@law
@given(x=states, alpha=vectors, seed=st.integers(0, 99), fixed=st.booleans())
def test_the_core_predicts_as_whole_matrices_do(x, alpha, seed, fixed):
    P, dt = covariance(seed), 0.01
    on_axis = fixed and bool(np.linalg.norm(x[:3]) > 0.1)
    for kind in ("edges-12", "cube"):
        s = sensor(LAYOUTS[kind](0.05), 0.04)
        for turning in (True, False):
            held = on_axis and turning and kind == "cube"
            said = native.rate_predict(x, P, alpha, dt, turning, held, False, s)
            agrees(said, twin.predict(x, P, alpha, s, dt, turning, held))


@law
@given(x=states, alpha=vectors, seed=st.integers(0, 99))
def test_the_core_corrects_as_whole_matrices_do(x, alpha, seed):
    P, t = covariance(seed), tuning(CUBE(0.05), Config())
    t.products_gate = t.force_gate = np.inf
    c_m, p, late = np.arange(6.0), np.arange(3.0), alpha + np.array([0.3, -0.2, 0.5])
    for kind in ("edges-12", "cube"):
        s = sensor(LAYOUTS[kind](0.05), 0.04)
        agrees(native.rate_by_products(x, P, c_m, False, s, t), twin.by_products(x, P, c_m, s))
        agrees(
            native.rate_by_force(x, P, p, alpha, late, True, s, t),
            twin.by_force(x, P, p, alpha, late, s, t),
        )
        agrees(
            native.rate_by_standstill(x, P, alpha, s, t), twin.by_standstill(x, P, alpha, s, t)[:2]
        )


@law
@given(x=states, alpha=vectors, seed=st.integers(0, 99))
def test_points_of_what_is_not_linear_are_those_of_all_states(x, alpha, seed):
    P, t, s = (
        covariance(seed),
        tuning(CUBE(0.05), Config()),
        sensor(LAYOUTS["edges-12"](0.05), 0.04),
    )
    t.products_gate, c_m = np.inf, np.arange(6.0)
    said = native.rate_predict(x, P, alpha, 0.01, True, False, True, s)
    agrees(said, twin.predict_unscented(x, P, alpha, s, 0.01))
    said = native.rate_by_products(x, P, c_m, True, s, t)
    agrees(said, twin.by_products_unscented(x, P, c_m, s))


def test_an_innovation_beyond_the_gate_changes_nothing():
    x, P, s, t = np.zeros(22), covariance(1), sensor(CUBE(0.05), 0.04), tuning(CUBE(0.05), Config())
    said = native.rate_by_products(x, P, np.full(6, 1e3), False, s, t)
    assert (said[0] == x).all() and (said[1] == P).all() and said[2] > t.products_gate


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
    """3 degrees of freedom; errors of one run hang together, so the band is for the mean over
    runs.
    """
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


def test_a_stuck_axis_shows_in_sigma():
    """Innovations that stay on one side make the filter forget, and its sigma grows."""
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
    sound, damaged = (
        np.mean([np.sqrt(np.trace(s.P)) for s in run[900:1300]]) for run in (healthy, states)
    )
    assert damaged > 1.3 * sound


@pytest.mark.parametrize("size", [8.0, 30.0])
def test_one_damaged_sample_is_refused_and_counted(size):
    """A jump of more than 10 m/s^2 is passed over; a smaller one is refused by the products."""
    table = TableTest(1)
    estimator = ProductsRate(table.layout)

    def damage(index, a):
        return a + size * (np.arange(12) == 7) if index == 1000 else a

    states, omegas = run(estimator, table, 12.0, damage)
    passed_over = estimator.core.native.refused_samples
    assert (passed_over, estimator.refused["products"]) == ((1, 0) if size > 10.0 else (0, 1))
    assert passed_over or states[1000].nis > 60.0
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


def test_a_layout_without_products_integrates_and_one_without_rate_is_refused():
    nine = LAYOUTS["nine"](0.05)
    table = TableTest(1, layout=nine, profile=PROFILES["published"])
    states, omegas = run(ProductsRate(nine), table, 8.0)
    assert states[-1].nis_dof == 0
    assert rms_deg(states, omegas).max() < 5.0
    cube = CUBE(0.05)
    with pytest.raises(GeometryError, match="observe only 4 of the 6 unknowns.*unseen: .*ω'x"):
        ProductsRate(Layout("five", cube.r_b[:5], cube.theta_b[:5], 0.05))


def test_a_flat_layout_uses_the_products_it_sees():
    cube = CUBE(0.05)
    flat = Layout("flat", cube.r_b * [1, 1, 0], cube.theta_b, 0.05)
    filtered = ProductsFilter(flat)
    assert 0 < filtered.sensor.m < 6
    table = TableTest(2, layout=flat)
    states, omegas = run(ProductsRate(flat), table, 16.0)
    assert rms_deg(states, omegas).max() < 4.0


@pytest.mark.parametrize("name", [name for name in ESTIMATORS if name != "least-squares"])
def test_every_filter_follows_the_published_test(name):
    table = TableTest(4)
    states, omegas = run(ESTIMATORS[name](table.layout), table, 12.0)
    assert rms_deg(states, omegas).max() < 2.0


@pytest.mark.parametrize("name", ["products-ekf", "products-ukf", "products-rls", "products-mhe"])
def test_a_batch_gives_the_bits_of_the_live_steps(name):
    table = TableTest(5, profile="wobble")
    block = table.block(0)
    live = ESTIMATORS[name](table.layout)
    states = [live.step(k, block.t_s[k], block.readings[k]) for k in range(800)]
    batch = ESTIMATORS[name](table.layout).run_batch(block.t_s[:800], block.readings[:800])
    assert batch.omega_b.tobytes() == np.array([s.omega_b for s in states]).tobytes()
    assert batch.q_nb.tobytes() == np.array([s.q_nb for s in states]).tobytes()
    with pytest.raises(ValueError, match="times that do not grow"):
        live.run_batch(block.t_s[:2][::-1], block.readings[:2])


def test_reversals_and_a_cube_off_the_axis_are_followed():
    for table in (
        TableTest(1, profile="reversals"),
        TableTest(2, centre_b=(0.2, 0.1, 0.0)),
        TableTest(3, tilt=np.deg2rad(10.0)),
    ):
        track = ProductsRate(table.layout).run_batch(
            *(
                np.concatenate([getattr(table.block(k), what) for k in range(3)])
                for what in ("t_s", "readings")
            )
        )
        truth = np.concatenate([table.block(k).omega_b for k in range(3)])
        assert np.rad2deg(np.sqrt(np.mean((track.omega_b - truth) ** 2, axis=0))).max() < 2.0


def test_a_start_while_turning_is_ambiguous_until_the_motion_tells_the_sign():
    table = TableTest(1, profile=TURNING)
    states, omegas = run(ProductsRate(table.layout), table, 16.0)
    assert states[3].sight == (BLIND,) * 3 and "keep still" in states[3].sight_reason
    assert states[12].sight == (AMBIGUOUS,) * 3 and "not told apart yet" in states[12].sight_reason
    assert states[40].sight[2] == AMBIGUOUS and "began while turning, at" in states[40].sight_reason
    seen = [s.sight[2] for s in states]
    assert AMBIGUOUS in seen and VALID in seen[300:]
    assert np.rad2deg(np.abs(states[-1].omega_b - omegas[-1])).max() < 6.0


def test_rate_about_an_axis_that_products_do_not_see_becomes_blind():
    table = TableTest(1, profile="slow")
    states, _ = run(LeastSquaresRate(table.layout), table, 20.0)
    assert states[300].sight == (VALID,) * 3
    assert states[-1].sight == (BLIND,) * 3 and "integration only" in states[-1].sight_reason


def test_a_filter_goes_on_without_an_axis_and_takes_it_back():
    table = TableTest(1)
    estimator, errors, sigmas = ProductsRate(table.layout), [], []
    for number in range(3):
        block = table.block(number)
        for row in range(1000):
            index = number * 1000 + row
            reading = block.readings[row].copy()
            if 800 <= index < 2000:
                estimator.exclude(0b100)
                reading[2] = 30.0  # nobody may look at it
            elif index == 2000:
                estimator.exclude(0)
            state = estimator.step(index, block.t_s[row], reading)
            errors.append(np.rad2deg(state.omega_b - block.omega_b[row]))
            sigmas.append(np.sqrt(np.diag(state.P)).max())
        assert state.excluded == (0b100 if number == 1 else 0) or number == 0
    assert np.sqrt(np.mean(np.square(errors[800:]), axis=0)).max() < 3.0
    assert sigmas[810] > sigmas[790]
    with pytest.raises(GeometryError, match="unseen"):
        estimator.exclude(0b111111111)


def test_a_body_that_turns_freely_is_not_held_to_an_axis():
    """Readings of a body whose axis wanders: written from E-1, gravity turning with it."""
    cube, dt, omega, rows, truth = CUBE(0.05), 0.01, np.zeros(3), [], []
    up, draw = np.array([0.0, 0.0, 9.80665]), np.random.default_rng(1)
    for k in range(1500):
        t = k * dt - 4.0
        new = (
            np.array([1.5 * np.sin(1.3 * t), 1.2 * np.sin(0.9 * t), 2.5 * np.sin(0.7 * t)])
            if t > 0
            else np.zeros(3)
        )
        alpha = (new - omega) / dt
        up = up - dt * np.cross(0.5 * (omega + new), up)
        up *= 9.80665 / np.linalg.norm(up)
        omega = new
        rows.append(
            cube.J @ np.concatenate([alpha, up]) + cube.quadratic(omega) + draw.normal(0, 0.04, 12)
        )
        truth.append(omega)
    track = ProductsRate(cube).run_batch(dt * np.arange(1500), np.array(rows))
    error = np.rad2deg(track.omega_b - truth)[600:]
    assert np.sqrt(np.mean(error**2, axis=0)).max() < 3.0


@pytest.mark.parametrize("name", ESTIMATORS)
def test_a_pickled_estimator_goes_on_to_the_bit(name):
    table = TableTest(6)
    block = table.block(0)
    estimator = ESTIMATORS[name](table.layout)
    estimator.feed(block.t_s[:700], block.readings[:700])
    estimator.exclude(0b100)
    estimator.feed(block.t_s[700:720], block.readings[700:720])
    again = pickle.loads(pickle.dumps(estimator))
    one, other = (e.feed(block.t_s[720:], block.readings[720:]) for e in (estimator, again))
    for field in ("omega_b", "P", "q_nb", "p_n", "nis", "bound_sigma", "phase"):
        assert getattr(one, field).tobytes() == getattr(other, field).tobytes()
    assert one.excluded == other.excluded == 0b100


def test_the_state_of_another_version_is_refused():
    core = ProductsFilter(CUBE(0.05))
    with pytest.raises(ValueError, match="another version"):
        core.native.restore(core.native.snapshot() + b"x")


@pytest.mark.parametrize("name", ["products-ekf", "products-ukf", "products-mhe"])
def test_both_builds_of_the_core_give_the_same_bits(name):
    """In a process of its own each: GYROFREE_CORE names the build."""
    said = {
        subprocess.run(
            [sys.executable, "-c", DIGEST.format(name=name)],
            env={**os.environ, "GYROFREE_CORE": build},
            check=True,
            capture_output=True,
            text=True,
        ).stdout
        for build in ("plain", "")
    }
    assert len(said) == 1 and len(said.pop().strip()) == 64


DIGEST = """
import hashlib
from inertial.rate.estimators import ESTIMATORS
from inertial.simulation.table import TableTest
table = TableTest(5, profile="wobble")
block = table.block(0)
rows = ESTIMATORS["{name}"](table.layout).feed(block.t_s, block.readings)
digest = hashlib.sha256()
for field in ("omega_b", "P", "q_nb", "p_n", "v_n", "nis", "bias", "bound_sigma", "sight"):
    digest.update(getattr(rows, field).tobytes())
print(digest.hexdigest())
"""


def test_a_lost_sample_costs_no_more_than_a_sample():
    """Every tenth sample missing: the rate is as good as with all of them."""
    table = TableTest(seed=4)
    blocks = [table.block(k) for k in range(3)]
    t_s, readings, omega = (
        np.concatenate([getattr(b, name) for b in blocks])
        for name in ("t_s", "readings", "omega_b")
    )
    whole, lossy = (ProductsRate(CUBE(0.05)) for _ in range(2))
    full = whole.feed(t_s, readings).omega_b - omega
    kept = np.arange(len(t_s)) % 10 != 3
    errors = []
    for first in range(0, len(t_s), 10):
        rows = np.arange(first, min(first + 10, len(t_s)))
        for part in (rows[:3], rows[4:]):
            if part[0] % 10 == 4:
                lossy.skip(1)
            errors.append(lossy.feed(t_s[part], readings[part]).omega_b - omega[part])
    lost = np.concatenate(errors)
    assert len(lost) == kept.sum()
    assert np.sqrt(np.mean(lost**2)) < 1.25 * np.sqrt(np.mean(full**2))
