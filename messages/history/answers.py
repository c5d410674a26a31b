"""Asking for published messages, and answering: HistoryQuery and HistoryReply over the bus.

The one that published them answers from its spool (spool.py), on
<prefix>/<device>/published/<source>.
"""

import logging
import queue
import threading
import time
from collections.abc import Callable
from operator import itemgetter

import zenoh
from google.protobuf.message import DecodeError

from messages.bus.claiming import OVERDUE, id_of
from messages.bus.fencing import Fence
from messages.contract import gyrofree_pb2 as pb
from messages.contract.checks import Refusal, check
from messages.contract.topics import TopicError, published_key
from messages.history.spool import REPLY_BYTES, Spool

log = logging.getLogger(__name__)

ANSWER_S = 10.0  # an answer is a MB from the disk; a busy machine takes its time
MOST_BYTES = 8 << 20  # of messages in one reply that we give, however much is asked for
MOST_REPLY_BYTES = 32 << 20  # of all replies to a question that we read
MOST_REPLIES = 16  # to one question; a device has one publisher, or two that take turns
PATIENCE_S = 1800.0  # with one that is there, but does not answer in time
LEAST_BYTES = 1 << 15  # of an answer that a busier machine is asked for
MOST_UNANSWERED = 4096  # publishers that are remembered for not answering


def declare(
    session: zenoh.Session, prefix: str, device: str, source: str, spool: Spool
) -> zenoh.Queryable:
    """Answer from `spool` what is asked of `device` (`*`: of any); undeclare the result at the
    end.
    """
    mine = published_key(prefix, device, source)

    def on_query(query: zenoh.Query) -> None:
        asked = str(query.key_expr).split("/")
        about = device if device != "*" or len(asked) != 4 else asked[1]
        try:
            key = mine
            if device == "*":
                key = published_key(prefix, about if about != "*" else source, source)
            question = pb.HistoryQuery.FromString(
                query.payload.to_bytes() if query.payload is not None else b""
            )
        except (DecodeError, TopicError):
            query.reply_err(b"want a HistoryQuery about a device")
            return
        wrong = check(question)
        if wrong:
            query.reply_err(f"history: {wrong[0]}".encode())
            return
        question.max_bytes = min(question.max_bytes, MOST_BYTES)
        try:
            reply = spool.answer(question, about)
        except OSError as error:
            query.reply_err(f"history: {error}".encode())
            return
        query.reply(key, reply.SerializeToString())

    return session.declare_queryable(mine, on_query)


def ask(
    session: zenoh.Session,
    prefix: str,
    device: str,
    source: str,
    query: pb.HistoryQuery,
    timeout_s: float | None = None,
    fence: Fence | None = None,
) -> pb.HistoryReply | None:
    """The answer about one source; None when nobody answered.

    Where somebody has claimed to be its publisher (`fence` knows) his answer is the one that
    counts, and nobody else is waited for; answers of others are refused. Where nobody has, all that
    come are put together. Whoever answers is believed no further than `together` says; what is
    beyond the limits is said.
    """
    claimed = fence.claims.publisher(device, source) if fence is not None else ""
    found: list[pb.HistoryReply] = []
    size = 0
    replies = session.get(
        published_key(prefix, device, source),
        payload=query.SerializeToString(),
        timeout=ANSWER_S if timeout_s is None else timeout_s,
        target=zenoh.QueryTarget.ALL,
        consolidation=zenoh.ConsolidationMode.NONE,
    )
    for reply in replies:
        who = id_of(reply)
        overdue = reply.ok is None and reply.err.payload.to_bytes() == OVERDUE
        if claimed and who not in (claimed, "") and not overdue:
            refusal = Refusal("claim", "publisher", who, f"{claimed}, who has claimed it")
            fence.refuse(f"answer about {device}/{source}", refusal, device)
            continue
        if reply.ok is None:
            log.warning(
                "history of %s: %s",
                device,
                reply.err.payload.to_bytes().decode(errors="replace")[:200],
            )
            continue
        size += len(reply.ok.payload)
        if size > MOST_REPLY_BYTES or len(found) >= MOST_REPLIES:
            log.warning(
                "history of %s: %d answers, %d bytes, want at most %d and %d: the rest is left out",
                device,
                len(found) + 1,
                size,
                MOST_REPLIES,
                MOST_REPLY_BYTES,
            )
            break
        try:
            found.append(pb.HistoryReply.FromString(reply.ok.payload.to_bytes()))
        except DecodeError as error:
            log.warning("history of %s: %s", device, error)
        if claimed:
            break
    return together(found)


def together(answers: list[pb.HistoryReply]) -> pb.HistoryReply | None:
    """Answers of several publishers as one; None without any.

    Of two processes that took turns the older one's messages come first, whoever answered first: a
    run is greater than all that were before it.
    """
    if len(answers) < 2:
        return answers[0] if answers else None
    whole = pb.HistoryReply()
    ordered: list[tuple[int, pb.HistoryItem]] = []
    for answer in answers:
        whole.next = max(whole.next, answer.next)
        whole.durable = max(whole.durable, answer.durable)
        whole.first_kept = max(whole.first_kept, answer.first_kept)
        run = 0  # messages without one stay behind those they came with
        for item in answer.items:
            run = max(run, item.run)
            ordered.append((run, item))
    whole.items.extend(item for _, item in sorted(ordered, key=itemgetter(0)))
    return whole


class Asker:
    """Asks on a thread of its own, one question after the other; `done(token, reply)` is called
    there.
    """

    RETRIES = 4  # a link that is just back may carry samples before it carries questions
    RETRY_S = 0.5
    ALONE_S = 60.0  # after nobody answered about a publisher that nobody claims to be: one try

    def __init__(
        self,
        session: zenoh.Session,
        prefix: str,
        done: Callable[[object, pb.HistoryReply | None], None],
        fence: Fence | None = None,
        patience_s: float = PATIENCE_S,
    ):
        """`fence` knows who publishes what."""
        self._session, self._prefix, self._done = session, prefix, done
        self._fence, self._patience_s = fence, patience_s
        self._questions: queue.SimpleQueue[tuple | None] = queue.SimpleQueue()
        self._unanswered: dict[tuple[str, str], float] = {}  # and when, s, monotonic
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="history", daemon=True)
        self._thread.start()

    def ask(self, token: object, device: str, source: str, query: pb.HistoryQuery) -> None:
        """Put a question; returns at once."""
        self._questions.put((token, device, source, query))

    def close(self) -> None:
        """Ask no more; what is under way is given up."""
        self._stop.set()
        self._questions.put(None)
        self._thread.join(timeout=ANSWER_S + 1.0)

    def _run(self) -> None:
        while (question := self._questions.get()) is not None and not self._stop.is_set():
            token, device, source, asked = question
            reply = self._insist(device, source, asked)
            if self._stop.is_set():
                return
            self._done(token, reply)

    def _insist(self, device: str, source: str, asked: pb.HistoryQuery) -> pb.HistoryReply | None:
        """Ask until there is an answer, or nobody to be waited for."""
        query, began, nobody, said = pb.HistoryQuery(), time.monotonic(), 0, False
        query.CopyFrom(asked)
        tries = self.RETRIES if self._may_be_there(device, source) else 1
        while time.monotonic() - began < self._patience_s:
            asked_at = time.monotonic()
            try:
                reply = ask(self._session, self._prefix, device, source, query, fence=self._fence)
            except zenoh.ZError as error:
                log.warning("history of %s: %s", device, error)
                reply = None
            if reply is not None:
                return reply
            # it is there, but late; whoever else does not answer is not waited for again and again
            slow = time.monotonic() - asked_at >= ANSWER_S / 2 and self._serves(device, source)
            nobody += not slow
            if slow and not said:
                said = True
                log.warning(
                    "%s: its %s does not answer what is missing; what comes meanwhile waits, for"
                    " %.0f s at most",
                    device,
                    source,
                    self._patience_s,
                )
            if slow and query.every_s <= 0.0:  # whoever was slow is asked for less at a time
                query.max_bytes = max(LEAST_BYTES, (query.max_bytes or REPLY_BYTES) // 2)
            if nobody >= tries:
                self._unanswered[device, source] = time.monotonic()
                break
            if self._stop.wait(self.RETRY_S):
                break
        return None

    def _may_be_there(self, device: str, source: str) -> bool:
        """Is it worth waiting for? A name that somebody made up has many gaps and no publisher:
        the questions about it must not hold up those about others.
        """
        if self._serves(device, source):
            return True
        if len(self._unanswered) > MOST_UNANSWERED:
            self._unanswered.clear()
        since = self._unanswered.get((device, source))
        return since is None or time.monotonic() - since > self.ALONE_S

    def _serves(self, device: str, source: str) -> bool:
        """Is there a publisher, as far as can be known?"""
        return self._fence is None or bool(self._fence.claims.publisher(device, source))
