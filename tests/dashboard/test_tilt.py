"""The tilt page: what its horizon and its numbers say of an attitude."""

import math
import re
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dashboard.data.pose import roll_pitch
from dashboard.data.store import Store
from dashboard.scene.drawing.horizon import between, horizon_svg
from dashboard.scene.panels.device.devices import Devices
from dashboard.scene.panels.motion.tilt import Tilt
from messages.contract import gyrofree_pb2 as pb
from messages.contract import topics as tp


def q_of(yaw: float, pitch: float, roll: float) -> list[float]:
    x, y, z, w = Rotation.from_euler("ZYX", [yaw, pitch, roll], degrees=True).as_quat()
    return [w, x, y, z]


def feed(store: Store, n: int = 100) -> None:
    for k in range(n):
        for name, roll in (("vqf", 20.0), ("tilt-published", 23.0)):
            header = pb.Header(device="board", utc_ns=1_750_000_000_000_000_000 + k * 20_000_000)
            q = q_of(50.0, -10.0, roll)
            message = pb.AttitudeEstimate(
                header=header, estimator=name, q_nb=q, bias_omega_b_radps=[0.01, 0.0, 0.0]
            )
            store.put(tp.ATTITUDE, "board", name, message)
        adc = pb.AdcBatch(
            header=pb.Header(device="board", utc_ns=header.utc_ns),
            channels=5,
            counts=[1, 2, 3, 4, k],
        )
        adc.period_s = 0.02
        store.put(tp.ADC, "board", "", adc)


@pytest.mark.parametrize(("pitch", "roll"), [(0.0, 0.0), (25.0, -40.0), (-80.0, 170.0)])
def test_roll_and_pitch_do_not_see_heading(pitch, roll):
    for yaw in (0.0, 123.0):
        assert np.degrees(roll_pitch(q_of(yaw, pitch, roll))) == pytest.approx(
            [roll, pitch], abs=1e-9
        )


def test_the_angle_between_two_verticals():
    assert math.degrees(between(q_of(10.0, 5.0, 0.0), q_of(80.0, 5.0, 0.0))) == pytest.approx(
        0.0, abs=1e-6
    )
    assert math.degrees(between(q_of(10.0, 5.0, 0.0), q_of(80.0, -7.0, 0.0))) == pytest.approx(12.0)


def test_the_horizon_turns_against_the_roll_and_sinks_with_the_nose():
    svg = horizon_svg(math.radians(20.0), math.radians(10.0), False)
    turn, lift = re.search(r"rotate\((-?[\d.]+)\) translate\(0 (-?[\d.]+)\)", svg).groups()
    assert (
        float(turn) == -20.0
    )  # the right wing is down, so the horizon's right end is up on the screen
    assert float(lift) > 0.0  # nose up: the horizon lies below the middle, and y grows downwards
    assert "roll +20.0 degrees, pitch +10.0 degrees" in svg and "gf-stale" not in svg
    assert "gf-stale" in horizon_svg(0.0, 0.0, True)


def test_the_store_keeps_tilt_and_counts():
    store = Store()
    feed(store)
    device = store.device("board")
    t, rows = device.window("attitude", "vqf", 0.0, 10.0)
    assert len(t) == 100
    assert np.degrees([rows["roll"][-1], rows["pitch"][-1]]) == pytest.approx([20.0, -10.0])
    t, counts = device.window("adc", "", 0.0, 10.0)
    assert counts["counts"][-1, :5].tolist() == [1, 2, 3, 4, 99]
    store.put(
        tp.ADC,
        "board",
        "",
        pb.AdcBatch(header=pb.Header(device="board", utc_ns=5), channels=0, counts=[1]),
    )


def test_the_page_says_what_the_fixed_weight_costs():
    store = Store()
    feed(store)
    device = store.device("board")
    s = SimpleNamespace(device=device, stale=lambda *_: False)
    html = Tilt._head(s, ["vqf", "tilt-published"])
    assert "VQF: roll, pitch" in html and "20.0 °" in html and "−10.0 °" in html
    assert "2.95 °" in re.sub(r"<[^>]+>", " ", html)
    assert "needs a board" in Tilt._head(s, [])


def test_the_summary_has_a_tile_of_each_filter():
    store = Store()
    feed(store)
    s = SimpleNamespace(device=store.device("board"), stale=lambda *_: False)
    text = re.sub(r"<[^>]+>", " ", Devices._board(s))
    assert "20.0 / −10.0" in text and "23.0 / −10.0" in text and "roll / pitch" in text
