"""What waits for the pipeline: a lane for each device, taken in turn, so that one that sends too
much waits for itself, and the others do not wait for it.

In a lane the order is that of arrival. When there is no room the newest message of the longest lane
goes; its gap is noticed and asked for (messages/history/mending.py). Orders, answers and the order
to end are never dropped.
"""

import threading
from collections import deque
from typing import Any

from messages.history.mending_state import Arrival


class Inbox:
    """A bounded queue of many lanes; `get` waits, all else returns at once."""

    def __init__(self, most: int, most_bytes: int) -> None:
        """most, most_bytes: of all arrivals that wait."""
        self._most, self._most_bytes = most, most_bytes
        self._lanes: dict[str, deque[Any]] = {}
        self._turns: deque[str] = deque()  # lanes that hold something, the next first
        self._count = self._bytes = 0  # of arrivals
        self._ended = False
        self._news = threading.Condition()
        self.dropped = 0

    def __len__(self) -> int:
        return sum(map(len, self._lanes.values()))

    def offer(self, lane: str, arrival: Arrival) -> bool:
        """A message from the bus; False when one, this or another, was dropped for it."""
        with self._news:
            room = self._make_room(lane, len(arrival.payload))
            if room:
                self._append(lane, arrival)
            return room and not self._fell

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
                self._news.wait()
            if not self._turns:
                return None
            lane = self._turns.popleft()
            items = self._lanes[lane]
            item = items.popleft()
            if isinstance(item, Arrival):
                self._count, self._bytes = self._count - 1, self._bytes - len(item.payload)
            if items:
                self._turns.append(lane)
            else:
                del self._lanes[lane]
            return lane, item

    def _append(self, lane: str, item: Any, first: bool = False) -> None:
        items = self._lanes.setdefault(lane, deque())
        if not items:
            self._turns.append(lane)
        items.appendleft(item) if first else items.append(item)
        if isinstance(item, Arrival):
            self._count, self._bytes = self._count + 1, self._bytes + len(item.payload)
        self._news.notify()

    def _make_room(self, lane: str, size: int) -> bool:
        """Drop the newest of the longest lane as long as there is no room; False when that is this
        lane.
        """
        self._fell = False
        while self._count >= self._most or self._bytes + size > self._most_bytes:
            self._fell = True
            self.dropped += 1
            longest = max(self._lanes, key=lambda name: len(self._lanes[name]), default=lane)
            items = self._lanes.get(longest, deque())
            if longest == lane or len(items) < 2 or not isinstance(items[-1], Arrival):
                return False
            gone = items.pop()
            self._count, self._bytes = self._count - 1, self._bytes - len(gone.payload)
        return True
