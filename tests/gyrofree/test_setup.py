"""`gyrofree setup`: real ports (pseudo-terminals, a line server with bauds), a real terminal."""

import contextlib
import json
import os
import pty
import random
import re
import select
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
import serial
from hypothesis import given, settings
from hypothesis import strategies as st
from serial import rfc2217

from firmware_protocol.codec import encode
from firmware_protocol.frames import Acc12, Adc, Hello, Imu6, Tacho
from gateway.virtual.board_link import PtyLink
from gateway.virtual.receiver import sentences
from gyrofree.config import Settings, load
from gyrofree.setup.answers import Answers, free_name, settings_with, write
from gyrofree.setup.ear import Ear
from gyrofree.setup.ports import listen, names

PYTHON = [sys.executable, "-P", "-m", "gyrofree"]
HELLO = Hello(
    minor=1,
    board_id=0,
    sensor_mask=15,
    n_axes=12,
    tick_hz=1_000_000,
    sample_period_ns=10_000_000,
    batch=1,
    firmware="lab",
    version=(1, 2, 3),
)


def frames(count=40, payload=None, **header):
    rows = payload or Acc12(0, 10_000_000, 15, 0, ((1,) * 12,))
    items = [HELLO, *([rows] * count), Tacho(0, 1, (0, 5, 9))]
    return b"".join(encode(p, epoch=1, seq=k, t_us=k * 10_000) for k, p in enumerate(items))


def receiver(count=3):
    import datetime

    import numpy as np

    utc = datetime.datetime(2026, 1, 1, tzinfo=datetime.UTC)
    return b"".join(sentences(np.zeros(3), utc) for _ in range(count))


LINES = b"".join(b"%d,0.01,-0.02,9.81,0.1,0.2,0.3\r\n" % k for k in range(40))
WHO = {
    "board": (frames(), "LPC1768 cube, firmware 1.2.3 lab; 12 accelerometer axes, 100 Hz; 3 tacho"),
    "imu": (frames(5, Imu6(0, 5_000_000, 10, 1000, ((1,) * 6,))), "gyroscopes, 6 axes, 200 Hz"),
    "analogue": (frames(5, Adc(0, 10_000_000, 31, 3300, ((1,) * 5,))), "5 analogue inputs"),
    "receiver": (receiver(), "a GNSS receiver (GGA, GST, RMC)"),
    "text": (LINES, "lines of text of another logger, such as '1,0.01"),
    "sirf": (b"\xa0\xa2\x00\x05hello\x11\x22\xb0\xb3" * 20, "SiRF binary, which is not read"),
    "silence": (b"", "silence"),
}


@pytest.mark.parametrize("who", WHO)
def test_who_speaks_is_told_however_the_bytes_are_cut(who):
    data, words = WHO[who]
    said = set()
    for size in (1, 7, 64, 100_000):
        ear = Ear()
        for at in range(0, len(data), size):
            ear.feed(data[at : at + size])
        said.add((ear.kind, ear.said))
    assert len(said) == 1
    assert words in said.pop()[1]


@given(st.randoms(use_true_random=False), st.integers(1, 30_000))
@settings(max_examples=60, deadline=None)
def test_noise_is_never_taken_for_somebody(rng, size):
    ear = Ear()
    ear.feed(rng.randbytes(size))
    assert ear.kind == "noise", ear.said


@given(st.binary(max_size=400), st.sampled_from(sorted(set(WHO) - {"silence"})))
@settings(max_examples=60, deadline=None)
def test_whatever_comes_is_said_in_plain_words(junk, who):
    ear = Ear()
    ear.feed(junk + WHO[who][0])
    assert all(c.isprintable() for c in ear.said)
    if who in ("board", "imu", "analogue"):
        assert ear.kind == "board"


class Wire:
    """What PortManager wants of a connection."""

    def __init__(self, client):
        self.write = client.sendall


class LineServer:
    """A serial line behind RFC 2217: what it carries is right at one baud only."""

    def __init__(self, baud, data):
        self._tty = serial.serial_for_url("loop://", 9600, timeout=0.01)
        self._server = socket.create_server(("127.0.0.1", 0))
        self._server.settimeout(0.1)
        self._baud, self._data, self._done = baud, data, threading.Event()
        self.url = f"rfc2217://127.0.0.1:{self._server.getsockname()[1]}"
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def _serve(self):
        while not self._done.is_set():
            with contextlib.suppress(TimeoutError):
                client, _ = self._server.accept()
                with contextlib.suppress(OSError):
                    self._carry(client)
                client.close()

    def _carry(self, client):
        client.settimeout(0.02)
        wire, rng = Wire(client), random.Random(2)
        manager = rfc2217.PortManager(self._tty, wire)
        while not self._done.is_set():
            with contextlib.suppress(TimeoutError):
                got = client.recv(1024)
                if not got:
                    return
                list(manager.filter(got))
            right = self._tty.baudrate == self._baud
            wire.write(b"".join(manager.escape(self._data if right else rng.randbytes(300))))

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._done.set()
        self._thread.join(10)
        self._server.close()


def test_the_baud_is_found():
    with LineServer(115200, frames(3)) as line:
        found = listen(line.url, seconds=1.0)
    assert (found.kind, found.baud) == ("board", 115200)
    assert list(found.tried) == [921600] and found.tried[921600] > 0


def test_a_line_that_is_sane_at_no_baud_says_which_were_tried():
    with LineServer(1, b"") as line:
        found = listen(line.url, seconds=0.5)
    assert found.kind == "noise"
    for baud in (921600, 115200, 9600, 4800):
        assert str(baud) in found.said


@pytest.fixture
def line(tmp_path):
    """A pseudo-terminal, and whom to put at its other end."""
    link, stop = PtyLink(tmp_path / "by-id" / "usb-board"), threading.Event()
    threads = []

    def speak(data):
        def work():
            while not stop.wait(0.02):
                if link.connected:
                    link.write(data)

        threads.append(threading.Thread(target=work))
        threads[-1].start()
        return str(tmp_path / "by-id" / "usb-board")

    yield speak
    stop.set()
    for thread in threads:
        thread.join(10)
    link.close()


def test_a_pty_has_no_bauds_to_try(line):
    port = line(b"\xfe\x81\x13" * 50)
    found = listen(port, seconds=0.5)
    assert found.kind == "noise" and list(found.tried) == [921600]


def test_a_silent_line_and_an_absent_one(line, tmp_path):
    assert "powered" in listen(line(b""), seconds=0.5).said
    absent = listen(str(tmp_path / "nowhere"), seconds=0.5)
    assert absent.kind == "closed" and "plug the board in" in absent.said


def test_ports_are_named_by_id(tmp_path):
    for name in ("usb-b", "usb-a"):
        (tmp_path / name).symlink_to("/dev/null")
    assert names(tmp_path) == [str(tmp_path / "usb-a"), str(tmp_path / "usb-b")]
    assert names(tmp_path / "absent") == []


def test_a_second_board_leaves_the_first_as_it_is():
    first = settings_with(Settings(), Answers("/dev/a", half_side_m=0.07))
    assert first.estimator.layout.half_side_m == 0.07
    name = free_name("cube", {d.name for d in first.gateway.devices})
    both = settings_with(first, Answers("/dev/b", name, layout="stars-12", half_side_m=0.1))
    assert [d.port for d in both.gateway.devices] == ["/dev/a", "/dev/b"]
    assert both.estimator.layout_of("cube").half_side_m == 0.07
    assert both.estimator.layout_of("cube-2").kind == "stars-12"
    again = settings_with(both, Answers("/dev/c", "cube-2", half_side_m=0.2))
    assert [d.port for d in again.gateway.devices] == ["/dev/a", "/dev/c"]
    assert again.estimator.layout_of("cube-2").half_side_m == 0.2


def test_every_old_file_is_kept(tmp_path):
    path = tmp_path / "gyrofree.toml"
    kept = []
    for text in ("# mine\n", "# mine too\n"):
        path.write_text(text)
        kept.append(write(path, Settings()))
    assert [k.read_text() for k in kept] == ["# mine\n", "# mine too\n"]
    assert load(path) == Settings()


def run(*arguments, cwd, stdin=""):
    return subprocess.run(
        [*PYTHON, "setup", *map(str, arguments)],
        cwd=cwd,
        input=stdin,
        capture_output=True,
        text=True,
        timeout=120,
    )


def test_unattended(line, tmp_path):
    port = line(frames(3))
    by_id = ["--ports-in", tmp_path / "by-id", "--seconds", 0.6]
    done = run(
        *by_id,
        "--half-side",
        0.06,
        "--pulses",
        100,
        "--user",
        "anna",
        "--password-file",
        "-",
        "--json",
        cwd=tmp_path,
        stdin="a long pass phrase\n",
    )
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert result["next"] == "gyrofree up" and result["device"]["port"] == port
    assert result["ports"][0]["axes"] == 12 and result["user"] == "anna"
    written = load(tmp_path / "gyrofree.toml")
    assert written.estimator.layout.half_side_m == 0.06
    assert written.gateway.devices[0].tacho_pulses_per_rev == 100
    assert "anna" in (tmp_path / "var/state/users.json").read_text()
    before = (tmp_path / "gyrofree.toml").read_text()
    refused = run(*by_id, "--yes", cwd=tmp_path)
    assert refused.returncode == 2 and "--force" in refused.stderr
    assert (tmp_path / "gyrofree.toml").read_text() == before
    again = run(*by_id, "--yes", "--force", "--pulses", 50, "--name", "cube", cwd=tmp_path)
    assert again.returncode == 0, again.stderr
    kept = load(tmp_path / "gyrofree.toml")
    assert kept.gateway.devices[0].tacho_pulses_per_rev == 50
    assert kept.estimator.layout.half_side_m == 0.06
    assert (tmp_path / "gyrofree.toml.1.bak").read_text() == before


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--yes"], "which port"),
        (["--yes", "--port", "/dev/x", "--layout", "ball"], "want one of cube"),
        (["--yes", "--port", "/dev/x", "--name", "A B"], "want a-z"),
        (["--yes", "--port", "/dev/x", "--user", "anna"], "--password-file"),
        (["--yes", "--port", "/dev/x", "--user", "a", "--password-file", "absent"], "absent"),
        (["--look"], "no serial port"),
    ],
)
def test_what_cannot_be_is_said_and_nothing_written(arguments, words, tmp_path):
    done = run("--ports-in", tmp_path / "none", "--no-listen", *arguments, cwd=tmp_path)
    assert done.returncode in (1, 2) and "Traceback" not in done.stderr
    assert words in done.stderr
    assert not (tmp_path / "gyrofree.toml").exists()


class Terminal:
    """A command in a terminal of its own."""

    def __init__(self, *arguments, cwd):
        child, self.fd = pty.fork()
        if not child:
            os.chdir(cwd)
            os.environ.update(TERM="dumb", COLUMNS="200")
            os.execv(sys.executable, [*PYTHON, *map(str, arguments)])
        self.child, self.text = child, ""

    def until(self, words, seconds=60):
        """Read until these words have come."""
        end = time.monotonic() + seconds
        while words not in self.text:
            assert time.monotonic() < end, self.text
            if select.select([self.fd], [], [], 0.2)[0]:
                try:
                    self.text += os.read(self.fd, 4096).decode(errors="replace")
                except OSError:
                    assert words in self.text, self.text
        self.text = self.text.split(words, 1)[1]

    def enter(self, text=""):
        os.write(self.fd, f"{text}\n".encode())

    def end(self):
        while True:
            try:
                if not os.read(self.fd, 4096):
                    break
            except OSError:
                break
        os.close(self.fd)
        return os.waitstatus_to_exitcode(os.waitpid(self.child, 0)[1])


def test_asked_in_a_terminal_of_the_simulated_board(tmp_path):
    """The board is `gyrofree simulate --link`; Enter takes what was heard."""
    board = subprocess.Popen(
        [*PYTHON, "simulate", "--link", str(tmp_path / "by-id" / "usb-cube")],
        cwd=tmp_path,
        stderr=subprocess.PIPE,
    )
    try:
        board.stderr.readline()
        terminal = Terminal("setup", "--ports-in", "by-id", "--seconds", 1.5, cwd=tmp_path)
        terminal.until("simulated cube, firmware")
        terminal.until("Port of the board")
        terminal.enter("7")
        terminal.until("no port 7")
        terminal.enter()
        terminal.until("Name of the board")
        terminal.enter("Table 1")
        terminal.until("want a-z")
        terminal.enter("table")
        terminal.until("Layout of its 12")
        terminal.enter()
        terminal.until("Half side")
        terminal.enter("six")
        terminal.until("'six': want a number from 0.001")
        terminal.enter("60")
        terminal.until("'60': want a number")
        terminal.enter("0,06")
        terminal.until("pulses in one turn")
        terminal.enter()
        terminal.until("receiver of its own")
        terminal.enter()
        terminal.until("First user")
        terminal.enter("anna")
        terminal.until("Password")
        terminal.enter("a long pass phrase")
        terminal.until("Once more")
        terminal.enter("a long pass phrase")
        terminal.until("gyrofree up")
        assert terminal.end() == 0
    finally:
        board.terminate()
        board.wait(20)
    made = load(tmp_path / "gyrofree.toml")
    assert made.gateway.devices[0].name == "table"
    assert made.estimator.layout.half_side_m == 0.06
    assert re.search("argon2", (tmp_path / "var/state/users.json").read_text())
    assert not list(Path(tmp_path).glob("*.bak"))
