"""A gateway that was killed at any byte goes on with the next sample, and publishes none twice."""

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from firmware_protocol.codec import encode
from firmware_protocol.frames import Acc12, Gps, Tacho
from gateway.board.device import DeviceLink
from gateway.board.resume import Past, unseen
from gateway.ports.keeper import Keeper, Left
from gateway.ports.reader import Chunk, Reader
from gateway.settings import DeviceSettings, GatewaySettings
from gateway.virtual.board_link import PtyLink
from messages.bus.session import Publishers
from messages.contract.topics import BY_NAME
from messages.history.journal_file import BOARD, Record, last_whole, pack
from messages.history.spool_file import entry_of

NMEA = b"$GNGGA,120000.%02d,4717.1,N,00833.9,E,4,12,0.8,408.0,M,47.0,M,,*"
PAST_S = 4.0  # so long ago the first byte came


def sentence(k: int) -> bytes:
    body = (NMEA % (k % 100))[:-1]
    checksum = 0
    for byte in body[1:]:
        checksum ^= byte
    return body + b"*%02X\r\n" % checksum


def stream(n: int, period_us: int) -> bytes:
    """n samples, every 25 of them pulses of the tachometer, every 100 a GPS sentence, as a board
    sends them.
    """
    out, seq = b"", 0
    for k in range(n):
        t_us = k * period_us
        frames = [
            (
                Acc12(k, period_us * 1000, 0xF, 0, (tuple(k % 300 + axis for axis in range(12)),)),
                t_us,
            )
        ]
        if k % 25 == 0:
            frames.append((Tacho(k // 25, 1, (0,)), t_us))
        if k % 100 == 50:
            frames.append((Gps(sentence(k // 100)), t_us))
        for frame, at in frames:
            out += encode(frame, epoch=1, seq=seq, t_us=at)
            seq += 1
    return out


class Life:
    """One life of a gateway, without ports: read, journalled, and some of it decoded and
    published.
    """

    def __init__(self, folder: Path) -> None:
        device = DeviceSettings(name="cube", port="file:///dev/null")
        self.link = DeviceLink(device, GatewaySettings(journal=folder, devices=[device]))
        self.put = Publishers(None, "p", self.link.spool).put
        self.link.out.direct(self.put)

    def read(self, data: bytes, at_ns: int, decode: bool = True) -> None:
        self.link.journal.append(BOARD, data, at_ns, time.time_ns() - time.monotonic_ns() + at_ns)
        if decode:
            self.link.take(Chunk(BOARD, data, at_ns))

    def die(self) -> None:
        """The locks go as with the process; nothing that is held back is sent."""
        self.link.journal.close()
        self.link.spool.close()

    def published(self) -> list:
        entries = [entry_of(record) for record in self.link.spool.journal.tail(1 << 24)]
        return [
            (entry.topic, BY_NAME[entry.topic].type.FromString(entry.payload)) for entry in entries
        ]


class Held(Keeper):
    """Has one port, a pipe that nothing comes from."""

    def __init__(self) -> None:
        self.out, self.into = os.pipe()

    def take(self, url: str) -> Left | None:
        return Left(self.out, [])

    def holds(self, url: str) -> bool:
        return True


def again(folder) -> Life:
    """The next life: the port stands open, what the last one had read is in the journal."""
    life, held = Life(folder), Held()
    link = life.link
    link.readers = [Reader(link.device.port, 0, BOARD, link.journal, link.queue, held)]
    past = Past(link.spool, life.put)
    link.resume(past, unseen(past, link.journal))
    link.out.direct(life.put)
    link.readers.pop().close()
    os.close(held.into)
    return life


@pytest.mark.parametrize(("period_us", "seed"), [(10_000, 1), (1_000, 2), (1_000, 3)])
def test_at_whatever_byte_it_was_killed_each_sample_is_published_once(tmp_path, period_us, seed):
    chance = random.Random(seed)
    wire = stream(round(PAST_S * 1e6 / period_us), period_us)
    begun, byte_ns = time.monotonic_ns() - int(PAST_S * 1e9), PAST_S * 1e9 / len(wire)
    at, life = 0, Life(tmp_path)
    deaths = sorted(chance.sample(range(len(wire) // 3, len(wire)), 4))
    while at < len(wire):
        n = chance.randint(1, 120)
        dying = bool(deaths) and at >= deaths[0]
        # the last reads before a death are in the journal, and not decoded yet
        life.read(
            wire[at : at + n],
            begun + int(byte_ns * (at + n)),
            decode=not (deaths and at + 400 >= deaths[0]),
        )
        at += n
        if dying:
            deaths.pop(0)
            life.die()
            life = again(tmp_path)
    life.link.samples.flush()
    said = life.published()
    samples = [
        i
        for name, m in said
        if name == "accel"
        for i in range(m.first_index, m.first_index + len(m.counts) // 12)
    ]
    assert samples == list(range(round(PAST_S * 1e6 / period_us)))
    fixes = [m.header.device_us for name, m in said if name == "gnss"]
    assert len(fixes) == len(set(fixes)) == wire.count(b"GNGGA")
    assert sum(name == "location" for name, _ in said) == len(fixes)
    tacho = [m.header.device_us for name, m in said if name == "tacho"]
    assert tacho == sorted(set(tacho)) and len(tacho) > 15
    assert (
        life.link.decoder.ledger.lost_samples
        == life.link.decoder.ledger.lost_frames
        == life.link.decoder.ledger.bad_chunks
        == 0
    )
    assert life.link.decoder.ledger.unaccounted(life.link.decoder.pending) == 0
    life.die()


def test_the_end_of_a_segment_says_its_last_record_unless_it_is_torn():
    whole = b"".join(pack(Record(k, 1, 2, BOARD, b"GFJ1" * k)) for k in (5, 6, 7))
    assert last_whole(whole) == last_whole(whole[50:]) == 7
    assert last_whole(whole[:-1]) is None
    assert last_whole(whole + b"GFJ1") is None
    assert last_whole(b"") is None


GUARDED = """
import os, select, sys
sys.path.insert(0, {root!r})
from gateway.ports.ports import adopt_port, open_port
from gyrofree.running.guardian import guard
from gyrofree.running.process import stop_on_signals
def serve(keeper):
    left = keeper.take({path!r})
    port = open_port({path!r}) if left is None else adopt_port({path!r}, left.fd)
    keeper.keep({path!r}, port.fileno())
    print("opened" if left is None else "inherited", os.getpid(), flush=True)
    for data, _ in () if left is None else left.read:
        print("read", data.decode(), flush=True)
    while True:
        select.select([port.fileno()], [], [])
        data = port.read()
        if data.endswith(b"drop"):
            keeper.drop({path!r})
        print("read", data.decode(), flush=True)
guard(serve)
"""


def test_a_killed_child_leaves_its_port_open_and_the_next_one_reads_what_came_meanwhile():
    link = PtyLink()
    script = GUARDED.format(root=str(Path(__file__).resolve().parents[2]), path=link.path)
    guardian = subprocess.Popen(
        [sys.executable, "-c", script], stdout=subprocess.PIPE, text=True, bufsize=1
    )
    try:
        word, child = guardian.stdout.readline().split()
        assert word == "opened"
        os.kill(int(child), signal.SIGKILL)
        for _ in range(50):
            assert link.connected  # nobody ever sees it closed
            assert link.write(b"kept,")
            time.sleep(0.01)
        word, child = guardian.stdout.readline().split()
        assert word == "inherited"
        text = ""
        while text.count("kept") < 50:
            text += guardian.stdout.readline().split()[1]
        assert text == "kept," * 50
        link.write(b"drop")
        assert guardian.stdout.readline() == "read drop\n"
        os.kill(int(child), signal.SIGKILL)
        assert guardian.stdout.readline().startswith("opened")
    finally:
        guardian.kill()
        guardian.wait()
        link.close()


SLEEPING = """
import signal, sys, threading
import typer
sys.path.insert(0, {root!r})
from gyrofree.running.guardian import guard
from gyrofree.running.process import stop_on_signals
def serve(keeper):
    stop = stop_on_signals()
    print("serving", flush=True)
    stop.wait()
def elsewhere():
    sys.stdin.readline()
    # poll() in the main thread is not interrupted by it
    signal.pthread_kill(threading.get_ident(), signal.SIGTERM)
threading.Thread(target=elsewhere, daemon=True).start()
try:
    guard(serve)
except typer.Exit as end:
    sys.exit(end.exit_code)
"""


def test_a_signal_that_does_not_interrupt_the_guardians_sleep_reaches_the_child():
    script = SLEEPING.format(root=str(Path(__file__).resolve().parents[2]))
    guardian = subprocess.Popen(
        [sys.executable, "-c", script],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        bufsize=1,
    )
    try:
        assert guardian.stdout.readline() == "serving\n"
        guardian.stdin.write("now\n")
        assert guardian.wait(20) == 0
    finally:
        guardian.kill()
        guardian.wait()
