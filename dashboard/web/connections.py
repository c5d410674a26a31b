"""How many connections there may be, and for how long one may say nothing.

Anybody can open connections and let them hang, before any sign-in. So a connection has `request_s`
to send a whole head of a request, and again after each answer; an address has room for
`per_address` and all together for `most`. A new one is let in where an idle one can give way: first
of the same address, then of the address that has most. People behind one address with whoever
floods it still get in, because they ask at once and are answered.
"""

import asyncio
import ipaddress
import logging
import resource
import socket
import struct
import sys
import time
from collections import Counter
from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol, h11
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

from dashboard.settings import DashboardSettings
from dashboard.web.auth import Backoff
from dashboard.web.guard import security_headers
from dashboard.web.tls.certificate import Certificate
from dashboard.web.tls.first_byte import FirstByte

log = logging.getLogger(__name__)

LOOK_S = 0.5  # s between two looks at all connections
LEAST_TAKEN = 16_384  # bytes within take_s, of a client that is still there
ACKED = 120  # where struct tcp_info of Linux has tcpi_bytes_acked, 64 bits
LINGER_S = 5.0  # s, for the rest of an answer after a connection was closed
SPARED = 200  # open files of the process that are not connections


@dataclass(eq=False)
class Connection:
    """One TCP connection, also after it has become a WebSocket."""

    transport: asyncio.Transport  # of TCP, also where TLS is within
    protocol: H11Protocol | None  # None until a TLS handshake begins
    address: str
    idle_since: float | None  # s, monotonic; since its last answer, None while one is made
    stuck_since: float | None = None  # s, while its client hardly takes what is sent
    taken_then: int = 0  # bytes that it had taken at that time
    closing_since: float | None = None  # s, while only its end is waited for

    @property
    def gone(self) -> bool:
        """Its socket is closed."""
        return self.transport.get_extra_info("socket").fileno() < 0

    @property
    def taken(self) -> int:
        """Bytes that have reached its client's machine."""
        line = self.transport.get_extra_info("socket")
        info = line.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, ACKED + 8)
        return int.from_bytes(info[ACKED:], sys.byteorder)

    def look(self, now: float) -> None:
        """Is it stuck? What waits for it has to become less, by more than a trickle."""
        if not self.transport.get_write_buffer_size():
            self.stuck_since = None
        elif self.stuck_since is None or self.taken - self.taken_then >= LEAST_TAKEN:
            self.stuck_since, self.taken_then = now, self.taken

    @property
    def closing(self) -> bool:
        """Nothing more is answered on it."""
        inner = None if self.protocol is None else self.protocol.transport
        return self.transport.is_closing() or (inner is not None and inner.is_closing())

    @property
    def asked(self) -> bool:
        """A request of it is being answered, or it is a WebSocket."""
        if self.protocol is None or self.protocol.transport is None or self.closing:
            return False  # TLS is not there yet, or not any more
        cycle = self.protocol.cycle
        upgraded = self.protocol.transport.get_protocol() is not self.protocol
        return upgraded or (cycle is not None and not cycle.response_complete)


class Connections:
    """All of one server. Everything runs in its event loop."""

    def __init__(self, settings: DashboardSettings, ended: Counter[str]) -> None:
        """ended: why, and how many connections were ended here; counted for the page."""
        files = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
        self._most = max(16, min(settings.connections, files - SPARED))
        self._settings = settings
        self._open: dict[Connection, None] = {}  # in the order of their beginning
        self._looking: asyncio.TimerHandle | None = None
        self.ended = ended

    def protocol(self, certificate: Certificate | None = None) -> Callable[..., asyncio.Protocol]:
        """What uvicorn makes of every connection; with a certificate TLS is spoken on all."""
        connections = self

        class Counted(H11Protocol):
            _counted: Connection | None = None

            def within(self, counted: Connection) -> "Counted":
                """The one in a TLS connection, which is counted already."""
                self._counted, counted.protocol = counted, self
                return self

            def connection_made(self, transport: Any) -> None:
                super().connection_made(transport)
                if self._counted is None:
                    self._counted = connections.enter(transport, self)

            def on_response_complete(self) -> None:
                super().on_response_complete()
                if self._counted is not None:
                    self._counted.idle_since = time.monotonic()

            def send_400_response(self, msg: str) -> None:
                """What is no HTTP never comes to our application: the same headers here."""
                text = msg.encode("ascii", "replace")
                headers = {"content-type": "text/plain; charset=utf-8", "connection": "close"}
                headers |= {"content-length": f"{len(text)}", **dict(security_headers(False))}
                answer = h11.Response(status_code=400, headers=list(headers.items()))
                for event in (answer, h11.Data(data=text), h11.EndOfMessage()):
                    self.transport.write(self.conn.send(event))
                self.transport.close()

            def connection_lost(self, exc: Exception | None) -> None:
                connections.leave(self._counted)
                super().connection_lost(exc)

        if certificate is None:
            return Counted
        settings = self._settings
        return lambda **options: FirstByte(
            certificate,
            lambda transport: self.enter(transport, None),
            lambda counted: Counted(**options).within(counted),
            self.over,
            settings.request_s,
            10.0 * settings.take_s,  # _look judges that; it knows who takes, though slowly
        )

    def sockets(self) -> type[WebSocketsSansIOProtocol]:
        """What uvicorn makes of a connection that becomes a WebSocket. Text that is none ends it
        with one line; uvicorn itself would log a traceback for each.
        """
        connections = self

        class Checked(WebSocketsSansIOProtocol):
            def send_receive_event_to_app(self) -> None:
                if self.curr_msg_data_type == "text" and not self.close_sent:
                    try:
                        b"".join(self.frames).decode()
                    except UnicodeDecodeError as error:
                        connections.count(_network(self.transport), f"text is not UTF-8: {error}")
                        self.frames = []
                        self.conn.send_close(1007, "text must be UTF-8")
                        self.handle_parser_exception()
                        return
                super().send_receive_event_to_app()

        return Checked

    def enter(
        self, transport: asyncio.Transport, protocol: H11Protocol | None
    ) -> Connection | None:
        """Count a new connection, or end it when nobody can give way."""
        address = _network(transport)
        new = Connection(transport, protocol, address, time.monotonic())
        if not self._exempt(transport):
            same = [one for one in self._open if one.address == address]
            if len(same) >= self._settings.connections_per_address and not self._evict(same):
                self._end(new, "too many of one address")
                return None
        if len(self._open) >= self._most:
            [(crowd, _)] = Counter(one.address for one in self._open).most_common(1)
            crowded = [one for one in self._open if one.address == crowd]
            if not self._evict(crowded) and not self._evict(list(self._open)):
                self._end(new, "too many")
                return None
        self._open[new] = None
        if self._looking is None:
            self._looking = asyncio.get_running_loop().call_later(LOOK_S, self._look)
        return new

    def leave(self, one: Connection | None) -> None:
        """It is closed."""
        if one is not None:
            self._open.pop(one, None)

    def over(self, one: Connection | None, why: str) -> None:
        """It is closed, and why where it had not come to anything."""
        if one in self._open and why:
            self.count(one.address, why)
        self.leave(one)

    def __len__(self) -> int:
        return len(self._open)

    def _evict(self, among: list[Connection]) -> bool:
        """End the one that has been idle longest; False when all are at work."""
        idle = [one for one in among if not one.asked]
        if not idle:
            return False
        self._end(min(idle, key=lambda one: one.idle_since or 0.0), "gave way")
        return True

    def _end(self, one: Connection, why: str) -> None:
        self._open.pop(one, None)
        if one.transport.get_write_buffer_size() and not one.gone:
            line = one.transport.get_extra_info("socket")
            # what waits in the kernel goes, too, and not only when the client is given up there
            line.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            one.transport.abort()
        else:
            one.transport.close()
        self.count(one.address, why)

    def count(self, address: str, why: str) -> None:
        """One that was ended, by the words before a colon; said unless there is a flood of them."""
        kind = why.partition(":")[0]
        self.ended[kind] += 1
        n = self.ended[kind]
        if n & (n - 1) == 0:
            log.warning("connection of %s ended: %s (%d so far)", address, why, n)

    def _look(self) -> None:
        """End those that said nothing for too long, or take nothing."""
        self._looking = None
        now = time.monotonic()
        for one in list(self._open):
            if one.gone:
                self._open.pop(one)
                continue
            one.look(now)
            if one.asked:
                one.idle_since = None
            elif one.idle_since is None:
                one.idle_since = now
            if one.closing:
                one.closing_since = one.closing_since or now
                since = one.stuck_since or one.closing_since
                self._after(one, since, LINGER_S, "took nothing", now)
            elif one.idle_since is not None:
                self._after(one, one.idle_since, self._settings.request_s, "asked nothing", now)
            if one.stuck_since is not None:
                self._after(one, one.stuck_since, self._settings.take_s, "took nothing", now)
        if self._open:
            self._looking = asyncio.get_running_loop().call_later(LOOK_S, self._look)

    def _after(self, one: Connection, since: float, limit: float, why: str, now: float) -> None:
        if one in self._open and now - since > limit:
            self._end(one, why)

    def _exempt(self, transport: asyncio.Transport) -> bool:
        """A proxy of ours brings everybody's connections; it limits them itself."""
        peer = transport.get_extra_info("peername")
        return bool(peer) and trusted(peer[0], self._settings.trusted_proxies)


def trusted(address: str, proxies: Collection[str]) -> bool:
    """Is this the address of one of our proxies? They are addresses, networks or `*`."""
    for proxy in proxies:
        try:
            if ipaddress.ip_address(address) in ipaddress.ip_network(proxy, strict=False):
                return True
        except ValueError:
            if proxy in ("*", address):
                return True
    return False


def _network(transport: asyncio.Transport) -> str:
    peer = transport.get_extra_info("peername")
    return Backoff.network(peer[0]) if peer else "unknown"
