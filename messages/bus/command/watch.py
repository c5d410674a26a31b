"""What everybody on the bus knows of the command: by what its keeper says.

Who takes orders judges with it, so that an order under a command that has passed on is refused
where it would be carried out, whatever a page believes. A keeper that is not heard of for UNHEARD_S
binds nobody: a bench without one works as if there were no command at all.
"""

import logging
import time

import zenoh
from google.protobuf.message import DecodeError

from messages.contract import gyrofree_pb2 as pb
from messages.contract.checks import MESSAGE_BYTES, check
from messages.contract.door import read
from messages.contract.topics import HOLDER

log = logging.getLogger(__name__)

UNHEARD_S = 15.0  # a keeper that is killed is there again within seconds


class Watch:
    """Listens to the keeper from now on; close() ends it. Zenoh's thread writes, any may read."""

    def __init__(self, session: zenoh.Session, prefix: str) -> None:
        self._heard: tuple[float, pb.CommandStatus] | None = None
        self._subscriber = session.declare_subscriber(HOLDER.pattern(prefix), self._on_sample)

    def _on_sample(self, sample: zenoh.Sample) -> None:
        message, refusal = read(HOLDER, sample.payload.to_bytes())
        if message is None:
            log.warning("who has the command: %s", refusal)
            return
        self._heard = time.monotonic(), message

    def learn(self, status: pb.CommandStatus) -> None:
        """What the keeper answered, which may come before what it publishes."""
        heard = self._heard
        if heard is None or status.epoch >= heard[1].epoch:
            self._heard = time.monotonic(), status

    @property
    def now(self) -> pb.CommandStatus | None:
        """As last heard; None where nobody keeps the command."""
        heard = self._heard
        return None if heard is None or time.monotonic() - heard[0] > UNHEARD_S else heard[1]

    def refusal(self, by: pb.OrderBy) -> str:
        """Why an order by this is not taken; empty: it is."""
        status = self.now
        if status is None or by.seat.service:
            return ""
        if by.epoch > status.epoch or not status.holder.id:
            return ""  # he knows of a change that has not come here yet; or nobody has it
        if by.epoch == status.epoch and by.seat.id == status.holder.id:
            return ""
        who = name_of(status.holder)
        if not by.seat.id:
            return f"{who} has the command, and this order does not say who gives it"
        return f"{who} has the command: ask for it"

    def close(self) -> None:
        """Hear nothing more."""
        self._subscriber.undeclare()


def name_of(seat: pb.Seat) -> str:
    """For people."""
    return f"{seat.user or 'somebody'} ({seat.place})" if seat.place else seat.user or "somebody"


def given_by(attachment: zenoh.ZBytes | None) -> pb.OrderBy:
    """Who gives an order, as its attachment says; of nobody where it says nothing that can be
    read.
    """
    by = pb.OrderBy()
    if attachment is None or len(attachment) > MESSAGE_BYTES:
        return by
    try:
        by.ParseFromString(attachment.to_bytes())
    except DecodeError:
        return pb.OrderBy()
    return pb.OrderBy() if check(by) else by
