"""Below the summary: where the recording or the replay stands, notes and marks, and the replay's
controls.
"""

import logging
import time
from collections.abc import Callable
from typing import Any

import viser

from dashboard.data.store import Store
from dashboard.desk import Desk
from dashboard.scene.drawing.page import EMPTY, Markup, joined, note, tag
from dashboard.scene.panels.base import Input
from messages.bus.orders import OrderError
from messages.contract import gyrofree_pb2 as pb
from messages.text import counted, plain

log = logging.getLogger(__name__)

SPEEDS = ("0.1×", "0.25×", "0.5×", "1×", "2×", "5×", "10×", "50×", "100×")
STALE_S = 2.0
SHOWN_MARKS = 6
MOVES = ("start", "−10 s", "◂ step", "play / pause", "step ▸", "+10 s")
KEYS = {"play": "play / pause", "back": "◂ step", "on": "step ▸"}
HOLD_S = 1.0  # after a person's hand on the slider, the replay's position does not move it


class Timeline:
    """Live: time since the recording began, and what is noted. Replay: a slider, keys, speed, steps
    and a loop.
    """

    short = False  # on a phone: the line of a recording is in the bar

    def __init__(
        self,
        client: viser.ClientHandle,
        desk: Desk,
        store: Store,
        chosen: Callable[[], str],
    ) -> None:
        """`chosen` names the device that this browser shows, which a note is about."""
        self._client, self._desk, self._store, self._chosen = client, desk, store, chosen
        self._touched = 0.0
        gui = client.gui
        self._state = gui.add_html("")
        self._live: tuple = (None, EMPTY)  # what the recorder said last, in words
        self._slider = gui.add_slider(
            "Position, s",
            0.0,
            1.0,
            0.1,
            0.0,
            visible=False,
            hint="Seconds since the recording began",
        )
        self._slider.on_update(lambda event: self._slid(event))
        self._buttons = gui.add_button_group("Replay", MOVES, visible=False)
        self._buttons.on_click(lambda _: self._press(self._buttons.value))
        self._speed = gui.add_dropdown("Speed", SPEEDS, initial_value="1×", visible=False)
        self._speed.on_update(lambda event: self._set_speed(event))
        loops = ("from here", "until here", "off")
        self._loop = gui.add_button_group("Loop", loops, visible=False)
        self._loop.on_click(lambda _: self._set_loop(self._loop.value))
        self._replay_inputs = (self._slider, self._buttons, self._speed, self._loop)
        self._showing: bool | None = None
        self._barred = False

    @property
    def orders(self) -> tuple[Input, ...]:
        """The elements a viewer may not use."""
        return self._replay_inputs

    def update(self, now: float) -> None:
        """Show the newest state. Call under the store's lock."""
        replay = self._store.replay
        running = replay.age(now) < STALE_S
        if self._showing != running:
            self._showing = running
            self._show_inputs()
        live = EMPTY if self.short else self._live_html(now)
        content = self._replay_html(replay.status) if running else live
        if running and self._barred:
            content += note("Its controls take the role operator; you look as viewer.")
        content += self._marks_html()
        if self._state.content != content:
            self._state.content = str(content)
        if running and now - self._touched > HOLD_S:
            self._slide(replay.status)

    # --- what is shown

    def _slide(self, m: pb.ReplayStatus) -> None:
        """Bring the slider to the replay's position; its length first, which bounds the values it
        takes.
        """
        length = max(round(m.length_s, 1), 0.1)
        if self._slider.max != length:
            self._slider.max = length
        value = min(max(round(m.position_s, 1), 0.0), length)
        if self._slider.value != value:
            self._slider.value = value

    @staticmethod
    def _replay_html(m: pb.ReplayStatus) -> Markup:
        loop = (
            f" · loop {clock(m.loop_from_s)} to {clock(m.loop_until_s)}"
            if m.loop_until_s > m.loop_from_s
            else ""
        )
        state = "❚❚ paused" if m.paused else f"▶ {m.speed:g}×"
        position = clock(m.position_s, 3 if m.paused else 1)  # a step is one sample
        said = joined([" · ", tag("b", m.message)]) if m.message else ""
        words = f" {m.session} · {position} of {clock(m.length_s)} · {state}{loop}"
        return note(tag("b", "Replay"), words, said)

    def _live_html(self, now: float) -> Markup:
        latest = self._store.recorder
        if latest is None or latest.age(now) > 3.0:
            return note(tag("b", "Live"), " · nothing is heard of the recorder")
        if self._live[0] is not latest:  # it speaks once a second
            self._live = latest, self._recorded_html(latest.message)
        return self._live[1]

    @staticmethod
    def _recorded_html(m: pb.RecorderStatus) -> Markup:
        if not m.recording:
            text = " · not being recorded: notes are shown, but not kept"
            return note(tag("b", "Live"), text)
        repaired = sum(m.repaired.values())
        filled = f" · {counted(repaired, 'message')} filled in after a loss" if repaired else ""
        holding = (
            f" · filling a gap: {counted(m.repairing, 'message')} to come" if m.repairing else ""
        )
        words = f" {m.session} · {clock(m.seconds)}{filled}{holding}"
        return note(tag("b", "Live"), " ", tag("b", "●", class_="gf-rec"), words)

    def _marks_html(self) -> Markup:
        device = self._store.device(self._chosen())
        if device is None or not device.marks:
            return EMPTY
        begun = self._store.recorded_s(device.name)
        shown = []
        for at, text in device.marks[-SHOWN_MARKS:]:
            s = None if begun is None else begun - (device.t_newest - at)
            utc = time.gmtime(device.utc0_ns * 1e-9 + at)
            when = time.strftime("%H:%M:%S UTC", utc) if s is None or s < 0.0 else clock(s)
            shown.append(tag("li", tag("b", when), " ", text or "mark"))
        return tag("ul", *shown, class_="gf-note gf-marks")

    # --- what a person does

    def bar(self, barred: bool) -> None:
        """For a viewer: rows of buttons cannot be greyed, they go and the reason stands there."""
        self._barred = barred
        self._show_inputs()

    def _show_inputs(self) -> None:
        for handle in self._replay_inputs:
            group = isinstance(handle, viser.GuiButtonGroupHandle)
            handle.visible = bool(self._showing) and not (group and self._barred)

    def do(self, what: str) -> None:
        """What a key of the page asks: play (or pause), back or on by a step."""
        if what in KEYS and not self._barred:
            self._press(KEYS[what])

    def _order(self, action: int, value: float = 0.0, until: float = 0.0) -> None:
        if not self._showing:
            return
        try:
            self._desk.replay(pb.ReplayCommand(action=action, value=value, until=until))
        except OrderError as error:
            self._client.add_notification(
                "The replay did not do it", plain(error), color="red", auto_close_seconds=6.0
            )

    def _slid(self, event: Any) -> None:
        if event.client is None:
            return  # moved by the replay itself
        self._touched = time.monotonic()
        self._order(pb.ReplayCommand.ACTION_SEEK, self._slider.value)

    def _set_speed(self, event: Any) -> None:
        if event.client is not None:
            self._order(pb.ReplayCommand.ACTION_SPEED, float(self._speed.value.rstrip("×")))

    def _press(self, what: str) -> None:
        replay, kind = self._store.replay, pb.ReplayCommand
        if replay.status is None:
            return
        at = replay.status.position_s
        if what == "play / pause":
            self._order(kind.ACTION_RESUME if replay.status.paused else kind.ACTION_PAUSE)
        elif what.endswith("step") or what.startswith("step"):
            self._order(kind.ACTION_STEP, 1.0 if what.startswith("step") else -1.0)
        else:
            jump = {"start": -at, "−10 s": -10.0, "+10 s": 10.0}[what]
            self._order(kind.ACTION_SEEK, max(0.0, at + jump))

    def _set_loop(self, what: str) -> None:
        m = self._store.replay.status
        if m is None:
            return
        if what == "off":
            self._order(pb.ReplayCommand.ACTION_LOOP)
        elif what == "from here":
            self._order(pb.ReplayCommand.ACTION_LOOP, m.position_s, max(m.loop_until_s, m.length_s))
        elif m.position_s > m.loop_from_s:
            self._order(pb.ReplayCommand.ACTION_LOOP, m.loop_from_s, m.position_s)


def clock(seconds: float, digits: int = 1) -> str:
    """Seconds as m:ss.s, with hours where there are any."""
    sign, seconds = ("−" if seconds < 0 else ""), abs(seconds)
    minutes, rest = divmod(round(seconds, digits), 60)
    hours, minutes = divmod(int(minutes), 60)
    tail = f"{rest:0{3 + digits}.{digits}f}"
    return f"{sign}{hours}:{minutes:02d}:{tail}" if hours else f"{sign}{minutes}:{tail}"
