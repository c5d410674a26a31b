"""The page of a procedure: what it shows of a run, and which orders it offers."""

import contextlib
import time

import viser
import zstandard
from support.front_door import CAMERA, message, open_door
from support.waiting import until

from dashboard.data.store import Store
from dashboard.scene.panels import PAGES, Snapshot
from dashboard.scene.panels.guided.confirm import NO, YES
from dashboard.scene.panels.guided.confirm import content as before_start
from dashboard.scene.panels.guided.procedure import ProcedurePanel, content, figure
from dashboard.web.frame.scene_messages import Widgets
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
        assert not given and page._confirm.open  # it is asked once more
        shown(running())  # somebody else began a test meanwhile
        assert not page._confirm.open
        page._order(pb.ProcedureCommand.ACTION_ABORT)
        assert given[0].action == pb.ProcedureCommand.ACTION_ABORT and not page._confirm.open
    finally:
        server.stop()


class Browser:
    """What viser's page would know of its widgets, by the messages that come to it."""

    def __init__(self, scene) -> None:
        self._scene, self._widgets, self.text = scene, Widgets(()), ""

    def has(self, label: str) -> str:
        """The identifier of an input of that label; empty without."""
        with contextlib.suppress(TimeoutError):
            while True:
                data = self._scene.recv(timeout=0.05)
                self._widgets.learn(data)
                self.text += (
                    zstandard.ZstdDecompressor().decompress(data[16:]).decode(errors="replace")
                )
        known = self._widgets._known.items()
        return next((uuid for uuid, one in known if one.props.get("label") == label), "")

    def press(self, label: str) -> None:
        uuid = until(lambda: self.has(label), f"a button {label}")
        self._scene.send(message("GuiUpdateMessage", uuid=uuid, updates={"value": True}))


def test_a_test_that_moves_the_table_is_asked_for_once_more_in_the_browser(tmp_path):
    store, given = Store(), []
    idle = running(M.STATE_IDLE)
    idle.table, idle.if_lost = "turntable", "the table stands by itself after 2 s"
    idle.offers.add(name="published-30s", title="Published <test>", top_radps=3.0, seconds=30.5)
    store.put(PROCEDURE, "cube", "", idle)

    class Heard:
        def procedure(self, command):
            given.append(command)
            return pb.Reply(ok=True, message="started")

    with open_door(tmp_path) as door, door.client("otto") as client, door.scene(client) as scene:
        scene.send(message("ViewerCameraMessage", **CAMERA))
        mine = until(lambda: list(door.viser.get_clients().values()), "viser has a client")[-1]
        page, browser = ProcedurePanel(mine, mine.gui.add_folder("x")), Browser(scene)
        page.desk, page.user = Heard(), "otto"
        page.update(Snapshot(store, store.device("cube"), 0.0, 1.0, time.monotonic(), True))
        browser.press("Start test")
        assert until(lambda: browser.has(NO), "it asks") and not given
        for said in ("published-30s", "Published &lt;test&gt;", "172 °/s", "stands by itself"):
            assert said in browser.text
        assert "begins to turn" in browser.text and "turntable" in browser.text
        browser.press(NO)
        until(lambda: not page._confirm.open, "it asks no more")
        until(lambda: not browser.has(NO), "and the window is gone")
        assert not given
        page._unit.value = " SN-1 "
        browser.press("Start test")
        browser.press(YES)
        until(lambda: given, "the order")
        assert given[0].action == pb.ProcedureCommand.ACTION_START and given[0].own_session
        assert (given[0].device, given[0].unit, given[0].user) == ("cube", "SN-1", "otto")
        assert given[0].procedure == "published-30s" and len(given) == 1


def test_what_is_said_before_a_start_names_what_is_not_known():
    m = M(table="turntable", if_lost="it stands")
    own = before_start(m, "own", "")
    assert "not known here" in own and "begins to turn" in own
    m.offers.add(name="still", title="Still", steps=2, seconds=3601.0)
    m.offers.add(name="bad", fault="bad.toml:3: no key")
    still = before_start(m, "still", "")
    assert "begins to turn" not in still and "it stands still" in still and "60 min" in still
    assert "bad.toml:3" in before_start(m, "bad", "SN")
    assert "is not said" in before_start(M(), "own", "")
