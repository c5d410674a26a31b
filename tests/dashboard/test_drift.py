"""Unaided navigation beside equation (27), and what moves in the scene for which kind of device."""

import time

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dashboard.data.store import Store
from dashboard.scene.drawing import geometry as geo
from dashboard.scene.drawing.palette import estimator_title
from dashboard.scene.panels import Snapshot
from dashboard.scene.panels.navigation import drift
from messages.contract import gyrofree_pb2 as pb
from messages.contract import topics as tp

UTC = 1_750_000_000_000_000_000
B, D = 0.05, np.radians(0.2)  # m/s^2, rad/s


def header(t):
    return pb.Header(device="cube", utc_ns=UTC + round(t * 1e9), device_us=round(t * 1e6))


def q_of(yaw):
    x, y, z, w = Rotation.from_euler("z", yaw).as_quat()
    return [w, x, y, z]


def store_of(turn):
    """A cube that stands 5 s, then drifts by the closed form while it drives north; own heading off
    by turn.
    """
    store = Store()
    own = Rotation.from_euler("z", -turn)
    for k in range(300):
        t = 0.1 * k
        tau = max(0.0, t - 5.0)
        true = np.array([2.0 * tau, 0.0, 0.0])
        wrong = np.array([0.0, 0.5 * B * tau**2 + 9.80665 * D * tau**3 / 6.0, 0.0])
        p = own.apply(true + wrong)
        rate = pb.RateBatch(header=header(t), p_n_m=p, q_nb=q_of(-turn), f_b_mps2=[0, 0, -9.8])
        store.put(tp.ACCEL, "cube", "", pb.AccelBatch(header=header(t)))
        store.put(tp.RATE, "cube", "products-free", rate)
        nav = pb.NavSolution(
            header=header(t),
            mode=pb.NavSolution.MODE_NAVIGATING,
            p_ned_m=true,
            v_n_mps=[2, 0, 0],
            q_nb=q_of(0.0),
            bias_f_b_mps2=[0.0, B, 0.3],
            bias_omega_b_radps=[-D, 0.0, 0.1],
            sigma=[0.1] * 15,
            fix_age_s=4.0,
        )
        store.put(tp.NAV, "cube", "gyro-free-huber", nav)
    return store


def snapshot(store, t0=0.0):
    return Snapshot(store, store.device("cube"), t0, 30.0, time.monotonic(), True)


@pytest.mark.parametrize("turn", [0.0, 1.1])
def test_measured_drift_meets_the_closed_form_whatever_its_own_heading(turn):
    found = drift.unaided(snapshot(store_of(turn)), "products-free", "gyro-free-huber")
    assert found.since == pytest.approx(5.1)
    expected = 0.5 * B * 24.9**2 + 9.80665 * D * 24.9**3 / 6.0
    assert found.error[-1] == pytest.approx(expected, rel=0.01)
    assert found.predicted[-1] == pytest.approx(found.error[-1], rel=0.03)
    assert found.equivalent == pytest.approx(D, rel=0.03)
    text = "".join(label + value for label, value in drift.table_of(found))
    assert "5.1 mg" in text and "0.20 °/s" in text and "°/h" in text


def test_nothing_is_said_of_a_drift_that_began_before_the_window():
    assert (
        drift.unaided(snapshot(store_of(0.0), t0=10.0), "products-free", "gyro-free-huber") is None
    )


def test_an_outage_is_foretold_from_the_sigmas():
    m = pb.NavSolution(sigma=[0.0] * 9 + [B] * 3 + [D] * 3, fix_age_s=10.0)
    t, error = drift.outage(m, 100.0)
    assert t[0] == pytest.approx(90.0) and t[-1] == pytest.approx(100.0)
    assert error[-1] == pytest.approx(0.5 * B * 100 + 9.80665 * D * 1000 / 6.0)
    assert drift.outage(pb.NavSolution(), 1.0) is None


def test_a_cube_that_navigates_stays_a_cube_and_a_tilt_board_is_neither():
    cube = store_of(0.0).device("cube")
    assert cube.navigates and not cube.is_vehicle and cube.body == "rate"
    store = Store()
    store.put(tp.ADC, "board", "", pb.AdcBatch(header=header(0.0)))
    store.put(tp.ATTITUDE, "board", "vqf", pb.AttitudeEstimate(header=header(0.0), q_nb=q_of(0.3)))
    assert store.device("board").body == "attitude"
    store.put(tp.NAV, "board", "kf", pb.NavSolution(header=header(0.0)))
    assert store.device("board").body == "nav"
    assert estimator_title("gyro-free-huber") == "gyro-free, robust"


def test_heading_of_another():
    tilt = Rotation.from_euler("ZYX", [0.4, 0.2, -0.3]).as_quat()[[3, 0, 1, 2]]
    x = np.array(geo.facing(list(tilt), q_of(2.0)))
    np.testing.assert_allclose(
        Rotation.from_quat(x[[1, 2, 3, 0]]).as_euler("ZYX"), [2.0, 0.2, -0.3], atol=1e-9
    )
    assert geo.facing([], q_of(0.0)) is None
