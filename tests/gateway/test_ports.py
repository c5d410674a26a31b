"""Ports: every kind opens, every failure names its remedy."""

import os
import socket
import threading
import time

import pytest

from gateway.ports.ports import PortEnd, PortError, _remedy, open_port
from gateway.virtual.board_link import PtyLink, TcpLink


def read_some(port, wanted: int, seconds: float = 10.0) -> bytes:
    got, end = b"", time.monotonic() + seconds
    while len(got) < wanted and time.monotonic() < end:
        got += port.read()
        time.sleep(0.005)
    return got


def test_pty_keeps_what_came_before_anybody_read():
    link = PtyLink()
    assert not link.connected and link.write(b"into the void")
    port = open_port(link.path, 921600)
    assert link.connected and link.write(bytes(range(256)))
    assert read_some(port, 256) == bytes(
        range(256)
    )  # raw: nothing translated, no control characters
    port.close()
    assert not link.connected
    link.close()


def test_busy_port_is_refused_with_its_remedy():
    link = PtyLink()
    port = open_port(link.path)
    with pytest.raises(PortError, match="busy, another program holds it"):
        open_port(link.path)
    port.close()
    open_port(link.path).close()
    link.close()


def test_unplugged_pty_is_an_error_not_silence():
    link = PtyLink()
    port = open_port(link.path)
    link.close()
    with pytest.raises(PortError, match="unplugged|closed it"):
        port.read()
    port.close()


@pytest.mark.parametrize(
    ("url", "words"),
    [
        ("/dev/serial/by-id/usb-not-there", "not there; plug the board in"),
        ("file:///not/there.bin", "No such file"),
        ("rfc2217://127.0.0.1:9", "is the RFC 2217 server up"),
    ],
)
def test_absent_ports_say_what_to_do(url, words):
    with pytest.raises(PortError, match=words):
        open_port(url)


def test_refused_tcp_and_ordinary_file(free_port, tmp_path):
    with pytest.raises(PortError, match="connection refused"):
        open_port(f"tcp://127.0.0.1:{free_port}")
    plain = tmp_path / "log.bin"
    plain.write_bytes(b"x")
    with pytest.raises(PortError, match="file://"):
        open_port(str(plain))


def test_permission_text():
    """root may open everything, so the text is tested apart from the call."""
    assert "dialout" in _remedy("/dev/ttyUSB0", 13)


@pytest.mark.parametrize("url", ["carrier-pigeon://x", "tcp://nowhere", "tcp://:80"])
def test_urls_that_are_none(url):
    with pytest.raises(ValueError, match="port"):
        open_port(url)


def test_file_ends_and_fifo_goes_on(tmp_path):
    plain = tmp_path / "log.bin"
    plain.write_bytes(b"0123456789" * 10_000)
    port = open_port(f"file://{plain}")
    assert port.read() + port.read() == plain.read_bytes()
    with pytest.raises(PortEnd):
        port.read()
    port.close()
    os.mkfifo(tmp_path / "fifo")
    writer = threading.Thread(target=lambda: (tmp_path / "fifo").write_bytes(b"through the pipe"))
    writer.start()
    port = open_port(f"file://{tmp_path / 'fifo'}")
    writer.join(10)
    assert port.read() == b"through the pipe"
    port.close()


def test_tcp_carries_bytes_and_notices_the_end():
    link = TcpLink()
    port = open_port(link.path)
    while not link.connected:
        time.sleep(0.005)
    link.write(b"hello")
    assert read_some(port, 5) == b"hello"
    link.close()
    with pytest.raises(PortError, match="closed it"):
        read_some(port, 1)
    port.close()


def test_rfc2217_carries_bytes():
    """Against pyserial's own server side (serial.rfc2217.PortManager) on a loop-back port."""
    import serial
    from serial import rfc2217

    tty = serial.serial_for_url("loop://", 115200, timeout=0.05)
    server = socket.create_server(("127.0.0.1", 0))
    done = threading.Event()

    class Answer:
        def write(self, data):
            self.connection.sendall(data)

    def serve():
        answer = Answer()
        answer.connection, _ = server.accept()
        answer.connection.settimeout(0.05)
        manager = rfc2217.PortManager(tty, answer)
        while not done.is_set():
            try:
                list(manager.filter(answer.connection.recv(1024)))
            except TimeoutError:
                pass
            data = tty.read(256)
            if data:
                answer.write(b"".join(manager.escape(data)))
        answer.connection.close()

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    port = open_port(f"rfc2217://127.0.0.1:{server.getsockname()[1]}", 115200)
    tty.write(bytes(range(256)))
    assert read_some(port, 256) == bytes(range(256))
    port.close()
    done.set()
    thread.join(10)
    tty.close()
    server.close()
