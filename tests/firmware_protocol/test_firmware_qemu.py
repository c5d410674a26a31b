"""The second opinion: core, drivers and board on QEMU's Cortex-M3 (mps2-an385) with its interrupts,
PL022 and counter.

Time is QEMU's instruction count and jumps over sleep; the frames come over a socket.
"""

import os
import shutil
import socket
import struct
import subprocess
from collections.abc import Iterator

import pytest
from support.firmware_support import COMMANDS, FIRMWARE

from firmware_protocol.codec import FLAG_SIMULATED, Damaged, Deframer, Frame, encode
from firmware_protocol.frames import Acc12, Ack, Command, Hello, Status
from firmware_protocol.ledger import Ledger

pytestmark = pytest.mark.skipif(
    not (shutil.which("qemu-system-arm") and shutil.which("arm-none-eabi-gcc"))
    and not os.environ.get("CI"),
    reason="no qemu-system-arm or arm-none-eabi-gcc: run make system-packages",
)


class Board:
    """A running QEMU, its frames, and the ledger over them."""

    def __init__(self, line: socket.socket) -> None:
        self.line, self.deframer, self.ledger, self.pending = line, Deframer(), Ledger(), []

    def frame(self) -> Frame:
        while not self.pending:
            data = self.line.recv(65536)
            assert data, "QEMU closed the line"
            self.ledger.received(len(data))
            self.pending = self.deframer.feed(data)
            for event in self.pending:
                assert not isinstance(event, Damaged), event
                self.ledger.count(event)
        return self.pending.pop(0)

    def frames(self, kind: type, n: int = 1) -> list[Frame]:
        """The next n of a kind; what comes in between is only counted."""
        found = []
        while len(found) < n:
            frame = self.frame()
            if frame.type == kind.TYPE:
                found.append(frame)
        return found

    def command(self, name: str, value: int | None = None) -> Ack:
        data = b"" if value is None else struct.pack("<I", value)
        self.line.sendall(encode(Command(COMMANDS[name], 9, data), epoch=0, seq=0, t_us=0))
        [frame] = self.frames(Ack)
        assert (frame.payload.command, frame.payload.token) == (COMMANDS[name], 9)
        return frame.payload


@pytest.fixture(scope="module")
def image(tmp_path_factory):
    out = tmp_path_factory.mktemp("mps2")
    subprocess.run(
        ["make", "-C", str(FIRMWARE / "port" / "mps2"), f"OUT={out}"],
        check=True,
        timeout=120,
        capture_output=True,
    )
    return out / "gyrofree-mps2.elf"


@pytest.fixture
def board(image, tmp_path) -> Iterator[Board]:
    path = tmp_path / "line"
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(path))
        server.listen()
        server.settimeout(60)
        qemu = subprocess.Popen(
            [
                "qemu-system-arm",
                "-M",
                "mps2-an385",
                "-kernel",
                str(image),
                "-display",
                "none",
                "-monitor",
                "none",
                "-icount",
                "shift=5,sleep=off",
                "-serial",
                f"unix:{path}",
            ],
            stderr=subprocess.DEVNULL,
        )
        try:
            line, _ = server.accept()
            line.settimeout(60)
            with line:
                yield Board(line)
        finally:
            qemu.kill()
            qemu.wait(timeout=30)


def test_it_samples_on_the_grid_and_counts_truly(board):
    first = board.frame()
    hello = first.payload
    assert isinstance(hello, Hello) and first.seq == 0 and first.flags == FLAG_SIMULATED
    assert (hello.sensor_mask, hello.tick_hz, hello.sample_period_ns) == (
        15,
        25_000_000,
        10_000_000,
    )
    samples = board.frames(Acc12, 500)
    # This port takes the time in its handler, not at the timer's match, and QEMU on a busy machine
    # can be late with it.
    late_us = [f.t_us - 10_000 * f.payload.first_index for f in samples]
    on_time = [late for late in late_us if late - min(late_us) <= 50]
    assert len(on_time) > len(late_us) // 2 and max(late_us) - min(late_us) < 10_000
    for frame in samples:  # each sample was read once, through the PL022, and none was mixed up
        [row] = frame.payload.counts
        assert row == tuple(
            v for i in range(4) for v in (frame.payload.first_index % 1000, -1 - i, 256)
        )
    [status] = board.frames(Status)
    s = status.payload
    assert s.built == s.sent + s.dropped == status.seq and s.sample_drops == s.missed_ticks == 0
    assert sum(s.spi_errors) + sum(s.init_errors) == 0 and 0 < s.cpu_permille < 500
    balanced(board, s)


def balanced(board: Board, status: Status) -> None:
    """QEMU's time goes on while a busy machine does not read the line: the board may drop, but it
    says so.
    """
    assert (
        board.ledger.lost_frames == board.ledger.device_dropped == status.dropped
        and board.ledger.link_lost == 0
    )


def test_commands_over_the_socket(board):
    board.frames(Acc12, 20)
    assert board.command("rate_hz", 1000).status == 0
    [hello] = board.frames(Hello)
    assert (hello.payload.sample_period_ns, hello.payload.batch) == (1_000_000, 8)
    samples = board.frames(Acc12, 50)
    assert all(len(f.payload.counts) == 8 for f in samples)
    assert board.command("rate_hz", 333).status == -3
    received, built = struct.unpack("<QQ", board.command("time").echo)
    assert samples[-1].t_us < received <= built
    assert board.command("stop").status == 0
    [status] = board.frames(Status)
    assert status.payload.samples >= samples[-1].payload.first_index + 8
    balanced(board, status.payload)
    assert board.command("start").status == 0 and board.frames(Acc12)


def test_a_reboot_starts_anew(board):
    board.frames(Acc12, 50)
    assert board.command("reboot").status == 0
    seqs = []
    while 0 not in seqs:  # one that was due anyway may come before
        seqs += [frame.seq for frame in board.frames(Hello)]
    assert len(seqs) <= 3 and board.ledger.reboots == 1
