"""Orders over the bus, each with its answer or the reason of its refusal: both ends of it.

An order is a query on a key of messages.contract.topics: a command as payload, one answer back. A
service that takes no order (it is stopping, the bytes are no command) says why in an error reply;
the one who asked gets that reason as it was said, and never "does not answer" for it.
"""

import logging
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

import zenoh
from google.protobuf.message import DecodeError, Message

from messages.bus import deadline
from messages.bus.claiming import OVERDUE, id_of, newest
from messages.bus.command.watch import Watch, given_by
from messages.contract import gyrofree_pb2 as pb
from messages.contract import topics as tp
from messages.contract.checks import MESSAGE_BYTES, check
from messages.contract.topics import (
    TopicError,
    alarms_control_key,
    check_name,
    command_control_key,
    control_key,
    recorder_control_key,
    replay_control_key,
)

log = logging.getLogger(__name__)

REASON_LENGTH = 500  # characters of a refusal that are passed on

C = TypeVar("C", bound=Message)
A = TypeVar("A", bound=Message)


class OrderError(RuntimeError):
    """An order that was not carried out; the text says why, fit for a person to read."""


class Refused(OrderError):
    """The service was asked and says why it does not take the order."""


class NoAnswer(OrderError):
    """Nobody answered in time, or not in a way that can be read; the text says what to look at."""


@dataclass(frozen=True)
class Kind(Generic[C, A]):
    """One kind of orders: who takes them, where, and what goes there and back."""

    who: str
    command: type[C]
    answer: type[A]
    look: str  # what to look at when nobody answers
    patience_s: float
    key: Callable[[str, str], str]  # of (prefix, device)
    source: str  # of the topics on which it publishes: who has claimed them is who answers
    # of a command: does it take the site's command, which one operator has at a time?
    commanded: Callable[[C], bool] = lambda command: True  # noqa: ARG005


RECORDER = Kind(
    "the recorder",
    pb.RecorderCommand,
    pb.RecorderStatus,
    "see that `gyrofree record` runs and reaches the router",
    10.0,  # it may have to close a file
    lambda prefix, device: recorder_control_key(prefix),
    tp.RECORDER,
    lambda command: command.action != pb.RecorderCommand.ACTION_STATUS,
)
ESTIMATOR = Kind(
    "the estimator",
    pb.EstimatorCommand,
    pb.Reply,
    "see that `gyrofree estimator` runs and reaches the router",
    20.0,  # a fit takes seconds, and the order waits for the samples before it
    lambda prefix, device: control_key(prefix, device, "estimator-control"),
    tp.ESTIMATES,
)
BOARD = Kind(
    "the gateway",
    pb.BoardCommand,
    pb.Reply,
    "see that `gyrofree gateway` runs and reaches the router",
    8.0,  # a self-test of the sensors takes up to 4 s
    lambda prefix, device: control_key(prefix, device, "board-control"),
    tp.GATEWAY,
    lambda command: not command.ask,
)
PROCEDURES = Kind(
    "the procedures",
    pb.ProcedureCommand,
    pb.Reply,
    "see that `gyrofree procedures` runs and reaches the router",
    25.0,  # a recording is closed and another begun
    lambda prefix, device: control_key(prefix, device, "procedure-control"),
    tp.PROCEDURES,
    lambda command: command.action != pb.ProcedureCommand.ACTION_STOP,  # anybody may stop a table
)
REPLAY = Kind(
    "the replay",
    pb.ReplayCommand,
    pb.ReplayStatus,
    "it has ended",
    5.0,
    lambda prefix, device: replay_control_key(prefix),
    tp.REPLAY.source,
    lambda command: False,  # noqa: ARG005 it speaks under names of its own
)
ALARMS = Kind(
    "the alarms",
    pb.AlarmCommand,
    pb.AlarmReply,
    "see that `gyrofree alarms` runs and reaches the router",
    15.0,  # a notice that is tried out waits for somebody else's server
    lambda prefix, device: alarms_control_key(prefix),
    tp.ALARMS,
    lambda command: False,  # noqa: ARG005 whoever sees an alarm may take note of it
)
SEAT = Kind(
    "who keeps the command",
    pb.SeatCommand,
    pb.SeatReply,
    "see that `gyrofree procedures` runs and reaches the router",
    5.0,
    lambda prefix, device: command_control_key(prefix),
    tp.PROCEDURES,
    lambda command: False,  # noqa: ARG005 it is about the command itself
)
LOG_LEVEL = Kind(
    "the service",
    pb.LogLevelCommand,
    pb.Reply,
    "see that it runs and reaches the router",
    3.0,
    lambda prefix, device: control_key(prefix, device, "log-level"),
    "process",  # nobody claims to be the only one
)


def give(
    session: zenoh.Session | None,
    prefix: str,
    kind: Kind[C, A],
    command: C,
    device: str = "",
    timeout_s: float | None = None,
    by: pb.OrderBy | None = None,
) -> A:
    """Give an order and wait for its answer, by default as long as this kind of orders may take.

    `device` for the kinds that are for one board or its estimators; `by`: who gives it. Raises
    Refused with the service's own reason, NoAnswer without an answer, TopicError for a name that
    cannot be a device's.
    """
    if session is None:
        raise NoAnswer(f"{kind.who}: no connection to the router yet")
    key = kind.key(prefix, device)
    patience_s = kind.patience_s if timeout_s is None else timeout_s
    who = {"device": device} if kind.source == tp.GATEWAY else {}
    try:
        base = tp.claim_key(prefix, kind.source, **who)
        # twice: a session that watches claims may know of a new one and not yet say so
        serves = newest(session, base) or newest(session, base)
        replies = session.get(
            key + deadline.until(patience_s),
            payload=command.SerializeToString(),
            attachment=None if by is None else by.SerializeToString(),
            timeout=patience_s,
            consolidation=zenoh.ConsolidationMode.NONE,  # the first answer, at once
        )
        for reply in replies:
            overdue = reply.ok is None and reply.err.payload.to_bytes() == OVERDUE
            if serves and id_of(reply) not in (serves, "") and not overdue:
                log.warning(
                    "%s: an answer of %s is refused: %s has claimed to be the one who serves",
                    kind.who,
                    id_of(reply),
                    serves,
                )
                continue
            return _read(reply, kind, patience_s)
    except zenoh.ZError as error:
        raise NoAnswer(f"{kind.who}: the order cannot be sent: {error}") from None
    raise NoAnswer(f"{kind.who} does not answer: {kind.look}")


def _read(reply: zenoh.Reply, kind: Kind[C, A], patience_s: float) -> A:
    """The answer in a reply; raises Refused or NoAnswer."""
    if reply.ok is None:
        said = reply.err.payload.to_bytes()
        if reply.replier_id is None or said == OVERDUE:
            raise NoAnswer(f"{kind.who} did not answer within {patience_s:g} s: {kind.look}")
        reason = said.decode(errors="replace")[:REASON_LENGTH]
        raise Refused(f"{kind.who}: {reason}")
    size, answer = len(reply.ok.payload), kind.answer()
    try:
        if size > MESSAGE_BYTES:
            raise DecodeError
        answer.ParseFromString(reply.ok.payload.to_bytes())
    except DecodeError:
        raise NoAnswer(
            f"{kind.who} answered with {size} bytes that are no {kind.answer.__name__}: is it of"
            " another version?"
        ) from None
    wrong = check(answer)
    if wrong:
        raise NoAnswer(f"{kind.who} answered with what cannot be: {wrong[0]}")
    return answer


class Order(Generic[C, A]):
    """An order that came: `answer` or `refuse` it, once, from any thread, at once or later."""

    def __init__(self, query: zenoh.Query, device: str, command: C) -> None:
        """`device`: the second name of the key that was asked."""
        self._query = query
        self.device = device
        self.command = command

    def answer(self, message: A) -> None:
        """It has been carried out, or the message says why not."""
        self._query.reply(str(self._query.key_expr), message.SerializeToString())
        self._query.drop()  # the asker waits until nobody holds it

    def refuse(self, reason: str) -> None:
        """It is not looked at, for this reason."""
        self._query.reply_err(reason.encode())
        self._query.drop()


class Taking:
    """Orders are taken until undeclare()."""

    def __init__(self, queryable: zenoh.Queryable, watch: Watch) -> None:
        self._queryable, self._watch = queryable, watch

    def undeclare(self) -> None:
        """Take no more."""
        self._queryable.undeclare()
        self._watch.close()


def take(
    session: zenoh.Session,
    prefix: str,
    kind: Kind[C, A],
    handler: Callable[[Order[C, A]], None],
    device: str = "",
) -> Taking:
    """Call handler(order) on Zenoh's thread for each order; undeclare the result at the end.

    `device` "*" takes the orders for any device. Bytes that are no command, values that the
    contract does not allow, orders for several devices at once, and those of whom does not have
    the command where they take it, are refused here.
    """
    watch = Watch(session, prefix)

    def on_query(query: zenoh.Query) -> None:
        asked = str(query.key_expr)
        payload = query.payload.to_bytes() if query.payload is not None else b""
        try:
            command = kind.command.FromString(payload)
        except DecodeError:
            reason = f"{len(payload)} bytes are no {kind.command.__name__}"
            query.reply_err(reason.encode())
            return
        wrong = check(command)
        if wrong:
            query.reply_err(f"not taken: {wrong[0]}".encode())
            return
        if "*" in asked:
            query.reply_err(f"an order is for one device, not for {asked}".encode())
            return
        by = given_by(query.attachment)
        late_s = deadline.late_s(query.parameters.get(deadline.UNTIL))
        if late_s and kind.commanded(command):
            log.warning("%s: an order comes %.1f s too late: not carried out", kind.who, late_s)
            query.reply_err(f"not carried out: it came {late_s:.1f} s too late".encode())
            return
        if kind.commanded(command) and (reason := watch.refusal(by)):
            log.warning("%s: an order of %s is refused: %s", kind.who, by.seat.user, reason)
            query.reply_err(reason.encode())
            return
        try:
            handler(Order(query, check_name(asked.split("/")[1]), command))
        except TopicError as error:
            query.reply_err(str(error).encode())

    return Taking(session.declare_queryable(kind.key(prefix, device), on_query), watch)
