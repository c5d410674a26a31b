"""The page of a guided calibration, and its orders through a real router to a running estimator."""

import re
import threading
import time

import numpy as np
import pytest
import viser

from dashboard.data.store import Store
from dashboard.desk import Desk
from dashboard.scene.panels import PAGES, Snapshot
from dashboard.scene.panels.guided.calibration import Calibration, content, facing, picture, upright
from estimator.pipeline import Pipeline
from estimator.settings import EstimatorSettings
from estimator.worker import Worker
from inertial.calibration.poses import candidates, plan
from messages.bus import orders
from messages.bus.session import BusSettings, open_client, open_router
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import ACCEL, CALIBRATION
from messages.history.mending_state import Arrival

STATE = pb.CalibrationStatus


@pytest.mark.parametrize("up_b", candidates())
def test_picture_shows_the_pose_with_its_side_up(up_b):
    np.testing.assert_allclose(upright(up_b) @ up_b, [0.0, 0.0, 1.0], atol=1e-12)
    R = facing(up_b, np.array([0.7, -0.5, 0.5]))
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(R @ up_b, [0.0, 0.0, 1.0], atol=1e-12)
    labels = re.findall(r">([+−][xyz])</text>", picture(up_b, True))
    wanted = {f"{'+' if v > 0 else '−'}{'xyz'[k]}" for k, v in enumerate(up_b) if abs(v) > 0.3}
    assert 1 <= len(labels) <= 3 and len(wanted & set(labels)) >= min(2, len(wanted))


def test_content_tells_state_and_escapes_what_comes_from_the_bus():
    status = STATE(
        state=STATE.STATE_TAKING,
        instruction="<b>hold",
        progress=0.5,
        next_up_b=[0, 0, 1],
        message="a&b",
    )
    status.poses.add(up_b=[0, 0, 1], samples=300)
    status.bias_sigma_mps2[:], status.scale_sigma[:] = [0.00980665, 0.001], [0.0005]
    page = content(status, False, True, "cube-1")
    assert "&lt;b&gt;hold" in page and "a&amp;b" in page and "<svg" in page and "width:50%" in page
    assert (
        "1.00 mg" in page
        and "0.050 %" in page
        and "not yet good enough" in page
        and "cube-1" in page
    )
    assert "silent" in content(status, True, True, "")
    assert "none: nominal" in content(STATE(), False, True, "")


def status_at(store, state, poses=0):
    status = STATE(header=pb.Header(device="cube", utc_ns=1_767_323_045_000_000_000), state=state)
    for up_b in plan(9)[:poses]:
        status.poses.add(up_b=up_b.tolist())
    store.put(CALIBRATION, "cube", "", status)


def test_buttons_follow_the_state_and_are_named_to_the_proxy(free_port):
    assert Calibration in PAGES
    server, store = viser.ViserServer(host="127.0.0.1", port=free_port, verbose=False), Store()
    try:
        page = Calibration(server, server.gui.add_folder("x"))
        assert len(page.orders) == 4

        def shown(state, poses=0):
            status_at(store, state, poses)
            page.update(Snapshot(store, store.device("cube"), 0.0, 1.0, time.monotonic(), True))
            return {button.label.split()[0] for button in page._buttons.values() if button.visible}

        assert shown(STATE.STATE_IDLE) == {"Start"}
        assert shown(STATE.STATE_WAITING, 2) == {"Cancel"}
        assert shown(STATE.STATE_WAITING, 9) == {"Fit", "Save", "Cancel"}
        assert shown(STATE.STATE_SAVED, 9) == {"Start"}
    finally:
        server.stop()


def test_orders_reach_a_running_worker(free_port, tmp_path):
    endpoint = f"tcp/127.0.0.1:{free_port}"
    bus = BusSettings(prefix="t", router=endpoint, listen=[endpoint])
    settings = EstimatorSettings(rate=["products-ekf"], navigators=[], attitudes=[], cards=tmp_path)
    stop, said = threading.Event(), []
    worker = Worker(Pipeline(settings), said.append)
    batch = pb.AccelBatch(
        header=pb.Header(device="cube", sequence=1), period_s=0.01, axes=12, f_mps2=[0.1] * 12
    )
    arrival = Arrival(ACCEL, "cube", "", batch.SerializeToString(), 0)
    thread = threading.Thread(target=worker.work, args=(stop,), daemon=True)
    thread.start()
    with open_router(bus), open_client(bus, timeout_s=20) as session:
        queryable = orders.take(session, bus.prefix, orders.ESTIMATOR, worker.take_order, "*")
        desk = Desk(session, bus.prefix)
        try:

            def order(action):
                deadline = time.monotonic() + 30.0
                while True:  # until the queryable is known
                    try:
                        return desk.estimator(pb.EstimatorCommand(device="cube", action=action))
                    except orders.NoAnswer:
                        assert time.monotonic() < deadline
                        time.sleep(0.05)

            reply = order(pb.EstimatorCommand.ACTION_CALIBRATE_START)
            assert (
                not reply.ok
                and reply.message == "cube: no accelerometer samples yet; connect the board first"
            )
            worker.offer(arrival)
            assert order(pb.EstimatorCommand.ACTION_CALIBRATE_START).ok
            assert said[-1].topic is CALIBRATION and said[-1].message.state == STATE.STATE_WAITING
            assert not order(pb.EstimatorCommand.ACTION_CALIBRATE_FIT).ok
        finally:
            queryable.undeclare()
            worker.finish()
            thread.join(timeout=10.0)
    assert not thread.is_alive() and worker.failure is None
