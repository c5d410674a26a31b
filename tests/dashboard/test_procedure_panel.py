"""The page of a procedure: what it shows of a run, and which orders it offers."""

import time

import viser

from dashboard.data.store import Store
from dashboard.scene.panels import PAGES, Snapshot
from dashboard.scene.panels.guided.procedure import ProcedurePanel, content, figure
from messages.bus.orders import Refused
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import PROCEDURE

M = pb.ProcedureStatus


def running(state=M.STATE_RUNNING, kind="rate") -> M:
    m = M(state=state, title="<i>x", instruction="Turn it", progress=0.25, session="s-1", unit="SN")
    m.header.device, m.header.utc_ns = "cube", 1_767_323_045_000_000_000
    m.offered[:] = ["published-30s", "six-poses"]
    step = m.steps.add(name="<b>fast", kind=kind, state=M.Step.STATE_DWELL, spoilt=1)
    step.trouble[:] = ["the <u>router is gone", "too much vibration: " + 20 * "much "]
    step.figures.add(name="rate_error_dps", value=2.0, sigma=0.1, min=-1.0, max=1.0)
    step.figures.add(name="vibration_mg", value=float("nan"), sigma=float("nan"))
    return m


def test_content_shows_steps_beside_their_limits_and_escapes_what_comes():
    page = content(running(), False, True)
    assert "&lt;b&gt;fast" in page and "&lt;i&gt;x" in page and "width:25%" in page
    assert "✗ error 2.00 ± 0.20 °/s (−1 to 1)" in page and "vibration –" in page
    assert "1× spoilt: too much vibration" in page and "the &lt;u&gt;router is gone; too" in page
    assert "/sessions/s-1" not in page
    assert "/sessions/s-1" in content(running(M.STATE_DONE), False, True)
    assert "silent" in content(running(), True, True)


def test_a_figure_with_one_limit_or_none():
    one = M.Figure(name="vibration_mg", value=3.0, sigma=float("nan"), max=5.0)
    assert "✓ vibration 3 mg (≤ 5)" in figure(one)
    free = M.Figure(name="force_error_mg", value=3.0, sigma=1.0)
    assert "✓" not in figure(free) and "3.0 ± 2.0 mg" in figure(free)


def test_orders_follow_the_state_and_the_stop_is_always_there(free_port):
    assert ProcedurePanel in PAGES
    server, store = viser.ViserServer(host="127.0.0.1", port=free_port, verbose=False), Store()
    try:
        page = ProcedurePanel(server, server.gui.add_folder("x"))

        def shown(m: M) -> set[str]:
            store.put(PROCEDURE, "cube", "", m)
            page.update(Snapshot(store, store.device("cube"), 0.0, 1.0, time.monotonic(), True))
            return {b.label for b in page._buttons.values() if b.visible} - {"EMERGENCY STOP"}

        idle = running(M.STATE_IDLE)
        assert shown(idle) == {"Start test"} and page._choice.value == "published-30s"
        assert page._unit.visible and not page._read.visible
        assert shown(running()) == {"Repeat step", "Abort test"} and not page._unit.visible
        assert "Done, go on" in shown(running(kind="open")) and page._read.visible
        assert "Leave step out" in shown(running(M.STATE_HELD))
        assert shown(running(M.STATE_DONE)) == {"Start test"}
        for m in (idle, running(), running(M.STATE_HELD)):
            shown(m)
            assert page._buttons[pb.ProcedureCommand.ACTION_STOP].visible
        assert len(page.orders) == 8

        given = []

        class Heard:
            def procedure(self, command):
                given.append(command)
                raise Refused("the procedures: not now")

        page.desk = Heard()
        page._unit.value, page.user = " SN-1 ", "anna"
        server.add_notification = lambda *_, **__: None  # a client has it
        page._order(pb.ProcedureCommand.ACTION_START)
        assert given[0].device == "cube" and (given[0].unit, given[0].user) == ("SN-1", "anna")
        assert given[0].procedure == "published-30s" and given[0].own_session
    finally:
        server.stop()
