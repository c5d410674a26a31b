"""What the person at a browser may order now, and why not: by his role, his place, the command."""

from collections.abc import Collection, Iterable

import viser

from dashboard.desk import Desk
from dashboard.scene.panels.base import Input
from messages.contract import gyrofree_pb2 as pb

VIEWER, OPERATORS = "viewer", ("operator", "admin")  # what the relay says, then name and seat


class Rights:
    """Of one browser."""

    def __init__(self, desk: Desk) -> None:
        self.desk, self._all = desk, desk  # that of the sign-in, once the relay has said whose
        self.user = self._rank = ""
        self.never = ""  # why no order is his, whoever has the command
        self.now = ""  # why none is his now

    def become(self, said: str) -> None:
        """Of whom the relay says that he looks."""
        self._rank, _, who = said.partition(" ")
        self.user, _, seat = who.partition("\t")
        self.desk = self._all.of(pb.Seat(id=seat, user=self.user, admin=self._rank == "admin"))

    @property
    def operates(self) -> bool:
        """His role is one that orders."""
        return self._rank in OPERATORS

    def look(self) -> bool:
        """Ask again; True when it is another than before."""
        never = ""
        if self._rank == VIEWER:
            never = "You look as viewer: what gives orders is greyed, it takes the role operator."
        elif self.desk.watching:
            never = f"{self.desk.watching}: what gives orders is greyed."
        before, self.never, self.now = (self.never, self.now), never, never or self.desk.barred()
        return before != (self.never, self.now)

    def grey(self, handles: Iterable[Input], always: Collection[Input]) -> None:
        """The inputs that would be refused. always: those that need no command."""
        free = {id(handle) for handle in always}
        for handle in handles:
            if not isinstance(handle, viser.GuiButtonGroupHandle):
                handle.disabled = bool(self.never if id(handle) in free else self.now)
