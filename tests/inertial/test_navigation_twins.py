"""The core's navigation kernels against their numpy twins."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.estimator_drive import exact

from inertial.core import navigation as core
from inertial.navigation import fuzzy
from inertial.navigation.error_model import ImuNoise, make_model
from inertial.navigation.filters import FILTERS, Constraints
from tests.inertial.test_ins import run
from tests.inertial.twins import filter as twin

NOISE = ImuNoise(shake=0.0, turn=0.0)


def test_phi_is_that_of_the_differential_equation() -> None:
    truth, imu = exact(9.0)
    leg = run(truth[800], imu[800:900], make_model(NOISE))
    Phi, _ = twin.phi_and_q(truth[800], imu[800:900], NOISE.density(), NOISE.tau)
    size = np.repeat([1e-2, 1e-1, 1.0, 1e-2, 1e-4], 3)  # of errors as they are met
    assert np.abs((leg.transition() - Phi) * size / size[:, None]).max() < 1e-4


def test_q_is_that_of_the_differential_equation() -> None:
    """Trapezoids over half a second against one per sample: eight of them differ by a percent."""
    truth, imu = exact(8.0)
    leg = run(truth[300], imu[300:700], make_model(NOISE))
    _, Q = twin.phi_and_q(truth[300], imu[300:700], NOISE.density(), NOISE.tau)
    scale = np.sqrt(np.diag(Q))
    assert np.abs((leg.Q - Q) / np.outer(scale, scale)).max() < 0.02


def test_wheels_speak_of_the_rear_axle() -> None:
    truth, imu = exact(20.0)
    model = make_model(ImuNoise(), lag=True, car=True)
    leg = run(truth[1000], imu[1000:1100], model)
    x = leg.x
    x.mount_pitch, x.mount_yaw, x.axle = 0.02, -0.01, 1.3
    x.bias_gyro = [0.001, -0.002, 0.003]
    rules = FILTERS["huber-nhc"].constraints.core()
    z = leg.constraint(model, rules)
    last = leg.ticks[-1]
    omega_b = last.omega_b / last.length
    np.testing.assert_allclose(z.y, twin.wheels(x, omega_b), atol=1e-12)
    numeric = np.empty((2, model.states))
    for j, h in enumerate([1e-5] * 3 + [1e-3] * 3 + [1e-2] * 3 + [1e-4] * (model.states - 9)):
        ends = []
        for side in (h, -h):
            moved = run(truth[1000], imu[1000:1100], model)
            for name in ("mount_pitch", "mount_yaw", "axle", "bias_gyro"):
                setattr(moved.x, name, getattr(x, name))
            error = np.zeros(model.states)
            error[j] = side
            moved.reset(-error, model)
            ends.append(twin.wheels(moved.x, omega_b))
        numeric[:, j] = (ends[0] - ends[1]) / (2.0 * h)
    np.testing.assert_allclose(z.H, numeric, atol=1e-4)


@pytest.mark.parametrize(("car", "rows"), [(True, 6), (False, 6)])
def test_a_standstill_is_seen_and_only_then(car: bool, rows: int) -> None:
    rules = Constraints(car=car, standstill=True).core()
    truth, imu = exact(6.0, still=4.0)
    model = make_model(ImuNoise(), lag=True, car=car)
    still, under_way = run(truth[0], imu[:200], model), run(truth[500], imu[500:600], model)
    assert still.standing(rules) and not under_way.standing(rules)
    z = still.constraint(model, rules)
    assert len(z.y) == rows
    np.testing.assert_array_equal(z.y[:3], still.x.v_n)
    assert np.count_nonzero(z.H) == 6


@given(st.floats(9.0, 12.0), st.floats(0.0, 0.8), st.booleans())
@settings(deadline=None)
def test_the_fuzzy_rules(force: float, rate: float, minimum: bool) -> None:
    rules = fuzzy.FuzzyRules(minimum=minimum)
    expected = twin.crisp_horizon(force, rate, rules)
    assert fuzzy.horizon(force, rate, rules) == pytest.approx(expected, abs=1e-12)


def test_the_drag_filter_takes_axis_by_axis_what_the_twin_takes_at_once() -> None:
    draw = np.random.default_rng(3)
    A = draw.normal(size=(7, 7))
    x, P = draw.normal(size=7), A @ A.T + np.eye(7)
    noise, white = draw.uniform(0.1, 1.0, 6), draw.uniform(0.1, 1.0, 3)
    y, speed = draw.normal(size=3), draw.normal(size=3)
    filter_ = core.DragFilter(x=x, P=P)
    assert filter_.look(0.5, noise, y, speed, white, np.inf)
    x, P, nis = twin.drag_look(x, P, 0.5, noise, y, speed, white)
    np.testing.assert_allclose(filter_.x, x, atol=1e-12)
    np.testing.assert_allclose(filter_.P, P, atol=1e-12)
    drag = x[3:6]
    assert filter_.statistic() == pytest.approx(drag @ np.linalg.solve(P[3:6, 3:6], drag))
    before = core.DragFilter(x=filter_.x, P=filter_.P)
    again = (0.5, noise, y + 10.0, speed, white)
    assert not filter_.look(*again, 1e-3) and filter_ == before and nis > 0.0
