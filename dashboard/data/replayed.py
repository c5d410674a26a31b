"""What is known of a replay: whether it plays, and which devices are its own. Called under the
store's lock.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import REPLAY_SUFFIX

ENDED_S = 5.0  # without a status a replay has ended; the next one is another


@dataclass
class Replayed:
    """The newest status and three moments by time.monotonic(), s; infinite where there was none."""

    status: pb.ReplayStatus | None = None
    arrived: float = -np.inf  # of the newest status
    began: float = -np.inf  # the first status of this replay
    paused_at: float = np.inf  # the first status that said that it stands still

    def take(self, status: pb.ReplayStatus, arrived: float) -> None:
        """One more status."""
        if (
            self.status is None
            or arrived - self.arrived > ENDED_S
            or self.status.session != status.session
        ):
            self.began, self.paused_at = arrived, np.inf
        self.paused_at = min(self.paused_at, arrived) if status.paused else np.inf
        self.status, self.arrived = status, arrived

    def age(self, now: float) -> float:
        """Seconds since the newest status."""
        return now - self.arrived

    def state(self, device: str, now: float) -> str:
        """'playing', 'paused' or 'ended' for a device of a replay, '' for any other."""
        if not device.endswith(REPLAY_SUFFIX):
            return ""
        if self.status is None or self.age(now) > ENDED_S:
            return "ended"
        return "paused" if self.status.paused else "playing"

    def clock(self, device: str, now: float) -> float:
        """What the age of a device's messages counts to: time stands still for a replay that does,
        too.
        """
        return min(now, self.paused_at) if self.state(device, now) == "paused" else now

    def device(self, devices: Mapping) -> str | None:
        """First one of `devices` that this replay has sent data of; None before."""
        for name in sorted(devices):
            if name.endswith(REPLAY_SUFFIX) and any(
                one.arrived > self.began for one in devices[name].latest.values()
            ):
                return name
        return None
