"""The board's end of a line: a pseudo-terminal or a TCP socket that behaves like a UART.

A UART sends into the void while nobody listens, and a board with a full transmit buffer drops whole
frames and counts them.
"""

import os
import select
import socket
import time
import tty
from pathlib import Path

WRITE_WAIT_S = 0.2  # a reader that takes nothing for so long costs the frame


class PtyLink:
    """A pty; the gateway opens `path`. symlink: a stable name for it; a link of that name is
    replaced. Raises FileExistsError for anything else that is there.
    """

    def __init__(self, symlink: Path | None = None) -> None:
        self._master, slave = os.openpty()
        tty.setraw(slave)
        self.path = os.ttyname(slave)
        self._symlink = symlink
        if symlink is not None:
            if symlink.exists() and not symlink.is_symlink():
                raise FileExistsError(f"{symlink}: there is a file of this name; want a new name")
            symlink.parent.mkdir(parents=True, exist_ok=True)
            symlink.unlink(missing_ok=True)
            symlink.symlink_to(self.path)
        os.close(slave)  # from now on POLLHUP says that nobody has the port open
        os.set_blocking(self._master, False)
        self._poll = select.poll()
        self._poll.register(self._master, select.POLLOUT)

    @property
    def connected(self) -> bool:
        """True while somebody has the port open."""
        return not any(event & select.POLLHUP for _, event in self._poll.poll(0))

    def write(self, data: bytes) -> bool:
        """Send a frame; False when it had to be dropped because the reader takes nothing."""
        return _write_all(self._master, self._poll, data)

    def read(self) -> bytes:
        """What the host has sent since the last call."""
        try:
            return os.read(self._master, 4096)
        except OSError:  # nothing there, or nobody has the port open
            return b""

    def close(self) -> None:
        """Unplug."""
        if self._symlink is not None and self._symlink.is_symlink():
            self._symlink.unlink()
        os.close(self._master)


class TcpLink:
    """A TCP server for one reader at a time; `port` is the one it listens on."""

    def __init__(self, port: int = 0, host: str = "127.0.0.1") -> None:
        self._server = socket.create_server((host, port))
        self._server.setblocking(False)
        self.port = self._server.getsockname()[1]
        self.path = f"tcp://{host}:{self.port}"
        self._client: socket.socket | None = None
        self._poll = select.poll()

    @property
    def connected(self) -> bool:
        """True while a reader is connected; takes in a waiting one."""
        try:
            client, _ = self._server.accept()
        except BlockingIOError:
            return self._client is not None
        self._drop_client()
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        client.setblocking(False)
        self._client, self._poll = client, select.poll()
        self._poll.register(client, select.POLLOUT)
        return True

    def write(self, data: bytes) -> bool:
        """Send a frame; False when it had to be dropped because the reader takes nothing."""
        if not self.connected or self._client is None:
            return True
        try:
            return _write_all(self._client.fileno(), self._poll, data)
        except OSError:
            self._drop_client()
            return True

    def read(self) -> bytes:
        """What the host has sent since the last call."""
        if self._client is None:
            return b""
        try:
            return self._client.recv(4096)
        except OSError:
            return b""

    def close(self) -> None:
        """Unplug."""
        self._drop_client()
        self._server.close()

    def _drop_client(self) -> None:
        if self._client is not None:
            self._client.close()
            self._client = None


def _write_all(fd: int, poll: select.poll, data: bytes) -> bool:
    """All of it, or nothing: once a frame has begun it is finished unless the reader stays away."""
    rest = memoryview(data)
    end = time.monotonic() + WRITE_WAIT_S
    while rest:
        if any(event & select.POLLHUP for _, event in poll.poll(0)):
            return True  # nobody listens: into the void
        try:
            rest = rest[os.write(fd, rest) :]
        except BlockingIOError:
            left = end - time.monotonic()
            if left <= 0:
                return False
            poll.poll(left * 1000)
    return True
