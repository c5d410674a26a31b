"""How much one browser's view may become, whatever the bus names: charts, curves, bodies, axes."""

import contextlib
from types import SimpleNamespace

import pytest
import viser
from support.feeder import Feeder

from dashboard.data.store import Store
from dashboard.desk import Desk
from dashboard.scene.drawing import axis_arrows
from dashboard.scene.panels import PAGES
from dashboard.scene.panels.base import CHARTS, CURVES
from dashboard.scene.scene import MOST
from dashboard.scene.view import View
from messages.contract import topics as tp
from tests.dashboard.test_health import health
from tests.dashboard.test_hostile import Gui
from tests.dashboard.test_scene import Direct


class Renamed(Direct):
    """The same messages under the names of many estimators."""

    def __init__(self, store: Store, names: list[str]) -> None:
        super().__init__(store)
        self._names = names

    def put(self, topic, device, message, estimator="") -> None:
        for name in self._names if estimator else [""]:
            super().put(topic, device, message, estimator and f"{name}-{estimator}")


@pytest.fixture
def server():
    running = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    yield running
    running.stop()


def view_of(server, store: Store) -> tuple[View, Gui]:
    gui = Gui(server.gui)
    client = SimpleNamespace(
        gui=gui,
        scene=server.scene,
        camera=SimpleNamespace(fov=1.0, aspect=1.0),
        atomic=contextlib.nullcontext,
    )
    return View(client, store, Desk(None, "gyrofree")), gui


def test_many_estimators_and_many_devices_make_a_bounded_view(server):
    store = Store()
    for number in range(3):  # each device with estimators of its own names
        feeder = Feeder(Renamed(store, [f"e{number}{k}" for k in range(20)]))
        for k in range(12):
            feeder.cube(k * 0.01, device=f"cube-{number}")
            feeder.drive(k * 0.01, device=f"car-{number}")
    view, gui = view_of(server, store)
    most = 0
    for name in store.names():
        view._choose(name, by_person=True)
        for page in range(len(PAGES)):
            view._choose_page(page)
            view.tick_panels()
        view.tick_scene()
        bodies = [path for path in view.scene._nodes if path.endswith("/body")]
        assert len(bodies) <= MOST
        most = max(most, len(gui.handles))
    assert all(len(page._charts) <= CHARTS for page in view._pages)
    assert most < (CHARTS + 3) * len(PAGES)
    plots = [chart._plot for page in view._pages for chart in page._charts.values() if chart._plot]
    assert plots and all(len(plot.series) <= 3 * CURVES + 10 for plot in plots)


def test_a_thousand_axes_are_neither_drawn_nor_listed(server):
    store, message = Store(), health()
    for k in range(988):
        message.axes.add().CopyFrom(message.axes[0])
        message.axes[-1].name = f"x{k}"
    feeder = Feeder(Direct(store))
    for k in range(30):
        feeder.cube(k * 0.01)
    store.put(tp.AXES, "cube-01", "", message)
    view, gui = view_of(server, store)
    view._choose_page([page.title for page in PAGES].index("Health"))
    view.tick_panels()
    view.tick_scene()
    assert len(view.scene._arrows._labels) <= axis_arrows.MOST
    [table] = [handle.content for handle in gui.handles if "axes more" in handle.content]
    assert "and 936 axes more" in table and table.count("<tr") < 200


def test_charts_of_another_device_are_not_left_standing(server):
    store = Store()
    feeder = Feeder(Direct(store))
    for k in range(60):
        feeder.cube(k * 0.01)
        feeder.drive(k * 0.01)
    view, _ = view_of(server, store)
    view._choose_page([page.title for page in PAGES].index("NIS"))
    page = view._pages[view._page]
    seen = {}
    for name in ("car-01", "cube-01"):
        view._choose(name, by_person=True)
        view.tick_panels()
        seen[name] = {key for key, chart in page._charts.items() if chart._heading.content}
        drawn = {key for key, chart in page._charts.items() if chart._plot and chart._plot.visible}
        assert drawn <= seen[name]
    assert seen["car-01"] and not seen["car-01"] & seen["cube-01"]
