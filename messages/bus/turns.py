"""A service that there is one of: it serves while nobody else does, and waits while one does."""

import contextlib
import logging
import threading
import time
from collections.abc import Callable, Iterable, Iterator

from messages.bus.beating import Beating
from messages.bus.claiming import Claim, Claimant, claim
from messages.bus.faults import BusUnavailable
from messages.bus.fencing import heard_of
from messages.bus.session import BusSettings, open_client
from messages.contract.topics import claim_key

log = logging.getLogger(__name__)


@contextlib.contextmanager
def sessions(
    bus: BusSettings, stop: threading.Event, devices: Iterable[str] = ()
) -> Iterator[Claimant | None]:
    """Sessions to publish and to ask with, and the first of them beats; None when `stop` came
    before a router. devices: boards that this process has.
    """
    with contextlib.ExitStack() as open_ones:
        try:
            both = [open_ones.enter_context(open_client(bus, stop)) for _ in range(2)]
        except BusUnavailable:
            both = []
            if not stop.is_set():
                raise
        if both:
            open_ones.enter_context(Beating(both[0], bus, devices))
        yield Claimant(*both) if both else None


def in_turn(
    mine: Claimant,
    prefix: str,
    source: str,
    stop: threading.Event,
    serve: Callable[[Claim], None],
    who: str = "",
) -> None:
    """Call serve(claim) whenever nobody else publishes as `source`, until `stop`; it is to return
    when `claim.lost` is set. `who`: for people.
    """
    who = who or source

    def refused(other: str) -> None:
        log.error(
            "another %s runs here (%s): refused; this one waits until it has ended", who, other
        )

    while not stop.is_set():
        claimed = claim(
            mine,
            [claim_key(prefix, source)],
            time.time_ns(),
            stop,
            refused,
            lambda: heard_of(mine.session, prefix, "*", source),
        )
        if claimed is None:
            return
        try:
            serve(claimed)
            if claimed.lost.is_set():
                log.error(
                    "another %s took over while this process was stopped or cut off: stepping back",
                    who,
                )
        finally:
            claimed.release()
