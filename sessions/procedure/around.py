"""What goes on around the boards under test: their lines, the recorder, the router."""

import math
import time
from collections import deque
from collections.abc import Callable

import zenoh

from messages.bus.fencing import Fence
from messages.bus.session import connected, subscribe
from messages.contract import gyrofree_pb2 as pb
from messages.contract.door import Door
from messages.contract.topics import LINK, RECORDER, STATUS, parse

GATEWAY_S = 3.0  # s without a word on a line, of which one comes every second


class Around:
    """Listens on Zenoh's threads; `recorder` is emptied by the service's own."""

    def __init__(self, session: zenoh.Session, prefix: str, found: Callable[[str], None]) -> None:
        """found(device): a device has been heard of."""
        self.recorder: deque[pb.RecorderStatus] = deque(maxlen=10)
        self._session, self._found = session, found
        self._lines: dict[str, tuple[float, pb.LinkStatus]] = {}  # heard when, and what
        # a table turns by what is heard: only from those who have claimed to say it
        self.fence = Fence(Door("procedures").refuse)
        self._kept = [
            self.fence.declare(session, prefix),
            subscribe(session, LINK, prefix, self._on_link, fence=self.fence),
            subscribe(
                session,
                STATUS,
                prefix,
                lambda _, status: self.recorder.append(status),
                RECORDER,
                self.fence,
            ),
        ]

    def _on_link(self, key: str, status: pb.LinkStatus) -> None:
        device = parse(key).device
        self._lines[device] = time.monotonic(), status
        self._found(device)

    def silence(self, device: str) -> str:
        """Why no samples of a device come, as far as it is known."""
        if not connected(self._session):
            return "the router is gone"
        at, line = self._lines.get(device, (-math.inf, None))
        if line is None or time.monotonic() - at > GATEWAY_S:
            return "the gateway is silent"
        if not line.connected:
            return f"the line to the board is down: {line.message}".rstrip(": ")
        return "the board sends none"

    def close(self) -> None:
        """Listen no more."""
        for listening in self._kept:
            listening.undeclare()
