"""What the page listens to: everything, or frames of a preview at the rate that the link carries.

At home it is everything, `<site>/**`. Another place begins with a preview (messages/previews), goes
up and down with what the link carries (pace.py), and takes everything where that fits. What is rare
comes as it is published, either way.
"""

import logging
import time
from collections.abc import Callable
from typing import Literal

import zenoh

from dashboard.data.pace import FULL, Pace
from messages.previews.frames import WHOLE, frame_key

Live = Literal["auto", "preview", "full"]
CUT_S = 2.2  # without a frame of a device that was heard, two in a row at 1 Hz: it is asked for

log = logging.getLogger(__name__)


class Far:
    """Keeps the subscriptions in step with the rate."""

    def __init__(
        self,
        session: zenoh.Session,
        prefix: str,
        live: Live,
        highest: int,
        heard: Callable[[zenoh.Sample], None],
    ) -> None:
        """heard: gets all samples, on Zenoh's thread. highest: rate of a preview, Hz."""
        self._session, self._prefix, self._heard = session, prefix, heard
        self._pace = None if live == "full" else Pace(highest, live == "auto")
        self._newest_ns: dict[str, int] = {}  # by device, of its frames, by home's clock
        self._offset = time.monotonic()
        self.rate = FULL if self._pace is None else self._pace.rate  # Hz
        self._subscribers = self._subscribe()

    @property
    def preview(self) -> bool:
        """Is it frames of a preview that come?"""
        return self.rate != FULL

    def step(self, now: float) -> bool:
        """Follow what the link carries; now: monotonic, s. True when the rate has changed."""
        if self._pace is None or self._pace.choose(now) == self.rate:
            return False
        before, self.rate = self.rate, self._pace.rate
        log.info("live: %s", said(self.rate))
        old, self._subscribers = self._subscribers, self._subscribe()  # without a pause
        for one in old:
            one.undeclare()
        if before == FULL or self.rate == FULL:
            self._newest_ns.clear()
        return True

    def came(self, at_ns: int, now: float) -> None:
        """Something that was published at at_ns by home's clock arrived at `now`."""
        if self._pace is not None and at_ns:
            self._pace.came(now, now - at_ns * 1e-9)

    def cut(self, device: str, at_ns: int) -> int:
        """A frame came: since when there was none, by home's clock, if that is a cut; else 0."""
        before = self._newest_ns.get(device, at_ns)
        self._newest_ns[device] = max(before, at_ns)
        return before if at_ns - before > CUT_S * 1e9 else 0

    def close(self) -> None:
        """Hear no more."""
        for one in self._subscribers:
            one.undeclare()

    def _subscribe(self) -> list[zenoh.Subscriber]:
        keys = [f"{self._prefix}/**"]
        if self.rate != FULL:
            keys = [frame_key(self._prefix, "*", self.rate)]
            keys += [topic.pattern(self._prefix) for topic in WHOLE]
        return [self._session.declare_subscriber(key, self._heard) for key in keys]


def said(rate: int) -> str:
    """A rate in words."""
    return "everything" if rate == FULL else f"preview, {rate} Hz"
