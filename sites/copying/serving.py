"""Home's end of copying: what sessions there are, their segments, and the bytes of each."""

import contextlib
import logging
import queue
import threading
import time
from pathlib import Path

import zenoh

from messages.bus.turning import Loop
from sites.copying.shelf import Shelf, ShelfError
from sites.copying.since import SINCE, Told
from sites.roles import SEGMENTS, segment_key

MOST_WAITING = 256  # questions on one way; more are refused, and asked again
CLOSE_S = 1.0
WAKE_S = 1.0  # while nothing is asked, that much is said so often
ANSWER_S = 60.0  # that an answer may take

log = logging.getLogger(__name__)


class Answers:
    """What home says to a question, its key cut into chunks. From any thread."""

    def __init__(self, root: Path) -> None:
        """root: of the recorded sessions."""
        self._shelf, self._told, self._telling = Shelf(root), Told(), threading.Lock()

    def __call__(self, parts: list[str]) -> bytes:
        """`index`; `<session>`; either with `/since/<sha256>`, for what has changed;
        `<session>/<file>/<first>-<sha256>`, and `/<offset>` for a part of it. Raises ShelfError,
        OSError.
        """
        match parts:
            case [what, since, sha256] if since == SINCE:
                answer = self([what])
                with self._telling:
                    return self._told.since(sha256, answer)
            case ["index"]:
                lines = [f"{name} {stamp}" for name, stamp in self._shelf.stamps().items()]
                return "\n".join(lines).encode()
            case [session]:
                return self._shelf.listing(session).model_dump_json().encode()
            case [session, name, segment]:
                return self._shelf.segment(session, name, _number(segment.partition("-")[0]))
            case [session, name, segment, offset]:
                first = _number(segment.partition("-")[0])
                return self._shelf.part(session, name, first, _number(offset))
        raise ShelfError("want index, SESSION or SESSION/FILE/FIRST-SHA256")


class Serving:
    """Answers on threads of its own, one for each way on which it is asked: the hash of a long
    recording takes seconds, and an answer waits while its lane is full.
    """

    def __init__(self, session: zenoh.Session, site: str, root: Path) -> None:
        self._key, self._answers = segment_key(site), Answers(root)
        self._threads: list[threading.Thread] = []
        self._ways: list[queue.Queue[zenoh.Query | None]] = []
        self._queryable = self.at(session, self._key)

    def at(self, session: zenoh.Session, key: str) -> zenoh.Queryable:
        """Answer the same questions below another key, which ends as segment_key does."""
        asked: queue.Queue[zenoh.Query | None] = queue.Queue(MOST_WAITING)

        def on_query(query: zenoh.Query) -> None:
            try:
                asked.put_nowait(query)
            except queue.Full:
                query.reply_err(b"too many questions wait: ask again")

        queryable = session.declare_queryable(f"{key}/**", on_query)
        self._ways.append(asked)
        given = asked, f"copies {len(self._ways)}"
        thread = threading.Thread(target=self._serve, args=given, name="copies", daemon=True)
        self._threads.append(thread)
        thread.start()
        return queryable

    def close(self) -> None:
        """Answer nothing any more; an answer that waits for a full lane is left."""
        self._queryable.undeclare()
        for asked in self._ways:
            with contextlib.suppress(queue.Full):
                asked.put_nowait(None)
        end = time.monotonic() + CLOSE_S
        for thread in self._threads:
            thread.join(max(0.0, end - time.monotonic()))

    def _serve(self, asked: "queue.Queue[zenoh.Query | None]", name: str) -> None:
        with Loop(name) as loop:
            while True:
                loop.turn()
                try:
                    query = asked.get(timeout=WAKE_S)
                except queue.Empty:
                    continue
                if query is None:
                    return
                with loop.during("an answer", ANSWER_S):
                    self._reply(query)

    def _reply(self, query: zenoh.Query) -> None:
        key = str(query.key_expr)
        try:
            query.reply(key, self._answers(key.partition(SEGMENTS)[2].split("/")))
        except (ShelfError, OSError) as error:
            query.reply_err(str(error).encode())
        except Exception:  # whatever a stranger asks, the service goes on
            log.exception("a question about copies is refused: %s", key[:200])
            query.reply_err(b"the question cannot be answered; home's log says why")
        query.drop()


def _number(text: str) -> int:
    if not text.isdigit() or len(text) > 15:
        raise ShelfError(f"no segment {text[:80]!r}")
    return int(text)
