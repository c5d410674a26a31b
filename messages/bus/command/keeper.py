"""Who keeps the command: one of a site, beside the procedures, which move what can be moved.

It says on the bus who has the command, answers who asks, and keeps the history of all orders, which
those who give them publish. What it knows survives it in a file.
"""

import json
import logging
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path

import zenoh

from messages.bus import orders
from messages.bus.beating import HERE
from messages.bus.command import state
from messages.bus.command.history import History
from messages.bus.command.state import Held, Refusal, Seat
from messages.bus.session import Publishers, subscribe
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import COMMAND, HOLDER, ORDER
from messages.text import plain

log = logging.getLogger(__name__)

STATUS_S = 1.0
WAITING = 1000  # orders that were given and wait to be kept; more are dropped, and counted
ACTION = pb.SeatCommand
Asked = orders.Order[pb.SeatCommand, pb.SeatReply]


class Keeper:
    """One life; step() is called a few times a second, by one thread."""

    def __init__(self, session: zenoh.Session, prefix: str, folder: Path, number: int = 0) -> None:
        """number: of the claim of who serves, so that what is said here is believed as his."""
        self._publishers, self._file = Publishers(session, prefix), folder / "command.json"
        self._publishers.number = number
        self._lock = threading.Lock()
        self._history = History(folder / "orders.jsonl")
        self._held = _load(self._file)
        self._since, self._due = time.time_ns(), 0.0
        self._given: deque[pb.OrderGiven] = deque(maxlen=WAITING)
        self._hearing = subscribe(session, ORDER, prefix, self._on_given)
        self._taking = orders.take(session, prefix, orders.SEAT, self._on_asked)

    def close(self) -> None:
        """End."""
        self._taking.undeclare()
        self._hearing.undeclare()

    def step(self) -> None:
        """What time brings, and what was ordered."""
        while self._given:
            self._history.add(self._given.popleft())
        with self._lock:
            self._become(lambda held, now_s, utc_ns: state.ticked(held, now_s, utc_ns))
            if time.monotonic() >= self._due:
                self._publish()

    def _on_given(self, key: str, one: pb.OrderGiven) -> None:
        """Zenoh's thread. Of which place an order is says its key: the rules of a site hold that,
        whatever stands in the message.
        """
        place = key.split("/")[1]
        one.place = "" if place == HERE else place
        self._given.append(one)

    def _on_asked(self, asked: Asked) -> None:
        """Zenoh's thread: the answer is at once, so that who orders first waits for nothing."""
        command, message, ok = asked.command, "", True
        with self._lock:
            try:
                self._become(lambda *now: _done(command, *now))
                message = self._held.last
            except Refusal as refusal:
                ok, message = False, str(refusal)
            reply = pb.SeatReply(ok=ok, message=plain(message, 300), status=self._status())
        if command.most:
            reply.history.extend(self._history.find(command.text, command.most))
            reply.lost = self._history.lost
        asked.answer(reply)

    def _become(self, change: Callable[[Held, float, int], Held]) -> None:
        """Under the lock; raises Refusal. A change is kept before it is said."""
        before = self._held
        after = change(before, time.monotonic(), time.time_ns())
        self._held = after
        if after.epoch != before.epoch or after.asks != before.asks:
            if after.epoch != before.epoch:
                log.info("command: %s", plain(after.last))
                self._given.append(_passed(after))
            self._save()
            self._publish()

    def _status(self) -> pb.CommandStatus:
        held = self._held
        status = pb.CommandStatus(
            epoch=held.epoch,
            since_utc_ns=held.since_utc_ns,
            left_s=state.left_s(held, time.monotonic()),
            answer_s=state.ANSWER_S,
            away_s=state.AWAY_S,
            last=plain(held.last, 300),
        )
        if held.holder is not None:
            status.holder.CopyFrom(_said(held.holder))
        if held.asks is not None:
            status.asks.CopyFrom(_said(held.asks))
        status.header.device, status.header.run = COMMAND, self._since
        status.header.utc_ns = time.time_ns()
        return status

    def _publish(self) -> None:
        self._due = time.monotonic() + STATUS_S
        self._publishers.put(HOLDER, COMMAND, self._status())

    def _save(self) -> None:
        held = self._held
        kept = {
            "epoch": held.epoch,
            "holder": None if held.holder is None else asdict(held.holder),
            "since_utc_ns": held.since_utc_ns,
            "last": held.last,
        }
        fresh = self._file.with_name(self._file.name + ".new")
        try:
            self._file.parent.mkdir(parents=True, exist_ok=True)
            fresh.write_text(json.dumps(kept))
            fresh.replace(self._file)
        except OSError as error:
            log.error(
                "%s: %s: who has the command is forgotten with this process",
                self._file,
                error.strerror,
            )


def _done(command: pb.SeatCommand, held: Held, now_s: float, utc_ns: int) -> Held:
    """What was asked; raises Refusal."""
    seat, now = _seat(command.seat), (now_s, utc_ns)
    if command.action == ACTION.ACTION_LOOK:
        return held
    if not seat.id:
        raise Refusal("it is not said who asks")
    match command.action:
        case ACTION.ACTION_TAKE:
            return state.taken(held, seat, *now)
        case ACTION.ACTION_ASK:
            return state.asked(held, seat, *now)
        case ACTION.ACTION_GRANT:
            return state.granted(held, seat, command.to.id, *now)
        case ACTION.ACTION_DENY:
            return state.denied(held, seat)
        case ACTION.ACTION_RELEASE:
            return state.released(held, seat, *now, plain(command.text, 100))
        case ACTION.ACTION_KEEP:
            return state.kept(held, seat, now_s)
        case ACTION.ACTION_FORCE:
            return state.forced(held, seat, *now)
    raise Refusal("no such order")


def _passed(held: Held) -> pb.OrderGiven:
    """That the command has passed on, for the history."""
    holder = held.holder or Seat("")
    return pb.OrderGiven(
        at_utc_ns=time.time_ns(),
        user=holder.user,
        place=holder.place,
        whom="who keeps the command",
        what=plain(held.last, 200),
        outcome=pb.OrderGiven.OUTCOME_DONE,
    )


def _seat(said: pb.Seat) -> Seat:
    return Seat(said.id, plain(said.user, 64), plain(said.place, 64), said.admin)


def _said(seat: Seat) -> pb.Seat:
    return pb.Seat(id=seat.id, user=seat.user, place=seat.place, admin=seat.admin)


def _load(path: Path) -> Held:
    """As it was; a holder of an earlier life is given the usual time to be heard of. A file that
    cannot be read is no command that anybody has, under a number that is new all the same.
    """
    now = time.monotonic()
    try:
        kept = json.loads(path.read_text())
        holder = None if kept["holder"] is None else Seat(**kept["holder"])
        return Held(int(kept["epoch"]), holder, int(kept["since_utc_ns"]), now, last=kept["last"])
    except FileNotFoundError:
        return Held(epoch=int(time.time()), seen_s=now)
    except (OSError, ValueError, TypeError, KeyError, RecursionError) as error:
        log.error("%s: %s: nobody has the command", path, plain(error))
        return Held(epoch=int(time.time()), seen_s=now)
