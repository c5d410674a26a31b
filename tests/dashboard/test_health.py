"""Axis health on the screen, and the layout bench: what is shown follows what was said or moved."""

import time

import numpy as np
import pytest
import viser
from support.stack import free_port

from dashboard.data.store import Store
from dashboard.scene.drawing.axis_arrows import AxisArrows, residual_colour
from dashboard.scene.drawing.palette import GREY, SKY, VERMILLION, YELLOW
from dashboard.scene.panels.base import Snapshot
from dashboard.scene.panels.device.health import Health
from dashboard.scene.panels.device.layout import LayoutBench, figures
from inertial.layouts.catalogue import CUBE
from inertial.layouts.quality import analyse
from messages.contract import gyrofree_pb2 as pb
from messages.contract import topics as tp

UTC = 1_700_000_000_000_000_000


def health(**spoilt: object) -> pb.AxisHealth:
    """All twelve axes good, but a21 as given."""
    cube = CUBE(0.05)
    message = pb.AxisHealth(
        header=pb.Header(device="cube", utc_ns=UTC), layout="cube", scale_m=0.05, chi2=1.2, dof=6
    )
    for i, name in enumerate(cube.axis_names):
        message.axes.add(
            name=name,
            residual_mps2=0.01,
            residual_sigma_mps2=0.03,
            since_utc_ns=UTC,
            position_b_m=cube.r_b[i],
            direction_b=cube.theta_b[i],
        )
    for key, value in spoilt.items():
        setattr(message.axes[3], key, value)
    return message


class Shown(Health):
    """Keeps the HTML instead of sending it."""

    def html(self, content, handle):
        self.text = content


def page(message: pb.AxisHealth) -> str:
    store = Store()
    store.put(tp.AXES, "cube", "", message)
    shown = Shown(None, None)
    shown.update(Snapshot(store, store.device("cube"), 0.0, 1.0, time.monotonic(), True))
    return shown.text


@pytest.mark.parametrize(
    ("spoilt", "colour"),
    [
        ({}, SKY),
        ({"residual_mps2": 0.07}, YELLOW),
        ({"residual_mps2": -0.2}, VERMILLION),
        ({"state": pb.AxisHealth.STATE_SUSPECT}, VERMILLION),
        ({"state": pb.AxisHealth.STATE_STUCK, "excluded": True}, GREY),
    ],
)
def test_colour_of_an_axis(spoilt, colour):
    assert residual_colour(health(**spoilt).axes[3]) == colour


def test_the_page_names_the_fault_and_since_when():
    state = pb.AxisHealth.STATE_STUCK
    text = page(
        health(
            state=state,
            excluded=True,
            since_utc_ns=UTC - 7_000_000_000,
            text="reads the same <again>",
        )
    )
    assert "11 of 12 good, a21 stuck" in text and "stuck, not used" in text and "7.0 s" in text
    assert "&lt;again&gt;" in text and text.count("<tr>") == 12 + 2
    assert "12 of 12 good" in page(health())


@pytest.fixture
def scene():
    server = viser.ViserServer(host="127.0.0.1", port=free_port(), verbose=False)
    yield server.scene
    server.stop()


def test_an_excluded_axis_becomes_hollow_and_comes_back(scene):
    arrows = AxisArrows(scene, {}, "/body")
    assert len(arrows._parts) == 1 and arrows._parts[0].points.shape == (12, 2, 3)
    arrows.update(health(state=pb.AxisHealth.STATE_STUCK, excluded=True))
    solid, hollow = arrows._parts
    assert solid.points.shape == (11, 2, 3) and len(hollow.points) == 8
    assert arrows._labels["a21"].text == "a21 ✕"
    arrows.update(health())
    assert len(arrows._parts) == 1 and arrows._labels["a21"].text == "a21"


def test_moving_a_sensor_on_the_bench_changes_its_figures():
    bench = LayoutBench(None, None)
    before = analyse(bench.layout)
    triad = [0, 1, 2]
    bench.move(triad, 0.5 * bench.layout.r_b[triad], 2.0 * bench.layout.theta_b[triad])
    after = analyse(bench.layout)
    assert after.gdop > before.gdop and after.feedback_alpha
    np.testing.assert_allclose(np.linalg.norm(bench.layout.theta_b, axis=1), 1.0)
    assert f"{after.gdop:.4f}" in figures(after, before) and "(cube 1.0607)" in figures(
        after, before
    )
