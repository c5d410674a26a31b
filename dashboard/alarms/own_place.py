"""Alarms of a place that runs no service of alarms, as an office: about itself, and about other
places that it does not reach, which nobody else can tell it.

What home's service finds is told at home. Here it is the disk of the copies, clock, certificates
and services of this place, and a place out of reach. It is told by [alarms.mail] and
[alarms.webhook] of this place's gyrofree.toml; nothing is published, for an office has no right to.
"""

import contextlib
import logging
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import zenoh

from dashboard.alarms.book import Book
from dashboard.alarms.machine import Now
from dashboard.alarms.notices import Notice, Sender, Teller
from dashboard.alarms.places import Certificates
from dashboard.alarms.settings import AlarmSettings
from dashboard.alarms.state_file import load, save
from dashboard.alarms.watch import Watch
from dashboard.alarms.ways import ways_of
from dashboard.data.fault import Alarm
from dashboard.data.store import Store
from messages.bus.presence import Presence, Watching
from messages.bus.session import BusSettings, connected, subscribe
from messages.bus.turning import Loop
from messages.clock import Clock, elapsed_s
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import BEAT
from messages.text import plain

LOOK_S = 0.2

log = logging.getLogger(__name__)


class OwnPlace:
    """What is wrong with this place, as its presence shows it."""

    def __init__(
        self,
        presence: Presence,
        settings: AlarmSettings,
        recordings: Path,
        certificates: Path | None,
        book: Book | None = None,
    ) -> None:
        """recordings, certificates: folders of this place's; book: what is known of before."""
        self._presence, self.book = presence, Book() if book is None else book
        store = Store()
        store.presence = presence
        only_faults = settings.model_copy(update={"limits": []})
        own = Certificates(certificates)
        self._watch = Watch(store, only_faults, recordings, self.book, own, only=self._is_ours)

    def look(self, now: Now) -> None:
        """Once; a few times a second."""
        self._watch.look(now)

    def faults(self) -> list[Alarm]:
        """What is there now, for the page."""
        return [
            Alarm(
                point.cause.kind,
                point.cause.title,
                point.cause.text,
                point.cause.page,
                id.removeprefix(f"{point.cause.kind}-") if id != point.cause.kind else "",
                level=point.cause.level,
                raised_s=point.raised_ns * 1e-9,
            )
            for (_, id), point in self.book.points.items()
            if point.active
        ]

    def _is_ours(self, id: str) -> bool:
        here = self._presence.here
        beginnings = ("place-", f"service-{here}-", f"certificate-{here}-", "certificate-own-")
        return id in ("disk", f"clock-{here}") or id.startswith(beginnings)


@contextlib.contextmanager
def shown(own: OwnPlace, show: Callable[[list[Alarm]], None]) -> Iterator[None]:
    """Look on a thread of its own while the block runs, and show what is found."""
    with _looking(own, lambda _: show(own.faults())):
        yield


@contextlib.contextmanager
def told(
    session: zenoh.Session,
    bus: BusSettings,
    place: str,
    settings: AlarmSettings,
    recordings: Path,
) -> Iterator[None]:
    """Listen to who is there, and tell people, while the block runs. The state is kept in
    [alarms] state, so that a restart tells nothing twice.
    """
    presence = Presence(place)
    watching = Watching(session, bus.prefix, presence)

    def heard(key: str, beat: pb.Beat) -> None:
        _, there, _, name = key.split("/")
        presence.beat(there, name, beat)

    beats = subscribe(session, BEAT, bus.prefix, heard)
    book, limits, users, _ = load(settings.state)
    own = OwnPlace(presence, settings, recordings, bus.tls, book)
    senders = [
        Sender(way, settings.state.with_name(f"{settings.state.stem}.{way.name}.json"))
        for way in ways_of(settings)
    ]

    def say(notice: Notice) -> None:
        log.warning("%s: %s", notice.line, plain(notice.text, 300))
        for sender in senders:
            sender.offer(notice)

    teller, clock = Teller(say, bus.prefix), Clock()
    book.tell = lambda point: teller.tell(point, Now(elapsed_s(), clock.now_ns()))

    def then(now: Now) -> None:
        teller.tick(book.points, now)
        if book.changed:
            try:
                save(settings.state, book, limits, users)
                book.changed = False
            except OSError as error:
                log.error("%s cannot be written: %s", settings.state, error.strerror)

    try:
        look = lambda: presence.look(time.monotonic(), connected(session))  # noqa: E731
        with _looking(own, then, look):
            yield
    finally:
        beats.undeclare()
        watching.undeclare()
        for sender in senders:
            sender.close()


@contextlib.contextmanager
def _looking(
    own: OwnPlace, then: Callable[[Now], None], first: Callable[[], object] = lambda: None
) -> Iterator[None]:
    stop, clock = threading.Event(), Clock()

    def run() -> None:
        with Loop("own alarms") as loop:
            while not stop.wait(LOOK_S):
                loop.turn()
                first()
                now = Now(elapsed_s(), clock.now_ns())
                try:
                    own.look(now)
                    then(now)
                except Exception:  # a fault of ours must not end the watch
                    log.exception("alarms of this place cannot be judged")

    thread = threading.Thread(target=run, name="own alarms", daemon=True)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join(2.0)
