"""A process without a session on the bus, such as the supervisor, marks its turns in a piece of
memory that it shares with one of its children, and that child beats for it.
"""

import mmap
import os
import struct
import time
from collections.abc import Mapping
from typing import Self

import zenoh

from messages.bus.turning import Observer
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import BEAT, alive_key

UP = "up"  # its role
LOOP = "services"
MOST_S = 6.0  # that a turn of it may take: it waits for the page's first answer
VARIABLE = "GYROFREE_PULSE"  # descriptor and process id, for the child
SIZE = 8  # bytes: how many turns

_COUNT = struct.Struct("<Q")


class Pulse:
    """Whoever has it marks its turns."""

    def __init__(self) -> None:
        self.descriptor = os.memfd_create("gyrofree-pulse")
        os.ftruncate(self.descriptor, SIZE)
        self._memory, self._turns = mmap.mmap(self.descriptor, SIZE), 0

    def turn(self) -> None:
        """It goes on."""
        self._turns += 1
        _COUNT.pack_into(self._memory, 0, self._turns)

    def environment(self) -> dict[str, str]:
        """For the child, which has to inherit the descriptor."""
        return {VARIABLE: f"{self.descriptor}:{os.getpid()}"}


class Shared:
    """The child's end: what `Observer` reads of a loop."""

    name, doing, most_s = LOOP, "", MOST_S

    def __init__(self, descriptor: int, pid: int) -> None:
        """Raises OSError, ValueError where there is no such memory."""
        self.pid = pid
        self._memory = mmap.mmap(descriptor, SIZE, prot=mmap.PROT_READ)

    @classmethod
    def inherited(cls, environment: Mapping[str, str] | None = None) -> Self | None:
        """What the parent gave; None: nothing. The children of this process do not have it."""
        said = (os.environ if environment is None else environment).get(VARIABLE, "")
        os.environ.pop(VARIABLE, None)
        try:
            descriptor, pid = map(int, said.split(":"))
            return cls(descriptor, pid)
        except (OSError, ValueError):
            return None

    @property
    def turns(self) -> int:
        """So far."""
        return int(_COUNT.unpack_from(self._memory)[0])


class Voice:
    """Beats for the parent, under the place and by the session of the child."""

    def __init__(
        self, session: zenoh.Session, prefix: str, own: pb.Beat, name: str, shared: Shared
    ) -> None:
        """own, name: beat and name of the child itself."""
        self._shared, self._observer = shared, Observer()
        place, called = own.header.device, f"{UP}-{shared.pid}"
        self._beat = pb.Beat(role=UP, told_by=name, version=own.version)
        self._beat.header.device, self._beat.header.run = place, own.header.run
        self._beat.since_utc_ns = own.since_utc_ns
        self._publisher = session.declare_publisher(
            BEAT.key(prefix, place, called),
            congestion_control=zenoh.CongestionControl.DROP,
            priority=zenoh.Priority.INTERACTIVE_HIGH,
        )
        self._token = session.liveliness().declare_token(alive_key(prefix, place, called))

    def put(self, passed_s: float, own: pb.Beat) -> None:
        """Together with a beat of the child; passed_s: since the one before."""
        standing, beat = self._observer.look(passed_s, [self._shared]), self._beat
        beat.header.sequence += 1
        beat.header.utc_ns = time.time_ns()
        beat.clock_ahead_s, beat.clock_bound_s = own.clock_ahead_s, own.clock_bound_s
        beat.loop, beat.turn_ago_s, beat.turn_most_s = standing.loop, standing.ago_s, MOST_S
        beat.leaving = own.leaving
        self._publisher.put(beat.SerializeToString())

    def close(self) -> None:
        """After the last beat."""
        self._token.undeclare()
        self._publisher.undeclare()
