"""Notices of alarms on their way to people: kept until they are delivered, over restarts too, tried
again after pauses that grow, and never in the way of who watches.
"""

import json
import logging
import threading
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Protocol

from pydantic import TypeAdapter, ValidationError

from dashboard.alarms.machine import LEVELS, Now, Point, State
from dashboard.alarms.state_file import write
from messages.clock import Moment
from messages.text import plain

log = logging.getLogger(__name__)

EACH_S = 60.0  # between two notices of one alarm
WAITING = 500  # notices that wait for one way; of more the oldest go, and are counted
OLDEST_S = 86400.0  # a notice that could not be delivered for so long is given up
PAUSE_FIRST, PAUSE_LONGEST = 1.0, 300.0  # s between two attempts
CLOSING_S = 2.0


@dataclass(frozen=True)
class Notice:
    """What a person is told."""

    id: str
    device: str
    level: str
    title: str
    text: str
    utc_ns: int
    times: int = 1
    more: int = 0  # raised so often since the notice before, without one
    chattering: bool = False
    first_out: bool = False
    site: str = ""
    test: bool = False

    @property
    def line(self) -> str:
        """One line for people."""
        where = self.device or "the bench"
        return plain(f"{self.level.upper()} {where}: {self.title}", 200)


class DeliveryError(Exception):
    """A notice that was not taken; the text says why."""


class Way(Protocol):
    """How notices leave the bench."""

    name: str
    level: str  # the least that is told

    def deliver(self, notice: Notice) -> None:
        """Raises DeliveryError, within its time limit."""


@dataclass
class Waiting:
    """A notice that is on its way, and since when."""

    notice: Notice
    since: tuple[str, int, int]


QUEUE = TypeAdapter(list[Waiting])


class Sender:
    """One way: its queue, kept in a file, and the thread that empties it."""

    def __init__(self, way: Way, path: Path) -> None:
        self.way, self._path = way, path
        self.sent = self.given_up = 0
        self.fault = ""  # of the last attempt
        self._queue = self._load()
        self._lock, self._wake, self._stop = threading.Lock(), threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"notices {way.name}", daemon=True)
        self._thread.start()

    @property
    def waiting(self) -> int:
        """Notices that are not delivered yet."""
        return len(self._queue)

    def offer(self, notice: Notice) -> None:
        """To be delivered, if this way is for such."""
        if LEVELS.index(notice.level) < LEVELS.index(self.way.level):
            return
        with self._lock:
            self._queue.append(Waiting(notice, tuple(Moment.now())))
            while len(self._queue) > WAITING:
                self._give_up(f"{WAITING} others wait")
            self._keep()
        self._wake.set()

    def close(self) -> None:
        """What waits is delivered by the next life."""
        self._stop.set()
        self._wake.set()
        self._thread.join(CLOSING_S)

    def _run(self) -> None:
        pause = PAUSE_FIRST
        while not self._stop.is_set():
            with self._lock:
                while self._queue and _age_s(self._queue[0]) > OLDEST_S:
                    self._give_up("it is a day old")
                first = self._queue[0] if self._queue else None
            if first is None:
                self._wake.wait()
                self._wake.clear()
                continue
            try:
                self.way.deliver(first.notice)
            except DeliveryError as error:
                self._failed(str(error), pause)
                self._stop.wait(pause)
                pause = min(2.0 * pause, PAUSE_LONGEST)
                continue
            pause, self.fault = PAUSE_FIRST, ""
            self.sent += 1
            with self._lock:
                if self._queue and self._queue[0] is first:
                    del self._queue[0]
                self._keep()

    def _failed(self, why: str, pause: float) -> None:
        if why != self.fault:
            log.warning("%s: a notice waits: %s; next attempt in %g s", self.way.name, why, pause)
        self.fault = why

    def _give_up(self, why: str) -> None:
        lost = self._queue.pop(0)
        self.given_up += 1
        log.error("%s: a notice is given up, %s: %s", self.way.name, why, lost.notice.line)

    def _keep(self) -> None:
        try:
            write(self._path, {"waiting": [asdict(one) for one in self._queue]})
        except OSError as error:
            log.error("%s: notices that wait cannot be kept: %s", self.way.name, error)

    def _load(self) -> list[Waiting]:
        try:
            content = json.loads(self._path.read_text(encoding="utf-8"))
            return QUEUE.validate_python(
                [one | {"since": tuple(one["since"])} for one in content["waiting"]]
            )
        except FileNotFoundError:
            return []
        except (OSError, ValueError, KeyError, TypeError, ValidationError) as error:
            log.error("%s: notices that waited cannot be read: %s", self.way.name, error)
            return []


def _age_s(one: Waiting) -> float:
    moment = Moment.of(one.since)
    return 0.0 if moment is None else moment.age_s


class Teller:
    """Makes notices of alarms that are raised: at most one of an alarm in a minute, the others are
    counted and told of afterwards.
    """

    def __init__(self, say: Callable[[Notice], None], site: str = "") -> None:
        self._say, self._site = say, site
        self._told: dict[tuple[str, str], float] = {}  # elapsed s
        self._more: dict[tuple[str, str], int] = {}

    def tell(self, point: Point, now: Now) -> None:
        """It was raised."""
        key = point.device, point.id
        if now.s - self._told.get(key, -EACH_S) < EACH_S:
            self._more[key] = self._more.get(key, 0) + 1
            return
        self._told[key] = now.s
        self._say(notice_of(point, self._more.pop(key, 0), self._site))

    def tick(self, points: dict[tuple[str, str], Point], now: Now) -> None:
        """Tell of those that were raised again within their minute, once it is over."""
        for key in [k for k, at in self._told.items() if now.s - at >= EACH_S]:
            more, point = self._more.pop(key, 0), points.get(key)
            del self._told[key]
            if more and point is not None and point.state is not State.SHELVED:
                self._told[key] = now.s
                self._say(notice_of(point, more, self._site))


def notice_of(point: Point, more: int, site: str) -> Notice:
    """What is told of an alarm."""
    cause = point.cause
    return Notice(
        point.id,
        point.device,
        cause.level,
        cause.title,
        cause.text,
        point.raised_ns,
        point.times,
        more,
        point.chattering,
        point.first_out,
        site,
    )
