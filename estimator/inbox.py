"""What waits for the pipeline: a lane for each device, taken in turn, so that one that sends too
much waits for itself, and the others do not wait for it.

In a lane the order is that of arrival. When there is no room the newest message of the largest lane
goes; its gap is noticed and asked for (messages/history/mending.py). Orders, answers and the order
to end are never dropped.
"""

import threading
from collections import deque
from collections.abc import Callable
from typing import Any

from messages.history.mending_state import Arrival

WAKE_S = 1.0  # who waits says so often that he does


class Inbox:
    """A bounded queue of many lanes; `get` waits, all else returns at once."""

    def __init__(
        self, most: int, most_bytes: int, waits: Callable[[], object] = lambda: None
    ) -> None:
        """most, most_bytes: of all arrivals that wait. waits(): there is still nothing."""
        self._waits = waits
        self._most, self._most_bytes = most, most_bytes
        self._lanes: dict[str, deque[Any]] = {}
        self._turns: deque[str] = deque()  # lanes that hold something, the next first
        self._count = self._bytes = 0  # of arrivals
        self._sizes: dict[str, int] = {}  # bytes of the arrivals in each lane
        self._ended = False
        self._news = threading.Condition()
        self.dropped = 0

    def __len__(self) -> int:
        return sum(map(len, self._lanes.values()))

    def offer(self, lane: str, arrival: Arrival) -> bool:
        """A message from the bus; False when one, this or another, was dropped for it."""
        with self._news:
            before = self.dropped
            if self._make_room(lane, len(arrival.payload)):
                self._append(lane, arrival)
            return self.dropped == before

    def put(self, lane: str, item: object) -> None:
        """What must not be lost: an order, an answer."""
        with self._news:
            self._append(lane, item)

    def put_first(self, lane: str, items: list[Any]) -> None:
        """Items that come before all that waits in this lane."""
        with self._news:
            for item in reversed(items):
                self._append(lane, item, first=True)

    def end(self) -> None:
        """Give None after what waits now."""
        with self._news:
            self._ended = True
            self._news.notify()

    def get(self) -> tuple[str, Any] | None:
        """The next lane and its oldest item; None at the end."""
        with self._news:
            while not self._turns and not self._ended:
                self._news.wait(WAKE_S)
                self._waits()
            if not self._turns:
                return None
            lane = self._turns.popleft()
            items = self._lanes[lane]
            item = items.popleft()
            self._count_item(lane, item, -1)
            if items:
                self._turns.append(lane)
            else:
                del self._lanes[lane]
                self._sizes.pop(lane, None)
            return lane, item

    def _append(self, lane: str, item: Any, first: bool = False) -> None:
        items = self._lanes.setdefault(lane, deque())
        if not items:
            self._turns.append(lane)
        items.appendleft(item) if first else items.append(item)
        self._count_item(lane, item, 1)
        self._news.notify()

    def _count_item(self, lane: str, item: Any, sign: int) -> None:
        if isinstance(item, Arrival):
            self._count += sign
            size = sign * len(item.payload)
            self._bytes += size
            self._sizes[lane] = self._sizes.get(lane, 0) + size

    def _has_room(self, size: int) -> bool:
        return self._count < self._most and self._bytes + size <= self._most_bytes

    def _make_room(self, lane: str, size: int) -> bool:
        """Drop the newest of the largest lane as long as there is no room; False when that is this
        lane.
        """
        while not self._has_room(size):
            self.dropped += 1
            largest = max(self._sizes, key=lambda name: self._sizes[name], default=lane)
            items = self._lanes.get(largest, ())
            newest = next(
                (k for k in reversed(range(len(items))) if isinstance(items[k], Arrival)), None
            )
            if largest == lane or newest is None:
                return False
            gone = items[newest]
            del items[newest]
            self._count_item(largest, gone, -1)
            if not items:
                del self._lanes[largest], self._sizes[largest]
                self._turns.remove(largest)
        return True
