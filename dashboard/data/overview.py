"""What was while nobody listened, over a slow link: coarse over all of it first, then finer.

Asked on a lane of home's where there is one (sites/lanes.py), so that what is live does not wait.
"""

import logging
import queue
import threading
from collections.abc import Callable

import zenoh

from messages.contract import gyrofree_pb2 as pb
from messages.contract.checks import Refusal
from messages.contract.topics import MOST_LANES
from messages.previews.frames import MOST_BYTES, lane_overview_key, overview_key, unpacked

ASK_S = 4.0  # for one answer
AGAIN = 12  # times; after a cut lanes may be slower to come back than the routers' own link
PAUSE_S = 0.5
CLOSE_S = 2.0
COARSE = 60  # moments of the first answer
FINE_S = 60.0  # of the past in each of those that follow, the newest first
FINE_EVERY_S = 1.0

log = logging.getLogger(__name__)


class Overviews:
    """Asks on a thread of its own; `done(device, every_s, items, refusal)` is called there."""

    def __init__(
        self,
        session: zenoh.Session,
        prefix: str,
        done: Callable[[str, float, list[pb.HistoryItem], Refusal | None], None],
    ) -> None:
        self._session, self._prefix, self._done = session, prefix, done
        self._wanted: queue.PriorityQueue = queue.PriorityQueue()
        self._count, self._stop = 0, threading.Event()
        self._until = zenoh.CancellationToken()  # ends the waiting for an answer
        self._queriers: dict[str, list[zenoh.Querier]] = {}
        self._thread = threading.Thread(target=self._run, name="overviews", daemon=True)
        self._thread.start()

    def ask(self, device: str, from_ns: int, until_ns: int) -> None:
        """Ask for what was between two times by home's clock."""
        span_s = (until_ns - from_ns) * 1e-9
        every_s = max(FINE_EVERY_S, span_s / COARSE)
        self._put(0, device, from_ns, until_ns, every_s)
        end, begin = until_ns, until_ns
        while every_s > FINE_EVERY_S and begin > from_ns:
            begin = max(from_ns, end - int(FINE_S * 1e9))
            self._put(1, device, begin, end, FINE_EVERY_S)
            end = begin

    def close(self) -> None:
        """Ask no more."""
        self._stop.set()
        self._until.cancel()
        self._put(-1, "", 0, 0, 0.0)
        self._thread.join(CLOSE_S)

    def _put(self, rank: int, device: str, begin: int, end: int, every_s: float) -> None:
        self._count += 1  # of one rank the first asked for
        self._wanted.put((rank, self._count, device, begin, end, every_s))

    def _run(self) -> None:
        while not self._stop.is_set():
            _, _, device, begin, end, every_s = self._wanted.get()
            query = pb.HistoryQuery(from_utc_ns=begin, until_utc_ns=end, every_s=every_s)
            for attempt in range(AGAIN):
                if self._stop.is_set() or self._asked(device, query, attempt % 2 == 1):
                    break
                self._stop.wait(PAUSE_S)
            else:
                log.warning("%s: home does not answer what was missed", device)

    def _asked(self, device: str, query: pb.HistoryQuery, main: bool) -> bool:
        for reply in self._querier(device, main).get(
            payload=query.SerializeToString(), cancellation_token=self._until
        ):
            if self._stop.is_set():
                return True
            if reply.ok is None:
                continue
            data = reply.ok.payload
            if len(data) > MOST_BYTES:
                refusal = Refusal("size", "overview", f"{len(data)} bytes", f"at most {MOST_BYTES}")
                self._done(device, query.every_s, [], refusal)
            else:
                self._done(device, query.every_s, *unpacked(data.to_bytes(), device))
            return True
        return False

    def _querier(self, device: str, only_main: bool) -> zenoh.Querier:
        """On a lane that is there, else on the routers' own link."""
        if device not in self._queriers:
            keys = [lane_overview_key(self._prefix, number, device) for number in range(MOST_LANES)]
            self._queriers[device] = [
                self._session.declare_querier(key, timeout=ASK_S)
                for key in (*keys, overview_key(self._prefix, device))
            ]
        *lanes, main = self._queriers[device]
        there = [one for one in lanes if one.matching_status.matching]
        self._count += 1
        return there[self._count % len(there)] if there and not only_main else main
