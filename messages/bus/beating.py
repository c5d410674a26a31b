"""A process says that it is there and runs: a token that goes with its connection, and two beats a
second, which end when it is stopped by a signal, a debugger or a machine that sleeps.

Each beat also says whether its loops turn (turning.py), what the process has (boards, people who
look, the end of its certificate) and how far its clock is from that of the site's home, which it
asks now and then.
"""

import logging
import threading
import time
from collections.abc import Callable, Iterable, Mapping
from functools import cache
from importlib import metadata
from typing import Self

import zenoh
from google.protobuf.message import DecodeError

from messages.bus import deadline, tls
from messages.bus.pulse import Shared, Voice
from messages.bus.session import BusSettings, connected
from messages.bus.turning import Observer
from messages.clock import elapsed_ns
from messages.contract import gyrofree_pb2 as pb
from messages.contract.checks import check
from messages.contract.topics import BEAT, alive_key, clock_key
from messages.offset import Exchange, Offset

BEAT_S = 0.5
GONE_S = 2.0  # without a router, before that is said
ASK_FIRST, ASK_S, ASK_FIRST_S = 8, 4.0, 1.0  # questions to the clock: so many each s, then fewer
ANSWER_S = 10.0  # a slow answer has a wide bound, and is better than none
HERE = "here"  # the place of an installation that belongs to no site

log = logging.getLogger(__name__)


def place_of(bus: BusSettings) -> str:
    """The place that a process speaks for."""
    return HERE if bus.tls is None else tls.place_of(bus.tls, bus.role) or HERE


def process_name(role: str, session: zenoh.Session) -> str:
    """Of a process among all of its place."""
    return f"{role}-{str(session.zid())[:8]}"


class Beating:
    """Beats from its making to `close`. A context manager."""

    def __init__(
        self,
        session: zenoh.Session,
        bus: BusSettings,
        devices: Iterable[str] = (),
        viewers: Callable[[], Mapping[str, int]] = dict,
    ) -> None:
        """devices: boards that the process has; viewers(): people who look, by role."""
        place, name = place_of(bus), process_name(bus.role, session)
        self._session, self._viewers = session, viewers
        self._clock_key, self._offset, self._asked = clock_key(bus.prefix), Offset(), 0
        self._beat = pb.Beat(role=bus.role, session=str(session.zid()), devices=devices)
        self._beat.header.device = place
        self._beat.since_utc_ns = self._beat.header.run = time.time_ns()
        self._beat.version = _version()
        if bus.tls is not None and (life := tls.life(bus.tls, bus.role)) is not None:
            begins, ends = life
            self._beat.certificate = f"{bus.role} of {place}"
            self._beat.certificate_ends_utc_ns = int(ends.timestamp() * 1e9)
            self._beat.certificate_life_s = (ends - begins).total_seconds()
        self._publisher = session.declare_publisher(
            BEAT.key(bus.prefix, place, name),
            congestion_control=zenoh.CongestionControl.DROP,
            priority=zenoh.Priority.INTERACTIVE_HIGH,  # a queue of its own: not behind the samples
        )
        self._token = session.liveliness().declare_token(alive_key(bus.prefix, place, name))
        self._line, self._stop = _Line(bus), threading.Event()
        self._observer, self._before = Observer(), time.monotonic()
        shared = Shared.inherited()
        self._voice = Voice(session, bus.prefix, self._beat, name, shared) if shared else None
        self._is_router = bus.role == "router"  # it misses none, and knows others as routers only
        self._thread = threading.Thread(target=self._run, name="beating", daemon=True)
        self._thread.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """The last beat says that the process ends as it should."""
        self._stop.set()
        self._thread.join()
        self._beat.leaving = True
        self._put()
        if self._voice is not None:
            self._voice.close()
        self._token.undeclare()
        self._publisher.undeclare()

    def _run(self) -> None:
        due = asking = time.monotonic()
        while True:
            try:
                self._put()
                if time.monotonic() >= asking:
                    self._ask()
                    asking += ASK_FIRST_S if self._asked < ASK_FIRST else ASK_S
                self._line.look(self._is_router or connected(self._session))
            except zenoh.ZError as error:  # a session that is closed under us
                log.debug("no beat: %s", error)
            due = max(due + BEAT_S, time.monotonic())
            if self._stop.wait(due - time.monotonic()):
                return

    def _put(self) -> None:
        beat = self._beat
        beat.header.sequence += 1
        beat.header.utc_ns = time.time_ns()
        beat.ClearField("viewers")
        for role, count in sorted(self._viewers().items()):
            beat.viewers.add(role=role, count=count)
        beat.clock_ahead_s, beat.clock_bound_s = self.clock_ahead()
        if (compared := self._offset.elapsed(elapsed_ns())) is not None:
            deadline.heard(*compared)
        now = time.monotonic()
        passed_s, self._before = min(now - self._before, BEAT_S), now
        standing = self._observer.look(passed_s)
        beat.loop, beat.doing = standing.loop[:64], standing.doing[:128]
        beat.turn_ago_s, beat.turn_most_s = standing.ago_s, standing.most_s
        self._publisher.put(beat.SerializeToString())
        if self._voice is not None:
            self._voice.put(passed_s, beat)

    def clock_ahead(self) -> tuple[float, float]:
        """Our wall clock minus that of the site, s, and the most that this may be wrong by; NaN for
        both where it is not known.
        """
        now = elapsed_ns()
        wall, best = time.time_ns() - now, self._offset.at(now)
        if best is None:
            return float("nan"), float("nan")
        return (wall - best.theta_ns) * 1e-9, best.bound_ns * 1e-9

    def _ask(self) -> None:
        self._asked += 1
        t1 = elapsed_ns()

        def on_reply(reply: zenoh.Reply) -> None:
            t4 = elapsed_ns()
            if reply.ok is None:
                return
            said = pb.ClockReply()
            try:
                said.ParseFromString(reply.ok.payload.to_bytes()[:64])
            except DecodeError:
                self._offset.refused += 1
                return
            if check(said):
                self._offset.refused += 1
            else:
                times = said.received_ns, said.answered_ns
                self._offset.take(Exchange(t1, *times, t4, said.wall_ns))

        self._session.get(
            self._clock_key,
            on_reply,
            timeout=ANSWER_S,
            priority=zenoh.Priority.INTERACTIVE_HIGH,
            express=True,
        )


class _Line:
    """Says once that the router is gone, with the reason where it is ours, and that it is back."""

    def __init__(self, bus: BusSettings) -> None:
        self._bus, self._since, self._said = bus, 0.0, False

    def look(self, there: bool) -> None:
        """A few times a second."""
        now = time.monotonic()
        if there:
            if self._said:
                log.info("the router %s is back", self._bus.router)
            self._since, self._said = 0.0, False
        elif not self._since:
            self._since = now
        elif not self._said and now - self._since > GONE_S:
            self._said = True
            wrong = tls.trouble(self._bus.tls, self._bus.role) if self._bus.tls else ""
            why = f" ({wrong})" if wrong else ""
            log.warning(
                "the router %s is gone: what is said is kept until it is back%s",
                self._bus.router,
                why,
            )


def tell_time(session: zenoh.Session, prefix: str) -> "zenoh.Queryable[None]":
    """Answer, by this machine's clock, what time it is at the site."""

    def on_query(query: zenoh.Query) -> None:
        received = elapsed_ns()
        said = pb.ClockReply(received_ns=received, wall_ns=time.time_ns() - elapsed_ns())
        said.answered_ns = elapsed_ns()
        query.reply(clock_key(prefix), said.SerializeToString(), express=True)

    return session.declare_queryable(clock_key(prefix), on_query)


@cache
def _version() -> str:
    try:
        return metadata.version("gyrofree")[:60]
    except metadata.PackageNotFoundError:
        return ""
