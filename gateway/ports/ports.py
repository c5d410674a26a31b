"""Ports: whatever delivers bytes, behind one file descriptor.

`open_port` knows ttys and ptys by path, tcp://host:port, rfc2217://host:port and file:///path (also
a FIFO). Every port is read with `select` and `os.read` on `fileno()`: at 3 Mbaud that costs 1 % of
a core, where one-byte reads fall behind. Errors are one line that says what was found and what to
do. Reopening after a loss is the reader's part (gateway/ports/reader.py).
"""

import errno
import fcntl
import os
import select
import socket
import stat
import termios
import threading
from pathlib import Path
from urllib.parse import urlsplit

import serial

READ_BYTES = 65536


class PortError(OSError):
    """A port that cannot be opened or was lost; str() is one line with the remedy."""


class PortEnd(PortError):
    """A file was read to its end: there is nothing to reconnect to."""


class Port:
    """An open source of bytes. `owner` keeps the object alive that owns the descriptor."""

    def __init__(
        self, url: str, fd: int, owner: object, is_file: bool = False, keepable: bool = True
    ) -> None:
        self.url = url
        self.keepable = (
            keepable  # its descriptor is all there is to it: another process can go on with that
        )
        self._fd = fd
        self._owner = owner
        self.is_file = is_file  # as fast as it can be read

    def fileno(self) -> int:
        """Descriptor for select; non-blocking."""
        return self._fd

    def read(self) -> bytes:
        """What is there now, b"" when nothing; raises PortError when the port was lost, PortEnd at
        a file's end.
        """
        try:
            data = os.read(self._fd, READ_BYTES)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise PortError(
                f"{self.url}: unplugged ({os.strerror(error.errno or 0)}); plug it in again"
            ) from None
        if data:
            return data
        if self.is_file:
            raise PortEnd(f"{self.url}: read to its end")
        raise PortError(f"{self.url}: the other side closed it; waiting until it is back")

    def write(self, data: bytes) -> None:
        """Send to the board; raises PortError when the port cannot take it all at once, a file
        never can.
        """
        if self.is_file:
            raise PortError(f"{self.url}: is a file, nobody behind it takes commands")
        try:
            sent = os.write(self._fd, data)
        except OSError as error:
            raise PortError(f"{self.url}: cannot send ({os.strerror(error.errno or 0)})") from None
        if sent < len(data):
            raise PortError(
                f"{self.url}: took {sent} of {len(data)} bytes; the board does not read"
            )

    def close(self) -> None:
        """Close; never raises."""
        try:
            self._owner.close()  # type: ignore[attr-defined]
        except OSError:
            pass


def open_port(url: str, baud: int = 921600) -> Port:
    """Open for reading. Raises PortError with a remedy; ValueError for a scheme that is none of
    ours.
    """
    scheme = urlsplit(url).scheme if "://" in url else ""
    match scheme:
        case "":
            return _open_tty(url, baud)
        case "tcp":
            return _open_tcp(url)
        case "rfc2217":
            return _open_rfc2217(url, baud)
        case "file":
            return _open_file(url)
    raise ValueError(
        f"port {url!r}: scheme {scheme!r} unknown; want a path, tcp://, rfc2217:// or file:///"
    )


class _Descriptor:
    """Owns what another process opened."""

    def __init__(self, fd: int) -> None:
        self._fd = fd

    def close(self) -> None:
        os.close(self._fd)


def adopt_port(url: str, fd: int) -> Port:
    """A port that another process opened with `open_port`, with its settings and the bytes that
    wait in it.
    """
    return Port(url, fd, _Descriptor(fd), stat.S_ISREG(os.fstat(fd).st_mode))


def _remedy(url: str, code: int | None) -> str:
    match code:
        case errno.ENOENT | errno.ENXIO | errno.ENODEV:
            return (
                f"{url}: not there; plug the board in, or take the right name from `ls"
                " /dev/serial/by-id`"
            )
        case errno.EACCES | errno.EPERM:
            return f"{url}: permission denied; `sudo usermod -aG dialout $USER`, then log in again"
        case errno.EBUSY | errno.EAGAIN:
            return f"{url}: busy, another program holds it; close that one (`fuser {url}` names it)"
        case errno.ECONNREFUSED:
            return f"{url}: connection refused; start the server or correct host and port"
    return f"{url}: {os.strerror(code) if code else 'cannot be opened'}"


class _Tty(serial.Serial):
    """pyserial throws away what has already arrived when it opens a port; a board may have sent its
    first frames.
    """

    def _reset_input_buffer(self) -> None:
        pass


def _open_tty(path: str, baud: int) -> Port:
    try:
        mode = os.stat(path).st_mode  # serial.Serial would hide the reason in its text
        if not stat.S_ISCHR(mode):
            raise PortError(
                f"{path}: is no serial port; for a file write file://{os.path.abspath(path)}"
            )
        tty = _Tty(path, baud, timeout=0, exclusive=True)
    except serial.SerialException as error:
        raise PortError(
            _remedy(path, error.errno or (errno.EBUSY if "lock" in str(error) else None))
        ) from None
    except termios.error as error:
        raise PortError(_remedy(path, error.args[0])) from None
    except PortError:
        raise
    except (OSError, ValueError) as error:
        code = error.errno if isinstance(error, OSError) else errno.EINVAL
        raise PortError(_remedy(path, code)) from None
    fcntl.ioctl(tty.fileno(), termios.TIOCEXCL)  # a second open fails even without flock
    try:
        tty.set_low_latency_mode(
            True
        )  # FTDI's 16 ms timer down to 1 ms; a pty and most CDC ports have none
    except (OSError, ValueError):
        pass
    return Port(path, tty.fileno(), tty)


def _open_tcp(url: str) -> Port:
    parts = urlsplit(url)
    if not parts.hostname or not parts.port:
        raise ValueError(f"port {url!r}: want tcp://host:port")
    try:
        link = socket.create_connection((parts.hostname, parts.port), timeout=3.0)
    except TimeoutError:
        raise PortError(f"{url}: no answer in 3 s; is the host up, the port right?") from None
    except socket.gaierror:
        raise PortError(f"{url}: host name unknown; correct it or use an address") from None
    except OSError as error:
        raise PortError(_remedy(url, error.errno)) from None
    link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    link.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    link.setblocking(False)
    return Port(url, link.fileno(), link)


def _open_file(url: str) -> Port:
    path = Path(urlsplit(url).path)
    try:
        fd = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    except OSError as error:
        raise PortError(f"{url}: {os.strerror(error.errno or 0)}; correct the path") from None
    handle = os.fdopen(fd, "rb", buffering=0)
    is_file = stat.S_ISREG(os.fstat(fd).st_mode)
    if stat.S_ISFIFO(os.fstat(fd).st_mode):  # without a writer a FIFO reads as ended at once
        select.select([fd], [], [], 0.2)
    return Port(url, fd, handle, is_file)


class _Pump:
    """pyserial's RFC 2217 client has no descriptor: a thread carries its bytes into a pipe."""

    def __init__(self, remote: serial.SerialBase) -> None:
        self._remote = remote
        self.out, self._in = os.pipe()
        os.set_blocking(self.out, False)
        self._closed = threading.Event()
        threading.Thread(target=self._carry, name="rfc2217", daemon=True).start()

    def _carry(self) -> None:
        try:
            while not self._closed.is_set():
                data = self._remote.read(1)  # blocks for the remote's timeout at most
                if data:
                    os.write(self._in, data + self._remote.read(self._remote.in_waiting))
        except (OSError, serial.SerialException, TypeError):
            pass  # the reader sees the closed pipe and says so
        os.close(self._in)

    def close(self) -> None:
        self._closed.set()
        self._remote.close()
        os.close(self.out)


def _open_rfc2217(url: str, baud: int) -> Port:
    try:
        remote = serial.serial_for_url(url, baud, timeout=0.2)
    except (serial.SerialException, OSError, ValueError) as error:
        raise PortError(f"{url}: {error}; is the RFC 2217 server up, the port right?") from None
    pump = _Pump(remote)
    return Port(url, pump.out, pump, keepable=False)
