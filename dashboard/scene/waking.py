"""viser's loop is woken once for all browsers of a round.

viser wakes its loop, by a write to a socket, for each group of messages to each browser. With many
browsers that takes more time than all else that is done for them, and mostly wakes a loop that is
awake.
"""

import contextlib
import threading
from asyncio import AbstractEventLoop
from collections.abc import Callable, Iterator
from typing import Any

import viser


class Waking:
    """Holds back the wakes of a thread's round until its end."""

    def __init__(self) -> None:
        self._here = threading.local()

    def take(self, client: viser.ClientHandle) -> None:
        """From now on this browser's messages are among those that are held back."""
        buffer = client._websock_connection.get_message_buffer()
        buffer.event_loop = _Loop(buffer.event_loop, self._here)  # type: ignore[assignment]

    @contextlib.contextmanager
    def once(self) -> Iterator[None]:
        """A round: whatever it wakes is woken at its end, together."""
        waiting: dict[AbstractEventLoop, dict[Callable[..., None], None]] = {}
        self._here.waiting = waiting
        try:
            yield
        finally:
            self._here.waiting = None
            for loop, calls in waiting.items():
                with contextlib.suppress(RuntimeError):  # closed: nobody is there to be woken
                    loop.call_soon_threadsafe(_all, tuple(calls))


class _Loop:
    """The event loop as a browser's buffer sees it."""

    def __init__(self, loop: AbstractEventLoop, here: threading.local) -> None:
        self._loop, self._here = loop, here

    def __getattr__(self, name: str) -> Any:
        return getattr(self._loop, name)

    def call_soon_threadsafe(self, call: Callable[..., None], *given: Any) -> None:
        waiting = getattr(self._here, "waiting", None)
        if waiting is None or given:
            self._loop.call_soon_threadsafe(call, *given)
        else:
            waiting.setdefault(self._loop, {})[call] = None


def _all(calls: tuple[Callable[..., None], ...]) -> None:
    for call in calls:
        call()
