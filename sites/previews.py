"""Home's previews: what its boards and estimators say, in frames at several rates, and what was.

Zenoh's thread only puts the newest message of each topic in its place; a thread of ours makes the
frames that somebody watches, and one a second for the overview of what was, kept in memory.
"""

import logging
import threading
import time
from collections import defaultdict, deque
from dataclasses import dataclass, field

import zenoh
from google.protobuf.message import DecodeError

from messages.bus.turning import Loop
from messages.contract import gyrofree_pb2 as pb
from messages.contract import topics as tp
from messages.contract.checks import check
from messages.history.answers import ask
from messages.previews.frames import (
    FRAMED,
    OVERVIEW,
    RATES,
    SOURCES,
    Frame,
    frame_key,
    overview_key,
    packed,
)
from messages.previews.thinning import frame_of

LOOK_S = 0.004  # shorter than the pause between two frames of the highest rate
IDLE_S = 0.2  # likewise, of the overview alone
KEPT_EVERY_S = 1.0  # one message of a topic, for the overview
KEPT_S = 4 * 3600.0
KEPT_BYTES = 64 << 20  # of all devices
SEED_S = 600.0  # so far back the publishers are asked when this process begins
MOST_DEVICES = 64
MOST_NAMES = 64  # of a device: topics with their estimators
FEW = 16  # messages of a slow topic in one frame: more than its rate are no picture

log = logging.getLogger(__name__)


@dataclass
class Device:
    """What is kept of one."""

    waiting: dict[int, dict[str, list[bytes]]] = field(
        default_factory=lambda: {rate: {} for rate in (*RATES, 0)}
    )  # by rate, 0 the overview: what came since the last frame
    kept: deque[Frame] = field(default_factory=deque)
    seeded: bool = False


class Previews:
    """Frames of all boards of a site, as long as it is open."""

    def __init__(self, session: zenoh.Session, site: str) -> None:
        self._session, self._site = session, site
        self._lock, self._stop = threading.Lock(), threading.Event()
        self._devices: dict[str, Device] = defaultdict(Device)
        self._bytes = 0  # of what is kept
        self._watched: set[int] = set()  # rates
        self._publishers: dict[tuple[str, int], zenoh.Publisher] = {}
        self._subscribers = [
            session.declare_subscriber(topic.pattern(site), self._on_sample(topic))
            for topic in FRAMED
        ]
        self._queryable = session.declare_queryable(overview_key(site, "*"), self._on_query)
        self._threads = [
            threading.Thread(target=work, name=f"previews {work.__name__}", daemon=True)
            for work in (self._make, self._seed)
        ]
        for thread in self._threads:
            thread.start()

    def at(self, session: zenoh.Session, lane: str) -> zenoh.Queryable:
        """Answer what was on a lane too."""
        return session.declare_queryable(f"{lane}/{OVERVIEW}/*", self._on_query)

    def close(self) -> None:
        """Make no more."""
        self._stop.set()
        for one in (*self._subscribers, self._queryable):
            one.undeclare()
        for thread in self._threads:
            thread.join(5.0)

    # --- Zenoh's threads

    def _on_sample(self, topic: tp.Topic):
        def on_sample(sample: zenoh.Sample) -> None:
            parts = str(sample.key_expr).split("/")
            name = "/".join(parts[2:])
            payload = sample.payload.to_bytes()
            with self._lock:
                if parts[1] not in self._devices and len(self._devices) >= MOST_DEVICES:
                    return
                device = self._devices[parts[1]]
                for rate in (*self._watched, 0):
                    names = device.waiting[rate]
                    if name not in names and len(names) >= MOST_NAMES:
                        continue
                    if topic.rate > max(rate, 1.0):
                        names[name] = [payload]
                    else:  # slower than the frames: each is sent
                        names[name] = [*names.get(name, ()), payload][-FEW:]

        return on_sample

    def _on_query(self, query: zenoh.Query) -> None:
        try:
            parts = str(query.key_expr).split("/")
            name = parts[-1] if parts[-2] == OVERVIEW else parts[1]
            question = pb.HistoryQuery.FromString(
                query.payload.to_bytes() if query.payload is not None else b""
            )
            wrong = check(question)
        except (DecodeError, IndexError):
            query.reply_err(b"want a HistoryQuery about a device")
            return
        if wrong:
            query.reply_err(f"overview: {wrong[0]}".encode())
            return
        frames = self.overview(name, question)
        query.reply(str(query.key_expr), packed(frames, time.time_ns()))

    # --- what was

    def overview(self, name: str, question: pb.HistoryQuery) -> list[Frame]:
        """One message of each topic in `every_s`, within the times asked for."""
        until_ns = question.until_utc_ns or 1 << 62
        step_ns, last, found = 0.99e9 * max(question.every_s, KEPT_EVERY_S), {}, []
        with self._lock:
            kept = list(self._devices[name].kept) if name in self._devices else []
        for one in kept:
            if not question.from_utc_ns <= one.utc_ns <= until_ns:
                continue
            if one.name not in last or abs(one.utc_ns - last[one.name]) >= step_ns:
                last[one.name] = one.utc_ns
                found.append(one)
        return found

    def _keep(self, device: Device, frames: list[Frame], at_end: bool = True) -> None:
        """Under the lock."""
        (device.kept.extend if at_end else device.kept.extendleft)(frames)
        self._bytes += sum(len(one.payload) for one in frames)
        newest_ns = device.kept[-1].utc_ns if device.kept else 0
        while device.kept and newest_ns - device.kept[0].utc_ns > KEPT_S * 1e9:
            self._bytes -= len(device.kept.popleft().payload)
        while self._bytes > KEPT_BYTES:
            largest = max(self._devices.values(), key=lambda one: len(one.kept))
            self._bytes -= len(largest.kept.popleft().payload)

    def _seed(self) -> None:
        """What was before this process began, from the publishers' own books."""
        while not self._stop.wait(KEPT_EVERY_S):
            with self._lock:
                new = [name for name, one in self._devices.items() if not one.seeded]
            for name in new:
                frames = [one for source in SOURCES[:2] for one in self._past(name, source)]
                with self._lock:
                    device = self._devices[name]
                    device.seeded = True
                    first = device.kept[0].utc_ns if device.kept else 1 << 62
                    before = sorted(
                        (one for one in frames if one.utc_ns < first), key=lambda one: -one.utc_ns
                    )
                    self._keep(device, before, at_end=False)

    def _past(self, name: str, source: str) -> list[Frame]:
        query = pb.HistoryQuery(
            from_utc_ns=time.time_ns() - int(SEED_S * 1e9), every_s=KEPT_EVERY_S
        )
        try:
            reply = ask(self._session, self._site, name, source, query)
        except zenoh.ZError as error:
            log.warning("no overview of what was before, of %s: %s", name, error)
            return []
        made = []
        for item in reply.items if reply is not None else ():
            topic = tp.BY_NAME.get(item.topic.partition("/")[0])
            if topic in FRAMED:
                made.append(frame_of(topic, item.topic, item.payload))
        return [one for one in made if one is not None]

    # --- frames

    def _make(self) -> None:
        due = dict.fromkeys((*RATES, 0), 0.0)
        looked = 0.0
        with Loop("previews") as loop:
            while not self._stop.wait(LOOK_S if self._watched else IDLE_S):
                loop.turn()
                now = time.monotonic()
                if now - looked > IDLE_S:
                    looked = now
                    self._look()
                for rate in due:
                    if now < due[rate]:
                        continue
                    period = 1.0 / rate if rate else KEPT_EVERY_S
                    due[rate] = max(due[rate] + period, now)
                    self._round(rate)

    def _look(self) -> None:
        """Which rates are watched?"""
        with self._lock:
            names = list(self._devices)
        for name in names:
            for rate in RATES:
                if (name, rate) not in self._publishers:
                    self._publishers[name, rate] = self._session.declare_publisher(
                        frame_key(self._site, name, rate),
                        congestion_control=zenoh.CongestionControl.DROP,
                        # a frame waits behind one other at most (messages/bus/settings.py)
                        priority=zenoh.Priority.INTERACTIVE_LOW,
                        express=True,
                    )
        watched = {
            rate for (_, rate), one in self._publishers.items() if one.matching_status.matching
        }
        with self._lock:
            for rate in self._watched - watched:
                for device in self._devices.values():
                    device.waiting[rate].clear()
            self._watched = watched

    def _round(self, rate: int) -> None:
        """One frame of each device that said something."""
        with self._lock:
            taken = [(name, device, device.waiting[rate]) for name, device in self._devices.items()]
            for _, device, names in taken:
                if names:
                    device.waiting[rate] = {}
        for name, device, names in taken:
            if names and (frames := _thinned(names)):
                publisher = self._publishers.get((name, rate))
                if publisher is not None:
                    publisher.put(packed(frames, time.time_ns()))
                elif not rate:
                    with self._lock:
                        self._keep(device, frames)


def _thinned(names: dict[str, list[bytes]]) -> list[Frame]:
    found = []
    for name, payloads in names.items():
        topic = tp.BY_NAME[name.partition("/")[0]]
        found += [frame_of(topic, name, payload) for payload in payloads]
    return [one for one in found if one is not None]
