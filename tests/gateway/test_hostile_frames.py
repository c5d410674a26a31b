"""Whole frames with absurd values: refused by name and counted, and the board goes on."""

import random
import threading
import time
from types import SimpleNamespace

import pytest
from support.waiting import until

from firmware_protocol.codec import encode
from firmware_protocol.frames import Acc12, Adc, Hello, Imu6, SensorInfo, Tacho
from gateway import service
from gateway.board.device import DeviceLink
from gateway.ports.reader import Chunk
from gateway.settings import DeviceSettings, GatewaySettings
from gateway.virtual.board_link import PtyLink
from messages.contract.checks import check
from messages.contract.topics import ACCEL, LINK, TACHO
from messages.history.journal_file import BOARD
from tests.gateway.test_service import bench, dark_bench  # noqa: F401
from tests.support import hostile_frames
from tests.support.hostile_frames import good

ROW = tuple(range(12))


class Board:
    """A board's link without its ports: what is written goes the way of a read."""

    def __init__(self, folder):
        settings = GatewaySettings(journal=folder)
        self.link = DeviceLink(DeviceSettings(name="cube", port="file:///none"), settings)
        self.link.readers = [
            SimpleNamespace(
                connected=True, message="", reconnects=0, held=0, held_at=None, silent_s=0.0
            )
        ]
        self.out = []
        self.link.out.direct(lambda topic, device, message: self.out.append((topic, message)))
        self._at_ns = time.monotonic_ns()

    def write(self, data: bytes, after_s: float = 0.02) -> None:
        self._at_ns += int(after_s * 1e9)
        self.link.take(Chunk(BOARD, data, self._at_ns))

    def status(self):
        self.link._each_second()
        return next(message for topic, message in reversed(self.out) if topic is LINK)

    def batches(self):
        return [message for topic, message in self.out if topic is ACCEL]

    def close(self):
        self.link.journal.close()
        self.link.spool.close()


@pytest.fixture
def board(tmp_path):
    board = Board(tmp_path)
    yield board
    board.close()


def frame(payload, seq, t_us=1_000_000_000, epoch=5) -> bytes:
    return encode(payload, epoch=epoch, seq=seq, t_us=t_us)


def test_good_frames_alone_are_all_taken(board):
    for k in range(50):
        board.write(good(k, k))
    status = board.status()
    assert [m.first_index for m in board.batches()] == [2 * k for k in range(50)]
    assert not status.refused and status.message == "" and status.good_frames == 50
    assert status.bytes_in == status.good_bytes + status.bad_bytes + status.pending_bytes


@pytest.mark.parametrize(
    ("payload", "t_us", "kind"),
    [
        (Acc12(2**32 - 1, 10_000_000, 0xF, 0, (ROW,)), 1_000_200_000, "index"),
        (Acc12(2**30, 10_000_000, 0xF, 0, (ROW,)), 1_000_200_000, "index"),
        (Acc12(20, 0, 0xF, 0, (ROW,)), 1_000_200_000, "period"),
        (Acc12(20, 10_000_000, 0xF, 0, (ROW,)), 2**55, "stray"),
        (Acc12(20, 10_000_000, 0xF, 0, (ROW,)), 2**64 - 1, "stray"),
        (Imu6(0, 0, 1, 1, ((0,) * 6,)), 1_000_200_000, "period"),
        (Imu6(0, 10**7, 2**32 - 1, 1, ((0,) * 6,)), 1_000_200_000, "scale"),
        (Imu6(0, 10**7, 1, 2**32 - 1, ((0,) * 6,)), 1_000_200_000, "scale"),
        (Adc(0, 10**7, 0, 3300, ((), ())), 1_000_200_000, "inputs"),
        (Adc(0, 10**7, 1, 0, ((5,),)), 1_000_200_000, "scale"),
        (Adc(0, 0, 1, 3300, ((5,),)), 1_000_200_000, "period"),
        (Tacho(0, 1, (500, 400)), 1_000_200_000, "pulses"),
        (Tacho(0, 1, (2**32 - 1,)), 1_000_200_000, "pulses"),
        (
            Hello(1, 0, 15, 12, 10**6, 10**7, 2, sensors=(SensorInfo(scale_ng=2**32 - 1),) * 4),
            1_000_200_000,
            "scale",
        ),
        (Hello(1, 0, 15, 12, 10**6, 5, 2), 1_000_200_000, "period"),
    ],
)
def test_one_absurd_value_is_refused_by_name_and_costs_itself(board, caplog, payload, t_us, kind):
    for k in range(10):
        board.write(good(k, k))
    board.write(frame(payload, 10, t_us))
    for k in range(10, 30):
        board.write(good(k, k + 1))
    status = board.status()
    assert [m.first_index for m in board.batches()] == [2 * k for k in range(30)]
    assert status.refused == {kind: 1} and status.reboots == 0 and status.lost_samples == 0
    assert f"({kind} 1)" in status.message and "refused" in caplog.text and "want" in caplog.text
    assert status.bytes_in == status.good_bytes + status.bad_bytes + status.pending_bytes
    times = [m.header.utc_ns for m in board.batches()]
    steps = [b - a for a, b in zip(times, times[1:], strict=False)]
    assert max(abs(step - 20_000_000) for step in steps) < 1_000_000


def test_a_board_that_counts_from_another_index_is_believed_when_it_says_so_twice(board):
    for k in range(10):
        board.write(good(k, k))
    for k in range(4):
        index = (5_000_000 + 2 * k) % 2**32
        payload = Acc12(index, 10_000_000, 0xF, 0, (ROW, ROW))
        board.write(frame(payload, 10 + k, 1_000_200_000 + 20_000 * k))
    assert [m.first_index for m in board.batches()][10:] == [5_000_002, 5_000_004, 5_000_006]


@pytest.mark.parametrize("epoch", [5, 6])
def test_a_line_that_begins_anew_elsewhere_loses_nothing(board, epoch):
    """A log with a hole of a day that is played at once; another boot, heard from its middle."""
    for k in range(10):
        board.write(good(k, k))
    for k in range(5):
        payload = Acc12(9_000_000 + 2 * k, 10_000_000, 0xF, 0, (ROW, ROW))
        board.write(frame(payload, 4_000_000 + k, 90_000_000_000 + 20_000 * k, epoch))
    found = board.batches()[10:]
    assert [m.first_index for m in found] == [9_000_000 + 2 * k for k in range(5)]
    assert not board.status().refused


def test_pulses_that_make_no_rate_are_not_sent(board):
    board.write(good(0, 0))
    board.write(frame(Tacho(0, 1, tuple(range(100))), 1, 1_000_000_500))
    for k in range(10, 14):
        board.write(good(k, k))
    rates = [message for topic, message in board.out if topic is TACHO]
    assert all(abs(message.omega_radps) <= 1e4 for message in rates)
    assert board.status().refused == {"unsent": 1}


@pytest.mark.parametrize("seed", range(4))
def test_any_frames_between_those_of_a_good_board(board, seed):
    sent = 0
    for data, mine in hostile_frames.mixed(seed, 3000):
        board.write(data)
        sent += mine
    status = board.status()
    indices = [m.first_index for m in board.batches() if m.axes == 12]
    assert sorted(set(range(0, 2 * sent, 2)) - set(indices)) == []
    assert "failure" not in status.refused and status.refused["stray"] > 300
    assert status.bytes_in == status.good_bytes + status.bad_bytes + status.pending_bytes
    assert all(check(message) == [] for _, message in board.out)


@pytest.mark.parametrize("seed", range(3))
def test_any_frames_at_all(board, seed):
    rng = random.Random(seed)
    for _ in range(3000):
        board.write(hostile_frames.anything(rng), rng.choice((0.0, 0.001, 1.0)))
        if rng.random() < 0.02:
            board.status()
    status = board.status()
    assert "failure" not in status.refused and len(status.refused) < 12
    assert all(check(message) == [] for _, message in board.out)


@pytest.mark.parametrize("seed", range(3))
def test_any_values_in_frames_that_go_on_from_each_other(board, seed):
    rng = random.Random(seed)
    for data in hostile_frames.story(seed, 3000):
        board.write(data, rng.choice((0.0, 0.0, 0.01, 1.0)))
        if rng.random() < 0.05:
            board.status()
    status = board.status()
    assert "failure" not in status.refused and len(status.refused) < 12
    assert {topic.name for topic, _ in board.out} >= {"accel", "adc", "board"}
    assert all(check(message) == [] for _, message in board.out)


def test_a_board_whose_thread_fails_begins_anew_and_the_other_notices_nothing(
    bench,  # noqa: F811
    monkeypatch,
):
    links = {name: PtyLink() for name in ("one", "two")}
    settings = GatewaySettings(
        devices=[DeviceSettings(name=name, port=link.path) for name, link in links.items()],
        journal=bench.folder / "journal",
    )
    sound, failed = DeviceLink._loop, threading.Event()

    def loop(link, turns, stop):
        if link.name == "one" and not failed.is_set():
            failed.set()
            raise RuntimeError("a fault")
        sound(link, turns, stop)

    monkeypatch.setattr(DeviceLink, "_loop", loop)
    stop = threading.Event()
    thread = threading.Thread(target=service.run, args=(settings, bench.bus, stop))
    thread.start()
    bench.running.append((thread, stop))
    for name in links:
        bench.status(lambda s, name=name: s.header.device == name and s.connected)
    assert failed.is_set() and thread.is_alive()
    for k in range(200):
        for link in links.values():
            link.write(good(k, k))
        if {m.header.device for m in list(bench.seen["accel"])} == set(links):
            break
        time.sleep(0.02)
    assert until(lambda: {m.header.device for m in list(bench.seen["accel"])} == set(links))
    stop.set()
    thread.join(20)
    for link in links.values():
        link.close()
