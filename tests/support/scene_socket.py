"""The scene's WebSocket as a browser opens it, for tests that go step by step.

The library has a client for threads, which reads in one thread while another sends. On a TLS
connection of CPython that is a race: under load 7 of 331 handshakes came to no end. Here one
thread with an event loop owns all connections: 0 of 861.
"""

import asyncio
import functools
import threading
from collections.abc import Coroutine
from typing import Any

import websockets.asyncio.client


@functools.cache
def _loop() -> asyncio.AbstractEventLoop:
    loop = asyncio.new_event_loop()
    threading.Thread(target=loop.run_forever, name="scene sockets", daemon=True).start()
    return loop


def _wait(work: Coroutine[Any, Any, Any]) -> Any:
    return asyncio.run_coroutine_threadsafe(work, _loop()).result()


class SceneSocket:
    """One open connection. Raises what the library's own client raises."""

    def __init__(self, url: str, **options: Any) -> None:
        """options: of websockets.asyncio.client.connect."""

        async def connected() -> websockets.asyncio.client.ClientConnection:
            return await websockets.asyncio.client.connect(url, proxy=None, **options)

        self._link = _wait(connected())
        self.subprotocol = self._link.subprotocol

    def send(self, data: bytes | str, text: bool | None = None) -> None:
        """Returns when it has been handed to the kernel or its queue has room; text: said to be
        text although it is bytes.
        """
        _wait(self._link.send(data, text))

    def recv(self, timeout: float | None = None) -> bytes | str:
        """The next message; TimeoutError when none comes within `timeout` seconds."""

        async def received() -> bytes | str:
            async with asyncio.timeout(timeout):  # of 0: what has come already
                return await self._link.recv()

        return _wait(received())

    def close(self) -> None:
        """Shake hands on the end, or drop it after the close timeout."""
        _wait(self._link.close())

    def __enter__(self) -> "SceneSocket":
        return self

    def __exit__(self, *error: object) -> None:
        self.close()
