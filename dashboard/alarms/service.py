"""`gyrofree alarms`: watches limits and faults, keeps what is an alarm, tells people, takes their
orders. There is one that serves; others wait. What it knows survives it in [alarms] state.
"""

import logging
import threading
from collections import deque
from pathlib import Path

import zenoh
from pydantic import ValidationError

from dashboard.alarms import said
from dashboard.alarms.book import Event, NoSuchAlarm
from dashboard.alarms.machine import Now
from dashboard.alarms.notices import DeliveryError, Notice, Sender, Teller
from dashboard.alarms.places import Certificates
from dashboard.alarms.settings import AlarmSettings
from dashboard.alarms.state_file import load, save
from dashboard.alarms.watch import Watch
from dashboard.alarms.ways import ways_of
from dashboard.data.feed import Feed
from dashboard.data.store import Store
from logs.figures.quantity import ExpressionError
from messages.bus import orders
from messages.bus.claiming import Claim
from messages.bus.session import BusSettings
from messages.bus.turning import Loop
from messages.bus.turns import in_turn, sessions
from messages.clock import Clock, elapsed_s
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import ALARM, ALARMS
from messages.history.keeping import KeptPublishers
from messages.text import check as fault_of
from messages.text import plain

log = logging.getLogger(__name__)

TICK_S = 0.2
STATUS_S = 2.0
MOST_BYTES = 32 << 20  # of the samples that limits are judged by
MOST_LIMITS = 200
ORDERS = 100  # that wait
SHOWN, HISTORY = 200, 300  # alarms in a status, events in an answer
COMMAND = pb.AlarmCommand
Order = orders.Order[pb.AlarmCommand, pb.AlarmReply]


class Service:
    """One life. Zenoh's threads only put orders into a queue."""

    def __init__(
        self,
        settings: AlarmSettings,
        recordings: Path,
        session: zenoh.Session,
        prefix: str,
        number: int = 0,
        certificates: Path | None = None,
    ) -> None:
        """number: of the claim. recordings, certificates: folders of this place's."""
        self._settings, self._clock, self._site = settings, Clock(), prefix
        kept = settings.state.with_suffix(".published")
        self._publishers = KeptPublishers(session, prefix, ALARMS, kept, number)
        book, limits, self._users, self._trouble = load(settings.state)
        self._store = Store(most_bytes=MOST_BYTES)
        own = Certificates(certificates)
        self._watch = Watch(self._store, settings, recordings, book, own)
        self._fixed = {limit.name for limit in settings.limits}
        self._own = {one.name: one for one in limits if one.name not in self._fixed}
        for limit in [*settings.limits, *self._own.values()]:
            try:
                self._watch.set_limit(limit)
            except ExpressionError as error:
                self._trouble = f"limit {limit.name}: {error}"
                log.error("%s", self._trouble)
        self._senders = [
            Sender(way, settings.state.with_name(f"{settings.state.stem}.{way.name}.json"))
            for way in ways_of(settings)
        ]
        self._teller = Teller(self._say, prefix)
        book.tell = lambda point: self._teller.tell(point, self._now())
        self._orders: deque[Order] = deque()
        self.wake = threading.Event()
        self._sent: dict[str, tuple[float, bytes]] = {}  # device: when, and what was said
        self._feed = Feed(session, prefix, self._store, threading.Event(), past=False)
        self._taking = orders.take(session, prefix, orders.ALARMS, self._on_order)

    def _on_order(self, order: Order) -> None:
        if len(self._orders) >= ORDERS:
            order.refuse("too many orders wait")
            return
        self._orders.append(order)
        self.wake.set()

    def _now(self) -> Now:
        return Now(elapsed_s(), self._clock.now_ns())

    def step(self) -> None:
        """Orders, a look at everything, what changed is kept and said. A few times a second."""
        now, book = self._now(), self._watch.book
        answers = []
        while self._orders:
            order = self._orders.popleft()
            answers.append((order, *self._obey(order.command, now)))
        try:
            self._watch.look(now)
        except Exception as error:  # a fault of ours must not end the watch over all the rest
            trouble = f"a fault of this program: {type(error).__name__}: {plain(error, 200)}"
            if trouble != self._trouble:
                log.exception("alarms cannot be judged")
            self._trouble = trouble
        self._teller.tick(book.points, now)
        if book.changed:
            self._save()
        for order, ok, message in answers:
            if order.command.action == COMMAND.ACTION_TEST:
                threading.Thread(target=self._test, args=(order,), daemon=True).start()
            else:
                order.answer(self._reply(ok, message))
        self._publish(now)

    def close(self, tidy: bool = True) -> None:
        """End. Not tidy: another has taken over, and what is kept is its own now."""
        self._taking.undeclare()
        self._feed.stop()
        for sender in self._senders:
            sender.close()
        self._publishers.close()
        if tidy and self._watch.book.changed:
            self._save()

    # --- keeping and saying

    def _save(self) -> None:
        book = self._watch.book
        try:
            save(self._settings.state, book, list(self._own.values()), self._users)
        except OSError as error:
            trouble = f"{self._settings.state} cannot be written: {error.strerror}"
            if trouble != self._trouble:
                log.error("%s; it is tried again and again", trouble)
            self._trouble = trouble
            return
        book.changed = False
        if self._trouble.startswith(f"{self._settings.state} cannot"):
            self._trouble = ""

    def _say(self, notice: Notice) -> None:
        log.warning("%s: %s", notice.line, plain(notice.text, 300))
        for sender in self._senders:
            sender.offer(notice)

    def _publish(self, now: Now) -> None:
        with self._store.lock:
            sources = {
                name: said.source(self._store.devices[name].get("link"))
                for name in self._store.names()
            }
        for device, source in sources.items():
            if device.endswith("-replay"):
                continue
            points = [p for key, p in self._watch.book.points.items() if key[0] in ("", device)]
            alarms = [said.alarm(point, now) for point in said.in_order(points)[:SHOWN]]
            content = b"".join(said.steady(one) for one in alarms)
            when, before = self._sent.get(device, (-STATUS_S, b""))
            if now.s - when < STATUS_S and content == before:
                continue
            self._sent[device] = now.s, content
            message = pb.AlarmStatus(alarms=alarms)
            message.header.device, message.header.run = device, self._publishers.run
            message.header.utc_ns, message.header.source = now.utc_ns, source
            self._publishers.put(ALARM, device, message)

    def _reply(self, ok: bool, message: str) -> pb.AlarmReply:
        now, book = self._now(), self._watch.book
        trouble = self._trouble
        if book.refused:
            trouble += f"; {book.refused} alarms beyond {len(book.points)} are not kept"
        points = said.in_order(book.points.values())[:500]
        return pb.AlarmReply(
            ok=ok,
            message=plain(message, 1000),
            alarms=[said.alarm(point, now) for point in points],
            limits=[self._limit(name) for name in sorted(self._watch.limits)[:MOST_LIMITS]],
            history=[said.event(one) for one in reversed(book.history[-HISTORY:])],
            ways=[said.way(one) for one in self._senders],
            trouble=plain(trouble.strip("; "), 400),
        )

    def _limit(self, name: str) -> pb.AlarmLimit:
        eyes = {key[1]: eye for key, eye in self._watch.eyes.items() if key[0] == name}
        fixed, user = name in self._fixed, self._users.get(name, "")
        return said.limit(self._watch.limits[name], fixed, user, eyes)

    # --- orders

    def _obey(self, command: pb.AlarmCommand, now: Now) -> tuple[bool, str]:
        """Whether it was done, and what to say of it."""
        book, who = self._watch.book, plain(command.user, 60)
        about = command.device, command.id
        if fault := fault_of(command.text, lines=True):
            return False, f"the text: {fault}"
        try:
            match command.action:
                case COMMAND.ACTION_LIST | COMMAND.ACTION_TEST:
                    return True, ""
                case COMMAND.ACTION_ACKNOWLEDGE:
                    book.acknowledge(*about, who, command.text, now)
                    return True, "acknowledged"
                case COMMAND.ACTION_SHELVE:
                    book.shelve(*about, who, command.text, command.seconds, now)
                    return True, f"shelved for {command.seconds:g} s"
                case COMMAND.ACTION_UNSHELVE:
                    book.unshelve(*about, who, now)
                    return True, "off the shelf"
                case COMMAND.ACTION_SET_LIMIT:
                    return True, self._set_limit(command.limit, who, now)
                case COMMAND.ACTION_REMOVE_LIMIT:
                    return True, self._remove_limit(command.id, who, now)
        except (NoSuchAlarm, ExpressionError) as error:
            return False, str(error)
        except ValidationError as error:
            return False, "; ".join(said.fault(one) for one in error.errors()[:5])
        return False, "no such order"

    def _set_limit(self, wanted: pb.AlarmLimit, who: str, now: Now) -> str:
        limit = said.limit_of(wanted)
        if limit.name in self._fixed:
            raise NoSuchAlarm(f"{limit.name} stands in gyrofree.toml: change it there")
        if limit.name not in self._own and len(self._watch.limits) >= MOST_LIMITS:
            raise NoSuchAlarm(f"there are {MOST_LIMITS} limits already: remove one first")
        what = "limit changed" if limit.name in self._own else "limit set"
        self._watch.set_limit(limit)
        self._own[limit.name], self._users[limit.name] = limit, who
        self._note(limit.name, what, who, f"{limit.field} {said.sides(wanted)}", limit.level, now)
        return f"{limit.name}: {what}"

    def _remove_limit(self, name: str, who: str, now: Now) -> str:
        if name in self._fixed:
            raise NoSuchAlarm(f"{name} stands in gyrofree.toml: take it out there")
        if name not in self._own:
            raise NoSuchAlarm(f"there is no limit {plain(name, 40)!r}")
        level = self._own.pop(name).level
        self._users.pop(name, None)
        self._watch.remove_limit(name)
        self._note(name, "limit removed", who, "", level, now)
        return f"{name}: limit removed"

    def _note(self, name: str, what: str, who: str, text: str, level: str, now: Now) -> None:
        self._watch.book.note(Event(now.utc_ns, "", name, name, level, what, who, text))

    def _test(self, order: Order) -> None:
        """Send a notice through every way, at once and past the queue; a thread of its own."""
        who, found, ok = plain(order.command.user, 60), [], True
        for sender in self._senders:
            notice = Notice(
                "test",
                "",
                sender.way.level,
                "test of the notices",
                f"{who or 'somebody'} tries whether notices arrive; nothing is wrong",
                self._clock.now_ns(),
                site=self._site,
                test=True,
            )
            try:
                sender.way.deliver(notice)
                found.append(f"{sender.way.name}: delivered")
            except DeliveryError as error:
                ok = False
                found.append(f"{sender.way.name}: {error}")
        none = "no way out is set: [alarms.webhook] or [alarms.mail] in gyrofree.toml"
        order.answer(self._reply(ok and bool(found), "; ".join(found) or none))


def run(settings: AlarmSettings, recordings: Path, bus: BusSettings, stop: threading.Event) -> None:
    """Watch until `stop` is set; wait while another process does."""
    with sessions(bus, stop) as mine:
        if mine is not None:
            in_turn(
                mine,
                bus.prefix,
                ALARMS,
                stop,
                lambda claimed: _serve(settings, recordings, bus, mine.session, claimed, stop),
                "alarms service",
            )


def _serve(
    settings: AlarmSettings,
    recordings: Path,
    bus: BusSettings,
    session: zenoh.Session,
    claimed: Claim,
    stop: threading.Event,
) -> None:
    """Until `stop`, or until another has taken over."""
    service = Service(settings, recordings, session, bus.prefix, claimed.number, bus.tls)
    log.info("watching %s/*: %d limits", bus.prefix, len(settings.limits))
    try:
        with Loop("alarms") as loop:
            while not (claimed.lost.is_set() or stop.is_set()):
                loop.turn()
                service.step()
                service.wake.wait(TICK_S)
                service.wake.clear()
    finally:
        service.close(tidy=not claimed.lost.is_set())
