"""Everything that the dashboard says on the bus: orders of its pages and of the scene, and remarks.

One desk for all, on the one session of the process, so that a refusal reads the same wherever the
button was pressed. `of` gives the desk of one sign-in, whose orders bear its name and need the
command of the site (messages/bus/command): it is taken silently where nobody has it.
"""

import contextlib
import copy
import logging
import threading
import time
from collections import deque
from collections.abc import Callable

import zenoh

from messages import text
from messages.bus import orders
from messages.bus import session as busmod
from messages.bus.beating import HERE
from messages.bus.command.history import newest_of
from messages.bus.command.said import words
from messages.bus.command.watch import Watch, name_of
from messages.bus.turning import Loop
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import NOTE, ORDER, TopicError

log = logging.getLogger(__name__)

KEEP_S = 3.0  # between two words that a holder is still there
ORDER_S = 30.0  # that saying so may take, where nobody answers
PRESENT_S = 90.0  # without a page of his that asks; one in the background asks once a minute
KEPT = 200  # orders remembered here, for a bench where nobody keeps them
SEAT = pb.SeatCommand
GIVEN = pb.OrderGiven


class Desk:
    """Gives orders and waits for their answers; each raises messages.bus.orders.OrderError."""

    def __init__(
        self, session: zenoh.Session | None, prefix: str, watching: str = "", place: str = ""
    ) -> None:
        """Without a session every order says that there is no router; with `watching`, why this
        place may only watch, every order is refused by that. place: of a site, this one's name.
        """
        self._session, self._prefix, self._watching = session, prefix, watching
        self._place = place
        self._publishers = busmod.Publishers(session, prefix)  # of notes, and of orders
        self._since = time.time_ns()  # their sequences count since then
        self._watch = Watch(session, prefix) if session is not None else None
        self._seat = pb.Seat()
        self._present: dict[str, tuple[float, pb.Seat]] = {}  # seats, and when heard of
        self._given: deque[pb.OrderGiven] = deque(maxlen=KEPT)
        self._saying = threading.Lock()
        self.told: Callable[[pb.OrderGiven], None] = lambda one: None  # noqa: ARG005

    def of(self, seat: pb.Seat) -> "Desk":
        """The desk of a sign-in."""
        mine = copy.copy(self)
        mine._seat = pb.Seat(id=seat.id, user=seat.user[:60], place=self._place, admin=seat.admin)
        return mine

    @property
    def watching(self) -> str:
        """Why this place may only watch; empty: it may order."""
        return self._watching

    @property
    def connected(self) -> bool:
        """True while there is a router."""
        return self._session is not None and busmod.connected(self._session)

    # --- orders

    def recorder(
        self, command: pb.RecorderCommand, timeout_s: float | None = None
    ) -> pb.RecorderStatus:
        """Start or end a recording; the status after it."""
        return self._give(orders.RECORDER, command, timeout_s=timeout_s)

    def estimator(self, command: pb.EstimatorCommand) -> pb.Reply:
        """An order to the estimators of `command.device`."""
        return self._give(orders.ESTIMATOR, command, command.device)

    def board(self, device: str, command: pb.BoardCommand) -> pb.Reply:
        """An order to a board, through its gateway."""
        return self._give(orders.BOARD, command, device)

    def procedure(self, command: pb.ProcedureCommand) -> pb.Reply:
        """An order to the test of `command.device`."""
        return self._give(orders.PROCEDURES, command, command.device)

    def alarms(self, command: pb.AlarmCommand) -> pb.AlarmReply:
        """An order to the alarms; how they are after it."""
        if command.action == pb.AlarmCommand.ACTION_LIST:
            return orders.give(self._session, self._prefix, orders.ALARMS, command)
        return self._give(orders.ALARMS, command)

    def replay(self, command: pb.ReplayCommand) -> pb.ReplayStatus:
        """An order to the replay that runs."""
        return self._give(orders.REPLAY, command)

    def note(self, device: str, note: pb.Note) -> None:
        """Publish a remark, for the recording and for every chart."""
        if fault := text.check(note.text, lines=True):
            raise orders.Refused(f"note: {fault}")
        if self._watching:
            raise orders.Refused(self._watching)
        if not self.connected:
            raise orders.NoAnswer("no router: is `gyrofree router` running?")
        note.header.run = self._since
        self._publishers.put(NOTE, device, note)

    # --- the command

    @property
    def status(self) -> pb.CommandStatus | None:
        """Who has the command; None where nobody keeps it."""
        return self._watch.now if self._watch is not None else None

    def barred(self) -> str:
        """Why an order of this sign-in would be refused now; empty: it would not."""
        if self._watching:
            return self._watching
        status = self.status
        if status is None or status.holder.id in ("", self._seat.id):
            return ""
        return f"{name_of(status.holder)} has the command: ask for it in the head of the page"

    def command(self, action: int, to: str = "", why: str = "") -> pb.SeatReply:
        """Take, ask, give ... as this sign-in."""
        if self._watching and action != SEAT.ACTION_LOOK:
            raise orders.Refused(self._watching)
        order = SEAT(action=action, seat=self._seat, to=pb.Seat(id=to), text=why)
        reply = orders.give(self._session, self._prefix, orders.SEAT, order)
        if self._watch is not None:
            self._watch.learn(reply.status)
        if not reply.ok:
            raise orders.Refused(reply.message)
        return reply

    def history(self, find: str = "", most: int = 200) -> tuple[list[pb.OrderGiven], str]:
        """Orders of all, the newest first; and why it is those of this page alone where it is."""
        if self._watching:  # nor may it ask
            return [], f"The site's orders are shown at its home, and not here: {self._watching}."
        ask = SEAT(action=SEAT.ACTION_LOOK, text=find[:200], most=most)
        try:
            reply = orders.give(self._session, self._prefix, orders.SEAT, ask)
        except orders.OrderError as error:
            mine = newest_of(self._given, find, most)
            return mine, f"those of this page since it began: {error}"
        lost = f"{reply.lost} orders could not be kept: is the disk full?" if reply.lost else ""
        return list(reply.history), lost

    def seen(self) -> None:
        """The page of this sign-in is open, or it ordered."""
        if self._seat.id:
            self._present[self._seat.id] = time.monotonic(), self._seat

    def keep(self, stop: threading.Event, alive: Callable[[str], bool]) -> None:
        """Say of holders and of those who ask that they are still there, until `stop`; give up
        what is of a sign-in that has ended (`alive` of its seat says no) or has no page open.
        """
        with Loop("command", ORDER_S) as loop:
            due = 0.0
            while not stop.wait(0.5):
                loop.turn()
                due = self._keep_seats(due, alive)

    def _keep_seats(self, due: float, alive: Callable[[str], bool]) -> float:
        """One look of `keep`; due, and what it gives: when it says so next, s, monotonic."""
        status, now = self.status, time.monotonic()
        if status is None:
            return due
        kept = now >= due
        for seat in (status.holder, status.asks):
            at, mine = self._present.get(seat.id, (0.0, pb.Seat()))
            if not mine.id:
                continue
            desk, why = self.of(mine), ""
            if not alive(mine.id):
                why = "signed out"
            elif now - at > PRESENT_S:
                why = "closed the page"
            if why or kept:
                action = SEAT.ACTION_RELEASE if why else SEAT.ACTION_KEEP
                with contextlib.suppress(orders.OrderError):
                    desk.command(action, why=why)
            if why:
                self._present.pop(mine.id, None)
        return now + KEEP_S if kept else due

    def _by(self, kind: orders.Kind, command: object) -> pb.OrderBy:
        """Who gives an order; the command is taken where it is needed and nobody has it."""
        status = self.status
        by = pb.OrderBy(seat=self._seat, epoch=status.epoch if status is not None else 0)
        if status is None or not self._seat.id or not kind.commanded(command):
            return by
        self.seen()
        if status.holder.id != self._seat.id:
            if why := self.barred():
                raise orders.Refused(why)
            by.epoch = self.command(SEAT.ACTION_TAKE).status.epoch
        return by

    def _give(
        self,
        kind: orders.Kind[orders.C, orders.A],
        command: orders.C,
        device: str = "",
        timeout_s: float | None = None,
    ) -> orders.A:
        began, given = time.monotonic(), GIVEN(at_utc_ns=time.time_ns(), whom=kind.who)
        given.device = device if len(device) <= 32 else ""
        given.what = words(command)
        try:
            if self._watching:
                raise orders.Refused(self._watching)
            by = self._by(kind, command)
            answer = orders.give(self._session, self._prefix, kind, command, device, timeout_s, by)
        except orders.OrderError as error:
            refused = isinstance(error, orders.Refused)
            given.outcome = GIVEN.OUTCOME_REFUSED if refused else GIVEN.OUTCOME_NO_ANSWER
            self._tell(given, began, str(error))
            raise
        done = getattr(answer, "ok", True)
        given.outcome = GIVEN.OUTCOME_DONE if done else GIVEN.OUTCOME_REFUSED
        self._tell(given, began, getattr(answer, "message", ""))
        return answer

    def _tell(self, given: pb.OrderGiven, began: float, said: str) -> None:
        """Keep an order and what came of it, and let all know."""
        if not given.what:
            return
        given.seconds = time.monotonic() - began
        given.text = text.plain(said, 500)
        given.user, given.place = self._seat.user, self._place
        given.header.device, given.header.run = self._place or HERE, self._since
        given.header.utc_ns = given.at_utc_ns
        with self._saying:
            self._given.append(given)
            self.told(given)
            if self._session is not None and not self._watching:
                with contextlib.suppress(TopicError):
                    self._publishers.put(ORDER, given.header.device, given)
