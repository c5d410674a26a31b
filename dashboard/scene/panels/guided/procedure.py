"""A test as a procedure: choose, give the serial number, start; then what to do now in large words,
how far it is, every step with its figures beside their limits, and the emergency stop. Orders are
for operators.
"""

import logging
import textwrap
from typing import Any

import numpy as np
import viser

from dashboard.data.device import Device
from dashboard.scene.drawing.page import EMPTY, Markup, alert, html, joined, note, rows, tag
from dashboard.scene.drawing.palette import GREEN, VERMILLION, number
from dashboard.scene.panels.base import DEG, Input, Snapshot
from dashboard.scene.panels.guided import confirm
from dashboard.scene.panels.guided.calibration import picture
from dashboard.scene.panels.guided.guided import Guided, guidance, silent
from logs.figures.numbers import with_half_width
from messages.bus.orders import OrderError
from messages.contract import gyrofree_pb2 as pb
from messages.text import plain

log = logging.getLogger(__name__)

ACTION = pb.ProcedureCommand
M = pb.ProcedureStatus
STEP = M.Step
ACTIVE = (M.STATE_RUNNING, M.STATE_HELD)
SHORT = 60  # characters of a reason; all of it is in the tooltip
STATES = {
    M.STATE_IDLE: "no test runs",
    M.STATE_RUNNING: "running",
    M.STATE_HELD: "HELD: it needs you",
    M.STATE_DONE: "done",
    M.STATE_ABORTED: "aborted",
    M.STATE_STOPPED: "EMERGENCY STOP",
}
MARKS = {  # of a step: its sign, its colour, in words
    STEP.STATE_TODO: ("○", "inherit", "to do"),
    STEP.STATE_WAITING: ("◔", "inherit", "waiting"),
    STEP.STATE_RAMP: ("◔", "inherit", "ramp"),
    STEP.STATE_SETTLED: ("◑", "inherit", "settling"),
    STEP.STATE_DWELL: ("◕", GREEN, "measuring"),
    STEP.STATE_DONE: ("✓", GREEN, "measured"),
    STEP.STATE_FAILED: ("✗", VERMILLION, "failed"),
    STEP.STATE_SKIPPED: ("–", VERMILLION, "left out"),
}
BUTTONS = (  # label, order, icon, colour
    ("EMERGENCY STOP", ACTION.ACTION_STOP, viser.Icon.HAND_STOP, (200, 30, 30)),
    ("Start test", ACTION.ACTION_START, viser.Icon.PLAYER_PLAY, (30, 110, 165)),
    ("Done, go on", ACTION.ACTION_NEXT, viser.Icon.CHECK, (0, 120, 90)),
    ("Repeat step", ACTION.ACTION_REPEAT, viser.Icon.REPEAT, "gray"),
    ("Abort test", ACTION.ACTION_ABORT, viser.Icon.X, "gray"),
)
UNITS = {"dps": "°/s", "mg": "mg", "ppm": "ppm"}


class ProcedurePanel(Guided):
    """What runs on the device, and the orders to it; the service `gyrofree procedures` does it."""

    title = "Procedure"
    workspace = "test"
    buttons = BUTTONS

    def __init__(self, client: viser.ClientHandle, folder: viser.GuiFolderHandle) -> None:
        super().__init__(client, folder)
        self._names: tuple[str, ...] = ()
        self._seen = ("", 0)  # run and step on the screen
        self._said, self._confirm = M(), confirm.Confirm(client)
        with folder:
            gui = client.gui
            self._choice = gui.add_dropdown("Procedure", ("–",), order=0.2, visible=False)
            self._unit = gui.add_text("Serial number", "", order=0.3, visible=False)
            self._read = gui.add_text("What was read", "", order=1.5, visible=False)
        self._buttons[ACTION.ACTION_STOP].order = 0.1

    @property
    def orders(self) -> tuple[Input, ...]:
        """Buttons, and what is given with them."""
        return *super().orders, self._choice, self._unit, self._read

    @property
    def always(self) -> tuple[Input, ...]:
        return (self._buttons[ACTION.ACTION_STOP],)

    @classmethod
    def missing(cls, device: Device) -> str:
        if device.get("procedure") is not None:
            return ""
        return "no word from `gyrofree procedures`: it runs the tests"

    def update(self, s: Snapshot) -> None:
        if self._device != s.device.name:
            self._confirm.close()
        self._device = s.device.name
        latest = s.device.get("procedure")
        if latest is None:
            self._not_here("The tests are run by `gyrofree procedures`, which is not heard.")
            self._fields(False, False)
            return
        m = latest.message
        active = m.state in ACTIVE
        self._said = m
        if active:
            self._confirm.close()
        self._seen = m.run, m.step + 1
        self._offer(tuple(m.offered))
        step = m.steps[m.step] if m.step < len(m.steps) else STEP()
        waits = active and step.kind == "open"
        self._fields(not active, waits and m.state == M.STATE_RUNNING)
        self._status = self.html(
            content(m, silent(s, "procedure", active), s.dark, self.user), self._status
        )
        wanted = {ACTION.ACTION_STOP}
        if active:
            wanted |= {ACTION.ACTION_REPEAT, ACTION.ACTION_ABORT}
            if waits or m.state == M.STATE_HELD:
                wanted.add(ACTION.ACTION_NEXT)
        else:
            wanted.add(ACTION.ACTION_START)
        label = "Leave step out" if m.state == M.STATE_HELD else "Done, go on"
        go_on = self._buttons[ACTION.ACTION_NEXT]
        if go_on.label != label:
            go_on.label = label
        self._show(wanted)

    def _offer(self, names: tuple[str, ...]) -> None:
        if names and names != self._names:
            self._names = names
            was = self._choice.value
            self._choice.options = names
            first = "published-30s" if "published-30s" in names else names[0]
            self._choice.value = was if was in names else first

    def _fields(self, to_start: bool, to_read: bool) -> None:
        for handle in (self._choice, self._unit):
            if handle.visible != to_start:
                handle.visible = to_start
        if self._read.visible != to_read:
            self._read.visible = to_read

    def hide(self) -> None:
        """What was asked belongs to this page."""
        self._confirm.close()

    def _order(self, action: int) -> None:
        command = ACTION(action=action, device=self._device, user=self.user)
        if action == ACTION.ACTION_START:
            command.procedure = self._choice.value
            command.unit = self._unit.value.strip()
            command.own_session = True
            title = f"Start {command.procedure} on {self._device}?"
            told = confirm.content(self._said, command.procedure, command.unit)
            self._confirm.ask(title, told, lambda: self._give(command))
            return
        if action in (ACTION.ACTION_NEXT, ACTION.ACTION_REPEAT):
            command.run, command.step = self._seen  # another may have answered it meanwhile
        if action == ACTION.ACTION_NEXT:
            command.text = self._read.value.strip()
        self._give(command)

    def _give(self, command: ACTION) -> None:
        """Give the order and show what came of it."""
        try:
            reply = self.desk.procedure(command)
            text, good = reply.message, reply.ok
        except (OrderError, ValueError) as error:  # shown to the person who pressed the button
            log.warning("procedure: %s", error)
            text, good = str(error), False
        if good and command.action == ACTION.ACTION_NEXT:
            self._read.value = ""
        title = "Test" if good else "The order was not carried out"
        self.client.add_notification(
            title, plain(text), color="teal" if good else "red", auto_close_seconds=8.0
        )


def content(m: pb.ProcedureStatus, gone: bool, dark: bool, user: str = "") -> Markup:
    """The panel's HTML; `user`: who is signed in, and would be the operator."""
    alarm = alert("the procedures are silent: does `gyrofree procedures` run?") if gone else EMPTY
    alarm += alert(m.alarm) if m.alarm else EMPTY
    if m.state == M.STATE_IDLE:
        table = f"The table is driven: {m.table}." if m.table else "You turn the table by hand."
        text = (
            "Choose a procedure and start. It watches the data itself, goes on by itself and ends"
            " with a report."
        )
        who = f"Operator: {user}, who is signed in." if user else EMPTY
        lost = note(m.if_lost) if m.if_lost else EMPTY
        return alarm + note(text) + note(table) + lost + (note(who) if who else EMPTY)
    done = sum(s.state in (STEP.STATE_DONE, STEP.STATE_SKIPPED) for s in m.steps)
    state = tag("span", STATES.get(m.state, ""), class_="gf-name")
    detail = tag("span", f"{done} of {len(m.steps)} steps")
    first = tag("div", state, detail, class_="gf-head")
    drawing = picture(np.array(m.up_b), dark) if len(m.up_b) == 3 else EMPTY
    said = alert(m.message) if m.state == M.STATE_HELD else note(m.message)
    facts: list[tuple[str, Any]] = [
        ("procedure", m.title),
        ("serial number", m.unit or "not given"),
        ("operator", m.operator or "not given"),
        ("table", m.table or "turned by hand"),
    ]
    if m.table:
        facts.append(("it turns at", number(m.table_radps * DEG, 1, "°/s")))
    facts.append(("recorded in", m.session or "nothing"))
    live = guidance(m.instruction, drawing, m.progress, "")
    return alarm + first + live + said + _report(m) + steps_of(m) + rows(facts, stale=gone)


def _report(m: pb.ProcedureStatus) -> Markup:
    """The way to the report, once there is a recording of the whole."""
    if m.state in ACTIVE or not m.session or m.instruction.endswith("being closed"):
        return EMPTY
    way = f"/sessions/{m.session}"
    new = {"target": "_blank", "rel": "noopener"}
    report = tag("a", "Open the report", href=f"{way}?report", **new)
    session = tag("a", "the session, to add a photo of the unit", href=way, **new)
    return tag("p", report, ", or ", session, class_="gf-note")


def steps_of(m: pb.ProcedureStatus) -> Markup:
    """Every step with its state and its figures beside their limits."""
    items = []
    for k, step in enumerate(m.steps):
        mark, colour, word = MARKS.get(step.state, MARKS[STEP.STATE_TODO])
        now = k == m.step and m.state in ACTIVE
        sign = tag("b", mark, style=f"color:{colour}", title=word)
        name = joined([sign, tag("b" if now else "span", step.name)], " ")
        parts: list[object] = [figure(one) for one in step.figures]
        if step.spoilt or step.trouble:
            often = f"{step.spoilt}× spoilt" if step.spoilt else "held"
            last = textwrap.shorten("".join(step.trouble[-1:]), SHORT, placeholder=" …")
            text = f"{often}: {last}".rstrip(": ")
            parts.append(tag("span", text, title="; ".join(step.trouble)))
        if step.kind == "open" and step.reason:
            parts.append(step.reason)
        items.append((name, joined(parts, " · ") if parts else html(word)))
    return rows(items)


def figure(one: pb.ProcedureStatus.Figure) -> Markup:
    """A number with its sigma and, where there is one, its limit and whether it keeps it."""
    name, _, unit = one.name.rpartition("_")
    unit, name = UNITS.get(unit, unit), name.removeprefix("rate_").replace("_", " ")
    if one.value != one.value:
        return tag("span", f"{name} –")
    text = f"{name} {with_half_width(one.value, 2.0 * one.sigma)}"
    low, high = one.HasField("min"), one.HasField("max")
    if not (low or high):
        return tag("span", f"{text} {unit}")
    good = (not low or one.value >= one.min) and (not high or one.value <= one.max)
    limit = " to ".join(
        [f"{one.min:g}"] * low + [f"{one.max:g}"] * high if low and high else []
    ) or (f"≥ {one.min:g}" if low else f"≤ {one.max:g}")
    style = f"color:{GREEN if good else VERMILLION}"
    return tag(
        "b", f"{'✓' if good else '✗'} {text} {unit} ({limit.replace('-', '−')})", style=style
    )
