"""What of a recording goes over the bus again, under which name, and how; playback.py plays it.

What came from the device is sent (INPUTS). The device is renamed, `cube` to `cube-replay`, so that
a replay never mixes with the board itself; nothing else in a message changes: times, run, sequence
and source stay those of the recording.
"""

import time
from dataclasses import dataclass

import zenoh
from google.protobuf.message import Message

from messages.contract.topics import (
    BOARD,
    LINK,
    LOCATION,
    PIPELINE_INPUTS,
    REPLAY_SUFFIX,
    SKY,
    TRUTH,
    Address,
    Topic,
)

INPUTS: tuple[Topic, ...] = (*PIPELINE_INPUTS, LINK, BOARD, TRUTH, LOCATION, SKY)
LONGEST_NAME = 32  # of a device, see messages.contract.topics.NAME
MATCH_S = 0.25  # at most, for the router to say that somebody listens to a key
DRAIN_S = (
    0.2  # after the last message, so that the session does not close over what is still being sent
)


@dataclass(frozen=True)
class Input:
    """One recorded input message."""

    log_ns: int
    address: Address
    message: Message


def renamed(device: str, suffix: str = REPLAY_SUFFIX) -> str:
    """Name of a device when it is replayed; an empty suffix keeps the name."""
    return device[: LONGEST_NAME - len(suffix)] + suffix


def rename(message: Message, old: str, new: str) -> None:
    """Put the new device name where the message carries the old one: header.device, or a frame of
    its name.
    """
    fields = message.DESCRIPTOR.fields_by_name
    if "header" in fields:
        message.header.device = new
    elif "frame_id" in fields and message.frame_id.split("/")[0] == old:
        message.frame_id = new + message.frame_id[len(old) :]


class Outlet:
    """Publishers that lose nothing at their beginning.

    A publisher just declared drops what it is given until the router has told it of its subscribers
    (measured: up to 13 ms); so the first message of a key waits for that, at most MATCH_S.
    """

    def __init__(self, session: zenoh.Session, prefix: str) -> None:
        self._session = session
        self._prefix = prefix
        self._by_key: dict[str, zenoh.Publisher] = {}

    def put(self, address: Address, device: str, message: Message) -> None:
        """Publish as it is: sequence and run stay those of the recording."""
        key = address.topic.key(self._prefix, device, address.estimator)
        publisher = self._by_key.get(key)
        if publisher is None:
            publisher = self._by_key[key] = self._session.declare_publisher(
                key,
                # a replay may wait, but must not lose
                congestion_control=zenoh.CongestionControl.BLOCK,
                express=True,
            )
            begun = time.monotonic()
            while not publisher.matching_status.matching and time.monotonic() - begun < MATCH_S:
                time.sleep(0.002)
        publisher.put(message.SerializeToString(deterministic=True))
