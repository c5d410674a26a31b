"""Home's end of copying: what sessions there are, their segments, and the bytes of each."""

import logging
import queue
import threading
from pathlib import Path

import zenoh

from messages.bus.turning import Loop
from sites.copying.shelf import Shelf, ShelfError
from sites.roles import SEGMENTS, segment_key

WAKE_S = 1.0  # while nothing is asked, that much is said so often
ANSWER_S = 60.0  # that an answer may take
MOST_WAITING = 256  # questions; more are refused, and asked again

log = logging.getLogger(__name__)


class Serving:
    """Answers in a thread of its own: the hash of a long recording takes seconds."""

    def __init__(self, session: zenoh.Session, site: str, root: Path) -> None:
        self._key, self._shelf = segment_key(site), Shelf(root)
        self._asked: queue.Queue[zenoh.Query | None] = queue.Queue(MOST_WAITING)
        self._thread = threading.Thread(target=self._serve, name="copies", daemon=True)
        self._thread.start()
        self._queryable = self.at(session, self._key)

    def at(self, session: zenoh.Session, key: str) -> zenoh.Queryable:
        """Answer the same questions below another key, which ends as segment_key does."""
        return session.declare_queryable(f"{key}/**", self._on_query)

    def close(self) -> None:
        """Answer nothing any more."""
        self._queryable.undeclare()
        self._asked.put(None)
        self._thread.join(5.0)

    def _on_query(self, query: zenoh.Query) -> None:
        try:
            self._asked.put_nowait(query)
        except queue.Full:
            query.reply_err(b"too many questions wait: ask again")

    def _serve(self) -> None:
        with Loop("serving copies") as loop:
            while True:
                loop.turn()
                try:
                    query = self._asked.get(timeout=WAKE_S)
                except queue.Empty:
                    continue
                if query is None:
                    return
                with loop.during("an answer", ANSWER_S):
                    self._reply(query)

    def _reply(self, query: zenoh.Query) -> None:
        key = str(query.key_expr)
        try:
            query.reply(key, self._answer(key.partition(SEGMENTS)[2].split("/")))
        except (ShelfError, OSError) as error:
            query.reply_err(str(error).encode())
        except Exception:  # whatever a stranger asks, the service goes on
            log.exception("a question about copies is refused: %s", key[:200])
            query.reply_err(b"the question cannot be answered; home's log says why")
        query.drop()

    def _answer(self, parts: list[str]) -> bytes:
        """`index`; `<session>`; or `<session>/<file>/<first>-<sha256>`."""
        match parts:
            case ["index"]:
                lines = [f"{name} {stamp}" for name, stamp in self._shelf.stamps().items()]
                return "\n".join(lines).encode()
            case [session]:
                return self._shelf.listing(session).model_dump_json().encode()
            case [session, name, segment]:
                first = segment.partition("-")[0]
                if not first.isdigit() or len(first) > 15:
                    raise ShelfError(f"no segment {segment[:80]!r}")
                return self._shelf.segment(session, name, int(first))
        raise ShelfError("want index, SESSION or SESSION/FILE/FIRST-SHA256")
