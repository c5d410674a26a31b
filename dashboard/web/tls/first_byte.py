"""The first byte of a connection on a port with TLS: a handshake, or somebody who typed http://.

The limits on connections begin here, with the connection and before its handshake: somebody who
opens many and never speaks is as much a flood under TLS as without. asyncio would tell us of a
connection only after its handshake.
"""

import asyncio
from asyncio.sslproto import SSLProtocol
from collections.abc import Callable
from typing import Any

from dashboard.web.tls.certificate import Certificate

HANDSHAKE = 0x16  # content type of a TLS record that begins one
RECORD = 32_768  # bytes at a time; a record has at most 16 KiB
WRONG = b"This port speaks TLS only: write https:// instead of http:// before the same address.\n"
ANSWER = (
    b"HTTP/1.1 400 Bad Request\r\ncontent-type: text/plain; charset=utf-8\r\n"
    b"content-length: %d\r\ncache-control: no-store\r\nx-content-type-options: nosniff\r\n"
    b"connection: close\r\n\r\n%s" % (len(WRONG), WRONG)
)


class Tls(SSLProtocol):
    """asyncio's TLS with less memory for each connection, and a word when it is over."""

    max_size = RECORD

    def __init__(self, *arguments: Any, over: Callable[[str], None], **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._over = over

    def connection_lost(self, exc: Exception | None) -> None:
        super().connection_lost(exc)
        self._over("" if "cipher" in self._extra else "no TLS handshake")


class FirstByte(asyncio.Protocol):
    """What a TCP connection is before it has said anything."""

    def __init__(
        self,
        certificate: Certificate,
        enter: Callable[[asyncio.Transport], Any],
        make: Callable[[Any], asyncio.Protocol],
        over: Callable[[Any, str], None],
        handshake_s: float,
        close_s: float,
    ) -> None:
        """enter: counts the connection and gives what it is counted as, None when it was ended at
        once. make: the protocol within TLS, of one that is counted. over: it ended, and why where
        it had not come to anything. close_s: for the other side to take the rest and to end, too.
        """
        self._certificate, self._enter, self._make, self._over = certificate, enter, make, over
        self._handshake_s, self._close_s = handshake_s, close_s
        self._transport: asyncio.Transport | None = None
        self._counted: Any = None

    def connection_made(self, transport: Any) -> None:
        self._transport, self._counted = transport, self._enter(transport)

    def data_received(self, data: bytes) -> None:
        if self._counted is None or self._transport is None or self._transport.is_closing():
            return
        if data[0] == HANDSHAKE:
            self._shake_hands(self._transport, data)
        else:
            self._transport.write(ANSWER)
            self._transport.close()
            self._over(self._counted, "http where TLS is spoken")

    def connection_lost(self, exc: Exception | None) -> None:
        self._over(self._counted, "")

    def _shake_hands(self, transport: asyncio.Transport, data: bytes) -> None:
        tls = Tls(
            asyncio.get_running_loop(),
            self._make(self._counted),
            self._certificate.context,
            None,
            server_side=True,
            ssl_handshake_timeout=self._handshake_s,
            ssl_shutdown_timeout=self._close_s,
            over=lambda why: self._over(self._counted, why),
        )
        transport.set_protocol(tls)
        tls.connection_made(transport)
        while data and not transport.is_closing():
            room = tls.get_buffer(len(data))
            taken = min(len(room), len(data))
            room[:taken] = data[:taken]
            tls.buffer_updated(taken)
            data = data[taken:]
