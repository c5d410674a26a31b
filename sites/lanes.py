"""Lanes: further connections from home to a place that it calls, for all that is not live.

One TCP connection over a link with losses carries a fraction of it, and what is live would wait in
it behind what is not: over 1 Mbit/s, 200 ms and 5 % loss CUBIC gets a quarter through. Several
together fill the link, and the routers' own connection is left to what is live. Home is a plain
client of the other place's router here, once for each lane; who asks takes the lane by its number.
"""

import logging
import threading
import time
from collections.abc import Callable
from pathlib import Path

import zenoh

from messages.bus import timeouts
from messages.bus.session import BusSettings, LateSession
from messages.bus.settings import FAR_LEASE_MS
from messages.bus.turning import MOST_S, Loop
from messages.previews.frames import lane_key
from sites.place import Place, SiteError, load_place

HANG_UP_S = 2.0
LOOK_S = 5.0  # between two looks at who belongs to the site

log = logging.getLogger(__name__)

Declare = Callable[[zenoh.Session, str], list[zenoh.Queryable]]  # below this key, in this session


class Lanes:
    """Connections to every place that home calls, until it is closed."""

    def __init__(self, folder: Path, bus: BusSettings, count: int, declare: Declare) -> None:
        self._folder, self._bus, self._count, self._declare = folder, bus, count, declare
        self._open: dict[str, list[LateSession]] = {}  # by address
        self._stop = threading.Event()
        timeouts.watch(self._stop)
        self._thread = threading.Thread(target=self._run, name="lanes", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Hang up."""
        self._stop.set()
        self._thread.join(LOOK_S)
        hang_up([one for sessions in self._open.values() for one in sessions])

    def _run(self) -> None:
        with Loop("lanes", LOOK_S + HANG_UP_S + MOST_S) as loop:
            while not self._stop.is_set():
                loop.turn()
                try:
                    self._look(load_place(self._folder))
                except SiteError as error:
                    log.warning("lanes stay as they are: %s", error)
                self._stop.wait(LOOK_S)

    def _look(self, place: Place) -> None:
        """Call whom home calls now, and hang up on the others."""
        wanted = {peer.address for peer in place.peers if peer.address}
        for address in wanted - self._open.keys():
            self._open[address] = [
                self._lane(address, lane_key(place.site, number)) for number in range(self._count)
            ]
        for address in self._open.keys() - wanted:
            hang_up(self._open.pop(address))

    def _lane(self, address: str, key: str) -> LateSession:
        bus = self._bus.model_copy(update={"router": address, "lease_ms": FAR_LEASE_MS}).acting_as(
            self._bus.role
        )
        return LateSession(bus, lambda session: self._declare(session, key), further=True)


def hang_up(lanes: list[LateSession]) -> None:
    """All at once, and no longer than HANG_UP_S: a word of parting may be long on a bad link."""
    closing = [threading.Thread(target=one.close, daemon=True) for one in lanes]
    for one in closing:
        one.start()
    end = time.monotonic() + HANG_UP_S
    for one in closing:
        one.join(max(0.0, end - time.monotonic()))
