"""Everything that the dashboard says on the bus: orders of its pages and of the scene, and remarks.

One desk for both, on the one session of the process, so that a refusal reads the same wherever the
button was pressed.
"""

import time

import zenoh

from messages import text
from messages.bus import orders
from messages.bus import session as busmod
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import NOTE


class Desk:
    """Gives orders and waits for their answers; each raises messages.bus.orders.OrderError."""

    def __init__(self, session: zenoh.Session | None, prefix: str, watching: str = "") -> None:
        """Without a session every order says that there is no router; with `watching`, why this
        place may only watch, every order is refused by that.
        """
        self._session, self._prefix, self._watching = session, prefix, watching
        self._publishers = busmod.Publishers(session, prefix)  # of notes
        self._since = time.time_ns()  # their sequences count since then

    @property
    def connected(self) -> bool:
        """True while there is a router."""
        return self._session is not None and busmod.connected(self._session)

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
        return orders.give(self._session, self._prefix, orders.ALARMS, command)

    def replay(self, command: pb.ReplayCommand) -> pb.ReplayStatus:
        """An order to the replay that runs."""
        return self._give(orders.REPLAY, command)

    def _give(
        self,
        kind: orders.Kind[orders.C, orders.A],
        command: orders.C,
        device: str = "",
        timeout_s: float | None = None,
    ) -> orders.A:
        if self._watching:
            raise orders.Refused(self._watching)
        return orders.give(self._session, self._prefix, kind, command, device, timeout_s)

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
