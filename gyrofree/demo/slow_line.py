"""A line between two places on one machine: as fast and as late as one through a town, and its
cable can be pulled. It carries the bytes of TCP connections, so it delays and never loses.
"""

import asyncio
import contextlib
import socket
import threading
import time
from collections import deque

PIECE = 4096  # bytes
WAITING_S = 0.3  # of bytes that the line takes before who sends has to wait
BUFFER = 1 << 16  # bytes that the kernel keeps of each connection; it would keep megabytes
LOOK_S = 0.02  # between two looks at a pulled cable


class Way:
    """One direction, shared by all connections."""

    def __init__(self, rate_bps: float, delay_s: float) -> None:
        self._rate_bps, self._delay_s = rate_bps, delay_s
        self._free_s = 0.0  # time.monotonic() at which all that was taken has left
        self.carried = 0  # bytes

    def take(self, size: int) -> float:
        """A piece of so many bytes; time.monotonic() at which it has come to the other end."""
        self._free_s = max(self._free_s, time.monotonic()) + 8.0 * size / self._rate_bps
        self.carried += size
        return self._free_s + self._delay_s

    @property
    def queue_s(self) -> float:
        """How long a piece would wait now before it leaves."""
        return self._free_s - time.monotonic()


class SlowLine:
    """Takes connections at one port of the loopback and makes them at another."""

    def __init__(self, here: int, there: int, rate_bps: float, delay_s: float) -> None:
        """here, there: ports. delay_s: of one way. Raises OSError where `here` is taken."""
        self._there = there
        self.out, self.back = Way(rate_bps, delay_s), Way(rate_bps, delay_s)
        self.pulled = False
        listening = _socket()
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listening.bind(("127.0.0.1", here))
        except OSError:
            listening.close()
            raise
        self._loop = asyncio.new_event_loop()
        self._server = self._loop.run_until_complete(
            asyncio.start_server(self._carry, sock=listening, limit=PIECE)
        )
        self._thread = threading.Thread(target=self._loop.run_forever, name="line", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End all connections."""
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(5.0)
        self._server.close()
        for task in asyncio.all_tasks(self._loop):
            task.cancel()
        self._loop.run_until_complete(asyncio.sleep(0))
        self._loop.close()

    async def _carry(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        far = _socket()
        far.setblocking(False)
        try:
            await self._loop.sock_connect(far, ("127.0.0.1", self._there))
        except OSError:  # nobody listens there yet
            far.close()
            writer.close()
            return
        far_reader, far_writer = await asyncio.open_connection(sock=far, limit=PIECE)
        for each in (writer, far_writer):
            each.transport.set_write_buffer_limits(PIECE)
        await asyncio.gather(
            self._pump(reader, far_writer, self.out), self._pump(far_reader, writer, self.back)
        )

    async def _pump(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, way: Way
    ) -> None:
        under_way: deque[tuple[float, bytes]] = deque()
        more = asyncio.Event()
        bringing = asyncio.create_task(self._bring(under_way, more, writer))
        with contextlib.suppress(OSError):
            while piece := await reader.read(PIECE):
                under_way.append((way.take(len(piece)), piece))
                more.set()
                while self.pulled or way.queue_s > WAITING_S:
                    await asyncio.sleep(LOOK_S)
        under_way.append((way.take(0), b""))
        more.set()
        await bringing

    async def _bring(
        self,
        under_way: deque[tuple[float, bytes]],
        more: asyncio.Event,
        writer: asyncio.StreamWriter,
    ) -> None:
        with contextlib.suppress(OSError):
            while True:
                await more.wait()
                more.clear()
                while under_way:
                    due_s, piece = under_way.popleft()
                    await asyncio.sleep(max(0.0, due_s - time.monotonic()))
                    while self.pulled:
                        await asyncio.sleep(LOOK_S)
                    if not piece:
                        writer.close()
                        return
                    writer.write(piece)
                    await writer.drain()


def _socket() -> socket.socket:
    made = socket.socket()
    for which in (socket.SO_RCVBUF, socket.SO_SNDBUF):
        made.setsockopt(socket.SOL_SOCKET, which, BUFFER)
    return made
