"""A recording goes over the bus again, so that estimator and dashboard take it for a live device.

Only what came from the device is sent (INPUTS); estimates are made anew by the estimator that listens. The device is
renamed, `cube` to `cube-replay`, so that a replay never mixes with the board itself; nothing else in a message changes:
times, run, sequence and source stay those of the recording.
"""

import logging
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import zenoh
from google.protobuf.message import DecodeError, Message

from messages.bus import BusSettings, BusUnavailable, open_client
from messages.topics import ACCEL, BOARD, GNSS, IMU, LINK, LOCATION, TACHO, TRUTH, Address, Topic, TopicError, parse
from sessions.mcap_log import Damage, read

log = logging.getLogger(__name__)

INPUTS: tuple[Topic, ...] = (ACCEL, IMU, TACHO, GNSS, LINK, BOARD, TRUTH, LOCATION)
SUFFIX = "-replay"
LONGEST_NAME = 32  # of a device, see messages.topics.NAME
PROGRESS_S = 5.0
MATCH_S = 0.25  # at most, for the router to say that somebody listens to a key
DRAIN_S = 0.2  # after the last message, so that the session does not close over what is still being sent


@dataclass(frozen=True)
class Progress:
    """How far a replay has come."""

    seconds: float  # of the recording, since its first input
    messages: int
    unreadable: int  # messages of the recording that could not be decoded and were left out
    behind_s: float  # how late the last message went out against the speed asked for


@dataclass(frozen=True)
class Input:
    """One recorded input message."""

    log_ns: int
    address: Address
    message: Message


def renamed(device: str, suffix: str = SUFFIX) -> str:
    """Name of a device when it is replayed; an empty suffix keeps the name."""
    return device[: LONGEST_NAME - len(suffix)] + suffix


def inputs(
    path: Path, topics: tuple[Topic, ...] = INPUTS, on_bad: Callable[[str], None] | None = None
) -> Iterator[Input]:
    """Decoded messages of these topics in the order of recording; `on_bad(key)` is told of undecodable ones.

    A file without an end is read as far as it goes. Raises OSError when it cannot be opened, ValueError for a file
    that is no recording at all.
    """
    damage, any_message = Damage(), False
    for recorded in read(path, damage):
        any_message = True
        try:
            address = parse(recorded.key)
            if address.topic not in topics:
                continue
            message = address.topic.type.FromString(recorded.payload)
        except (TopicError, DecodeError):
            if on_bad is not None:
                on_bad(recorded.key)
            continue
        yield Input(recorded.log_ns, address, message)
    if not any_message and damage.tail:
        raise ValueError(f"{path}: no message in it, {damage}: want an MCAP recording")


def rename(message: Message, old: str, new: str) -> None:
    """Put the new device name where the message carries the old one: header.device, or a frame of its name."""
    fields = message.DESCRIPTOR.fields_by_name
    if "header" in fields:
        message.header.device = new
    elif "frame_id" in fields and message.frame_id.split("/")[0] == old:
        message.frame_id = new + message.frame_id[len(old) :]


class Outlet:
    """Publishers that lose nothing at their beginning.

    A publisher just declared drops what it is given until the router has told it of its subscribers (measured: up to
    13 ms); so the first message of a key waits for that, at most MATCH_S.
    """

    def __init__(self, session: zenoh.Session, prefix: str) -> None:
        self._session = session
        self._prefix = prefix
        self._by_key: dict[str, zenoh.Publisher] = {}
        self.waited_s = 0.0

    def put(self, address: Address, device: str, message: Message) -> None:
        """Publish as it is: sequence and run stay those of the recording."""
        key = address.topic.key(self._prefix, device, address.estimator)
        publisher = self._by_key.get(key)
        if publisher is None:
            publisher = self._by_key[key] = self._session.declare_publisher(
                key,
                congestion_control=zenoh.CongestionControl.BLOCK,  # a replay may wait, but must not lose
                express=True,
            )
            begun = time.monotonic()
            while not publisher.matching_status.matching and time.monotonic() - begun < MATCH_S:
                time.sleep(0.002)
            self.waited_s += time.monotonic() - begun
        publisher.put(message.SerializeToString(deterministic=True))


def replay(
    path: Path,
    outlet: Outlet,
    stop: threading.Event,
    *,
    speed: float = 1.0,
    suffix: str = SUFFIX,
    on_progress: Callable[[Progress], None] | None = None,
) -> Progress:
    """Publish a recording's inputs at `speed` times real time, paced by their receive times; returns the final state.

    Ends early when `stop` is set. A pause of the recording is waited for like any other interval. Raises ValueError for
    a speed that is not positive and finite and for a file that is no recording, OSError when it cannot be read.
    """
    if not 0.0 < speed < float("inf"):
        raise ValueError(f"speed {speed}: want a positive number, 1 for real time")
    bad: list[str] = []
    sent, first_ns, seconds, behind, told = 0, None, 0.0, 0.0, 0.0
    begun, waited_before = time.monotonic(), 0.0
    for item in inputs(path, on_bad=bad.append):
        if first_ns is None:
            first_ns, begun, waited_before = item.log_ns, time.monotonic(), outlet.waited_s
        seconds = (item.log_ns - first_ns) / 1e9
        wait = begun + outlet.waited_s - waited_before + seconds / speed - time.monotonic()
        if stop.wait(wait) if wait > 0.0 else stop.is_set():
            break
        behind = max(0.0, -wait)
        device = renamed(item.address.device, suffix)
        rename(item.message, item.address.device, device)
        outlet.put(item.address, device, item.message)
        sent += 1
        if on_progress is not None and time.monotonic() - told >= PROGRESS_S:
            told = time.monotonic()
            on_progress(Progress(seconds, sent, len(bad), behind))
    final = Progress(seconds, sent, len(bad), behind)
    if on_progress is not None:
        on_progress(final)
    return final


def run(
    path: Path,
    bus: BusSettings,
    stop: threading.Event,
    *,
    speed: float = 1.0,
    suffix: str = SUFFIX,
    on_progress: Callable[[Progress], None] | None = None,
) -> Progress:
    """`replay` with a bus session of its own; raises what `replay` raises, and BusUnavailable without a router."""
    try:
        session = open_client(bus, stop)
    except BusUnavailable:
        if stop.is_set():
            return Progress(0.0, 0, 0, 0.0)
        raise
    with session:
        outlet = Outlet(session, bus.prefix)
        final = replay(path, outlet, stop, speed=speed, suffix=suffix, on_progress=on_progress or _log)
        stop.wait(DRAIN_S)
    log.info("replayed %d messages, %.1f s, %d left out as unreadable", final.messages, final.seconds, final.unreadable)
    return final


def _log(progress: Progress) -> None:
    log.info("%.1f s, %d messages%s", progress.seconds, progress.messages, _late(progress))


def _late(progress: Progress) -> str:
    return f", {progress.behind_s:.2f} s behind: slower than asked for" if progress.behind_s > 0.1 else ""
