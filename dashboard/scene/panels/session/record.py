"""State of the recorder and the buttons that start and stop it. Who may press them is checked by
the proxy.
"""

import logging
from collections.abc import Callable

import viser

from dashboard.scene.drawing.page import Markup, alert, bad, rows, tag
from dashboard.scene.drawing.palette import number
from dashboard.scene.panels.base import Input
from messages.bus.orders import OrderError
from messages.contract import gyrofree_pb2 as pb
from messages.text import plain

log = logging.getLogger(__name__)


class Record:
    """Two buttons, a name, and what the recorder says of itself."""

    def __init__(
        self, client: viser.ClientHandle, call: Callable[[pb.RecorderCommand], pb.RecorderStatus]
    ) -> None:
        self._client, self._call = client, call
        gui = client.gui
        self._state = gui.add_html("")
        self._name = gui.add_text("Session", "", hint="Name of the session; empty takes the time")
        self._start = gui.add_button("Record", icon=viser.Icon.PLAYER_RECORD, color=(192, 40, 40))
        self._stop = gui.add_button(
            "Stop recording", icon=viser.Icon.PLAYER_STOP, color="gray", visible=False
        )
        self._start.on_click(lambda _: self._order(pb.RecorderCommand.ACTION_START))
        self._stop.on_click(lambda _: self._order(pb.RecorderCommand.ACTION_STOP))

    @property
    def orders(self) -> tuple[Input, ...]:
        """The elements a viewer may not use."""
        return self._start, self._stop, self._name

    def update(self, latest, now: float) -> None:
        """Show the recorder's newest status; `latest` is None before it spoke."""
        stale = latest is None or latest.age(now) > 3.0
        recording = latest is not None and latest.message.recording
        content = self._content(latest, stale, recording)
        if self._state.content != content:
            self._state.content = str(content)
        for handle, visible in (
            (self._start, not recording),
            (self._name, not recording),
            (self._stop, recording),
        ):
            if handle.visible != visible:
                handle.visible = visible
        if self._start.disabled != stale:
            self._start.disabled = self._stop.disabled = stale

    @staticmethod
    def _content(latest, stale: bool, recording: bool) -> Markup:
        if latest is None:
            return rows([("recorder", "not running")], stale=True)
        m = latest.message
        state = tag("b", "● recording", class_="gf-rec") if recording else "ready"
        items: list[tuple[str, object]] = [("recorder", state)]
        if m.session:
            items.append(("session" if recording else "last session", m.session))
        if recording:
            items.append(("length", number(m.seconds, 0, "s")))
            items.append(
                (
                    "written · safe on disk",
                    f"{number(m.messages, 0)} · {number(m.durable_messages, 0)}",
                )
            )
            items.append(("size", number(m.bytes / 1e6, 1, "MB")))
        if m.clock_steps:
            text = (
                f"set {m.clock_steps} times, {m.clock_offset_s:+,.1f} s in all; times go on without"
            )
            items.append(("wall clock", f'<b class="gf-bad">{text}</b>'))
        lost = sum(m.lost.values())
        if lost:
            items.append(("lost on the bus", bad(f"{number(lost, 0)} messages")))
        if m.refused:
            kinds = ", ".join(f"{kind} {n}" for kind, n in sorted(m.refused.items()))
            items.append(("refused on the bus", bad(kinds)))
        return alert(m.message) + rows(items, stale)

    def _order(self, action: int) -> None:
        command = pb.RecorderCommand(action=action, name=self._name.value.strip())
        try:
            answer = self._call(command)
            text, good = (answer.message or answer.session or "done"), not answer.message
        except OrderError as error:  # shown to the person who pressed the button
            log.warning("recorder: %s", error)
            text, good = str(error), False
        started = action == pb.RecorderCommand.ACTION_START
        title = (
            ("Recording" if started else "Recording stopped")
            if good
            else "The recorder did not do it"
        )
        self._client.add_notification(
            title, plain(text), color="teal" if good else "red", auto_close_seconds=6.0
        )
