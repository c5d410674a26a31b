"""The board: what is wrong on it by name, what it counts, and orders to it. Orders are for
operators.
"""

import logging
import time

import viser

from dashboard.data.device import Device
from dashboard.scene.drawing.page import Markup, joined, note, rows, tag
from dashboard.scene.drawing.palette import age, number
from dashboard.scene.panels.base import Input, Panel, Snapshot
from messages.bus.orders import OrderError
from messages.contract import gyrofree_pb2 as pb
from messages.text import plain

log = logging.getLogger(__name__)

RATES = (
    50,
    100,
    200,
    400,
    500,
    800,
    1000,
    1600,
    3200,
)  # Hz; a board wants divisors of its timer's rate
BATCHES = {"automatic": 0, "1": 1, "2": 2, "4": 4, "8": 8, "16": 16}
SELF_TEST = (
    "stop",
    "self_test",
    "start",
)  # the sensors are deflected only while no samples are taken
BUTTONS = (  # label, orders in their turn, icon
    ("Start sampling", ("start",), viser.Icon.PLAYER_PLAY),
    ("Stop sampling", ("stop",), viser.Icon.PLAYER_STOP),
    ("Self-test of the sensors", SELF_TEST, viser.Icon.STETHOSCOPE),
)
COUNTERS = (  # of STATUS, under the words that people read
    ("frames built · dropped", ("built", "dropped")),
    ("samples · instants missed", ("samples", "missed_ticks")),
    ("orders heard · damaged", ("rx_ok", "rx_bad")),
    ("pulses of the receiver's clock", ("pps_total",)),
    ("receiver's bytes", ("gps_bytes",)),
    ("stack never used, bytes", ("free_stack",)),
)

IF_LOST = (
    "The self-test stops sampling, deflects the sensors and starts sampling again: three orders."
    " When this page or the link to the lab is lost between them, sampling stays stopped until"
    " somebody presses Start sampling."
)
LEAST = {"free_stack": 1}  # a board that does not know says 0


def faults(found: list[pb.Fault], now_ns: int) -> Markup:
    """Faults as HTML: those present first, those gone greyed."""
    parts = []
    for fault in sorted(found, key=lambda fault: (not fault.active, -fault.since_utc_ns)):
        since = max(0.0, (now_ns - fault.since_utc_ns) / 1e9)
        when = f"for {age(since)}" if fault.active else f"began {age(since)} ago, over now"
        style = "gf-alert" if fault.active else "gf-note gf-stale"
        words = f" {fault.text} · {when}"
        parts.append(tag("p", tag("b", fault.name), words, class_=style))
    return joined(parts)


class Board(Panel):
    """Faults, counters and orders of the chosen board."""

    title = "Board"
    workspace = "diagnose"
    _table = None

    @classmethod
    def missing(cls, device: Device) -> str:
        return "" if device.get("board") else "the board has not said yet who it is"

    def __init__(self, client: viser.ClientHandle, folder: viser.GuiFolderHandle) -> None:
        super().__init__(client, folder)
        self._device = ""
        gui, rates = client.gui, tuple(map(str, RATES))
        with folder:
            self._rate = gui.add_dropdown("Sample rate, Hz", rates, initial_value="100", order=2.0)
            self._batch = gui.add_dropdown(
                "Samples per frame", tuple(BATCHES), initial_value="automatic", order=4.0
            )
            set_rate = gui.add_button(
                "Set the sample rate", icon=viser.Icon.WAVE_SINE, color="gray", order=3.0
            )
            set_batch = gui.add_button(
                "Set the samples per frame", icon=viser.Icon.STACK, color="gray", order=5.0
            )
            set_rate.on_click(lambda _: self._order(("rate_hz",), int(self._rate.value)))
            set_batch.on_click(lambda _: self._order(("batch",), BATCHES[self._batch.value]))
            self._inputs = [self._rate, self._batch, set_rate, set_batch]
            for k, (label, orders, icon) in enumerate(BUTTONS):
                button = gui.add_button(label, icon=icon, color="gray", order=6.0 + k)
                button.on_click(lambda _, orders=orders: self._order(orders))
                self._inputs.append(button)

    @property
    def orders(self) -> tuple[Input, ...]:
        """Everything here: a viewer may not use it."""
        return tuple(self._inputs)

    def update(self, s: Snapshot) -> None:
        self._device = s.device.name
        latest = s.device.get("board")
        if latest is None:
            self._table = self.html(note("The board has not said yet who it is."), self._table)
            return
        m = latest.message
        said = faults(list(m.faults), time.time_ns()) or note("✓ no faults")
        busy = number(m.status["cpu_permille"] / 10, 1, "%") if "cpu_permille" in m.status else "–"
        items = [
            ("firmware", m.firmware),
            ("serial number", m.uid),
            ("axes · sample period", f"{m.axes} · {number(m.sample_period_s * 1e3, 3, 'ms')}"),
            ("processor busy", busy),
        ]
        for words, names in COUNTERS:
            if all(name in m.status for name in names):
                told = (
                    "–"
                    if name in LEAST and m.status[name] < LEAST[name]
                    else number(m.status[name], 0)
                    for name in names
                )
                items.append((words, " · ".join(told)))
        lost = note(IF_LOST)
        self._table = self.html(said + rows(items, s.stale("board")) + lost, self._table)

    def _order(self, names: tuple[str, ...], value: int = 0) -> None:
        texts, good = [], True
        try:
            for name in names:
                reply = self.desk.board(self._device, pb.BoardCommand(name=name, value=value))
                good = good and reply.ok
                texts.append(reply.message)
        except OrderError as error:  # shown to the person who pressed the button
            log.warning("board: %s", error)
            texts, good = [*texts, str(error)], False
        title = "Board" if good else "The board did not do it"
        self.client.add_notification(
            title, plain(" · ".join(texts)), color="teal" if good else "red", auto_close_seconds=8.0
        )
