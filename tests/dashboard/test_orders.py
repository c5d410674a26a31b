"""Every button of every page that gives an order: pressed as the browser presses it, the order
arrives.
"""

from types import SimpleNamespace

import pytest
import viser

from dashboard.scene.panels import PAGES
from messages.contract import gyrofree_pb2 as pb

ORDERING = ("Board", "Calibrate", "Map", "Wiring")
WITH_TESTS_OF_ITS_OWN = {"Procedure"}  # test_procedure_panel.py


class Desk:
    """Stands where a panel wants the dashboard's desk: keeps what it is told to pass on."""

    def __init__(self):
        self.given = []

    def estimator(self, command, timeout_s=0.0):
        self.given.append(command)
        return pb.Reply(ok=True, message="done")

    def board(self, device, command, timeout_s=0.0):
        self.given.append(command)
        return pb.Reply(ok=True, message="done")


@pytest.fixture
def server(free_port):
    server = viser.ViserServer(host="127.0.0.1", port=free_port, verbose=False)
    yield server
    server.stop()


@pytest.mark.parametrize("title", ORDERING)
def test_every_button_that_orders_gives_its_order(server, title):
    told = []
    client = SimpleNamespace(gui=server.gui, add_notification=lambda *a, **k: told.append(a))
    page = next(page for page in PAGES if page.title == title)(client, server.gui.add_folder(title))
    page.desk = Desk()
    page.chart(
        "one", "a chart", "m"
    )  # what a page draws must not stand in the way of what it orders
    buttons = [handle for handle in page.orders if isinstance(handle, viser.GuiButtonHandle)]
    assert buttons
    for button in buttons:
        before = len(page.desk.given)
        for pressed in button._impl.update_cb:
            pressed(SimpleNamespace(target=button))
        assert len(page.desk.given) > before, button.label
    assert len(told) >= len(buttons)


def test_no_page_is_left_out():
    assert {page.title for page in PAGES if "_order" in vars(page)} == set(
        ORDERING
    ) | WITH_TESTS_OF_ITS_OWN
