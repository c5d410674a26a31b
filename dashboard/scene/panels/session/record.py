"""State of the recorder. Who starts and stops it does so in the bar above the scene."""

import viser

from dashboard.scene.drawing.page import EMPTY, Markup, alert, bad, rows, tag
from dashboard.scene.drawing.palette import number
from messages.text import counted


class Record:
    """What the recorder says of itself."""

    short = False  # on a phone: alarms only

    def __init__(self, client: viser.ClientHandle) -> None:
        self._state = client.gui.add_html("")
        self._latest, self._how = None, ()  # what is shown, and how

    def update(self, latest, now: float) -> None:
        """Show the recorder's newest status; `latest` is None before it spoke."""
        stale = latest is None or latest.age(now) > 3.0
        if latest is self._latest and (stale, self.short) == self._how:
            return  # it speaks once a second
        self._latest, self._how = latest, (stale, self.short)
        recording = latest is not None and latest.message.recording
        content = self._content(latest, stale, recording)
        if self.short:
            content = alert(latest.message.message) if latest is not None else EMPTY
        if self._state.content != content:
            self._state.content = str(content)

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
                    "messages · on disk",
                    f"{number(m.messages, 0)} · {number(m.durable_messages, 0)}",
                )
            )
            items.append(("size", number(m.bytes / 1e6, 1, "MB")))
        if m.clock_steps:
            off = number(m.clock_offset_s, 1, "s", sign=True)
            steps = f"set {counted(m.clock_steps, 'time')}, {off} in all"
            items.append(("wall clock", bad(f"{steps}; times go on without")))
        lost = sum(m.lost.values())
        if lost:
            items.append(("lost on the bus", bad(counted(lost, "message"))))
        if m.refused:
            kinds = ", ".join(f"{kind} {n}" for kind, n in sorted(m.refused.items()))
            items.append(("refused on the bus", bad(kinds)))
        return alert(m.message) + rows(items, stale)
