"""The whole gateway: virtual board -> pty -> gateway -> real Zenoh -> subscriber."""

import datetime
import fcntl
import os
import threading
import time
from collections import defaultdict
from itertools import accumulate
from pathlib import Path

import pytest
from support.waiting import until

from firmware_protocol.codec import FLAG_SIMULATED, Deframer, Frame, encode
from firmware_protocol.frames import Acc12
from gateway import service
from gateway.gnss.ubx import Epoch, ubx_bytes
from gateway.settings import DeviceSettings, GatewaySettings
from gateway.virtual.board_link import PtyLink, TcpLink
from gateway.virtual.satellites import of_sky
from gateway.virtual.virtual_board import (
    PLAYED,
    SIMULATED,
    BoardAccel,
    BoardBytes,
    BoardPulse,
    VirtualBoard,
)
from gyrofree.running.log_items import LOG_EPOCH_S
from messages.bus.session import BusSettings, open_client, open_router, subscribe
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import ACCEL, BOARD, GNSS, LINK, LOCATION, SKY, TACHO, history_key
from messages.history.answers import ask
from messages.history.journal_file import records, scan

PERIOD_S = 0.002  # 500 Hz with n = 1: also exercises joining


def samples(n: int, first: int = 0, period_s: float = PERIOD_S) -> list[BoardAccel]:
    return [
        BoardAccel(i * period_s, tuple((i * 7 + axis) % 400 - 200 for axis in range(12)))
        for i in range(first, first + n)
    ]


class Bench:
    """Router, gateway and a subscriber to everything; without a router until `start_router` where
    wanted so.
    """

    def __init__(self, folder: Path, router_port: int) -> None:
        endpoint = f"tcp/127.0.0.1:{router_port}"
        self.bus = BusSettings(router=endpoint, listen=[endpoint])
        self.folder = folder
        self.running: list[tuple[threading.Thread, threading.Event]] = []
        self.router = self.session = None

    def start_router(self) -> None:
        self.router = open_router(self.bus)
        self.session = open_client(self.bus, timeout_s=20)
        self.seen: dict[str, list] = defaultdict(list)
        self.subscribers = [
            subscribe(
                self.session,
                topic,
                self.bus.prefix,
                lambda _, message, name=topic.name: self.seen[name].append(message),
            )
            for topic in (ACCEL, TACHO, LINK, BOARD, GNSS, LOCATION, SKY)
        ]

    def gateway(
        self, port: str, journal: str = "journal", live: bool = True, **device
    ) -> threading.Event:
        """Start one and, when live, wait until it publishes: what it reads before is not sent."""
        settings = GatewaySettings(
            devices=[DeviceSettings(name="cube", port=port, **device)],
            journal=self.folder / journal,
            segment_bytes=1 << 16,
            sync_s=0.1,
        )
        stop = threading.Event()
        thread = threading.Thread(target=service.run, args=(settings, self.bus, stop))
        thread.start()
        self.running.append((thread, stop))
        if live:
            self.status(lambda s: s.port == port)
        return stop

    def status(self, condition) -> pb.LinkStatus:
        """The next link status that meets the condition."""
        return until(lambda: next((s for s in reversed(self.seen["link"]) if condition(s)), None))

    def close(self) -> None:
        for _, stop in self.running:
            stop.set()
        for thread, _ in self.running:
            thread.join(10)
        assert not any(thread.is_alive() for thread, _ in self.running)
        if self.session is not None:
            self.session.close()
        if self.router is not None:
            self.router.close()


@pytest.fixture
def dark_bench(tmp_path, free_port):
    """A bench with no router yet."""
    bench = Bench(tmp_path, free_port)
    yield bench
    bench.close()


@pytest.fixture
def bench(dark_bench):
    dark_bench.start_router()
    return dark_bench


def journalled(folder: Path) -> bytes:
    """What the board said, as the journal on the disk has it."""
    files = sorted(folder.glob("*.gfj"))
    return b"".join(
        record.data for file in files for _, _, record in scan(file.read_bytes()).records
    )


def frames(data: bytes) -> int:
    return sum(isinstance(event, Frame) for event in Deframer().feed(data))


def locked(folder: Path) -> bool:
    """True while somebody has the journal of this folder open."""
    with open(folder / "lock") as handle:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
    return False


def test_every_sample_arrives_in_order_and_the_ledger_balances(bench):
    link = PtyLink()
    bench.gateway(link.path)
    board = VirtualBoard(link, SIMULATED, epoch=3, sample_period_s=PERIOD_S)
    sent = samples(1000)
    board.run(sent, threading.Event(), wait_for_reader=True)
    got = until(
        lambda: (
            (m := list(bench.seen["accel"]))
            and sum(len(b.counts) for b in m) >= 12 * len(sent)
            and m
        )
    )

    assert [c for b in got for c in b.counts] == [c for s in sent for c in s.counts12]
    assert [b.header.sequence for b in got] == list(range(1, len(got) + 1))
    assert all(
        a.first_index + len(a.counts) // 12 == b.first_index
        for a, b in zip(got, got[1:], strict=False)
    )
    assert (
        all(len(b.counts) // 12 <= 5 for b in got) and len(got) < len(sent) / 3
    )  # joined, up to 10 ms
    first = got[0]
    assert (
        first.header.source == pb.SOURCE_SIMULATED
        and first.header.epoch == 3
        and first.lost_samples == 0
    )
    assert first.period_s == pytest.approx(PERIOD_S)
    assert first.f_mps2[0] == pytest.approx(first.counts[0] * 3.9e-3 * 9.80665)

    status = bench.status(lambda s: s.good_frames == board.built)
    assert status.connected and not status.message
    assert status.bytes_in == status.good_bytes + status.bad_bytes + status.pending_bytes
    assert (status.bad_chunks, status.lost_frames, status.lost_samples, status.reboots) == (
        0,
        0,
        0,
        0,
    )
    assert bench.seen["board"][0].firmware.endswith("virtual board")
    link.close()


def test_utc_of_samples_follows_the_host_clock(bench):
    link = TcpLink()
    bench.gateway(link.path)
    before = time.time_ns()
    VirtualBoard(link, SIMULATED, sample_period_s=0.01).run(
        samples(50, period_s=0.01), threading.Event(), wait_for_reader=True
    )
    got = until(lambda: len(bench.seen["accel"]) >= 50 and list(bench.seen["accel"]))
    times = [m.header.utc_ns for m in got]
    assert times == sorted(times) and before < times[0] < times[-1] < time.time_ns()
    assert 0.4e9 < times[-1] - times[0] < 0.6e9
    assert all(m.header.utc_sigma_s > 0 for m in got[1:])
    link.close()


def test_unplugged_port_reconnects_and_the_gap_is_counted(bench, tmp_path):
    name = tmp_path / "board"
    link = PtyLink(name)
    bench.gateway(str(name))
    board = VirtualBoard(link, SIMULATED, sample_period_s=PERIOD_S)
    board.run(samples(100), threading.Event(), wait_for_reader=True)
    bench.status(lambda s: s.good_frames >= 100)
    link.close()
    lost = bench.status(lambda s: not s.connected and s.message)
    assert "board" in lost.message

    board.link = link = PtyLink(
        name
    )  # the same boot of the board, plugged in again 20 samples later
    until(lambda: link.connected)
    board.run(samples(100, first=120), threading.Event())
    status = bench.status(lambda s: s.connected and s.lost_samples)
    assert status.lost_samples == 20 and status.reconnects == 1 and status.reboots == 0
    assert sum(m.lost_samples for m in bench.seen["accel"]) == 20
    link.close()


def test_garbage_is_counted_and_costs_no_frame(bench):
    link = TcpLink()
    bench.gateway(link.path)
    board = VirtualBoard(link, SIMULATED, sample_period_s=PERIOD_S)
    until(lambda: link.connected)
    noise = bytes(range(1, 256)) * 4
    link.write(noise)
    for i, item in enumerate(samples(50)):
        board.take(item)
        if i % 10 == 5:
            link.write(noise)
    board.finish()
    status = bench.status(lambda s: s.good_frames == board.built)
    assert (
        status.lost_frames == 0
        and status.bad_chunks >= 6
        and sum(status.damage.values()) == status.bad_chunks
    )
    assert status.bytes_in == status.good_bytes + status.bad_bytes + status.pending_bytes
    link.close()


def test_wrong_baud_says_so(bench):
    link = TcpLink()
    bench.gateway(link.path, baud=115200)
    until(lambda: link.connected)

    def noisy():
        link.write(os.urandom(400))
        return next((s for s in bench.seen["link"] if "speed is wrong" in s.message), None)

    status = until(noisy)
    assert "115200" in status.message and status.connected and status.good_frames == 0
    link.close()


def test_reboot_is_no_loss(bench):
    link = TcpLink()
    bench.gateway(link.path)
    for epoch in (7, 8):
        board = VirtualBoard(link, SIMULATED, epoch=epoch, sample_period_s=PERIOD_S)
        board.run(samples(100), threading.Event(), wait_for_reader=True)
    status = bench.status(lambda s: s.reboots)
    assert status.reboots == 1 and status.lost_frames == 0 and status.lost_samples == 0
    got = until(
        lambda: (
            sum(len(b.counts) for b in bench.seen["accel"]) >= 2400 and list(bench.seen["accel"])
        )
    )
    assert {m.header.epoch for m in got} == {7, 8} and [m.first_index for m in got].count(0) == 2
    link.close()


def test_tacho_rate_and_declared_standstill(bench):
    """One turn per second in reverse, then silence: the rate, then zero with a shrinking bound."""
    link = TcpLink()
    bench.gateway(link.path)
    pulses = [BoardPulse(k / 360, -1) for k in range(1, 360)]
    items = sorted([*samples(2000, period_s=0.001), *pulses], key=lambda item: item.t_s)
    VirtualBoard(link, SIMULATED, sample_period_s=0.001).run(
        items, threading.Event(), wait_for_reader=True
    )
    got = until(
        lambda: (
            [m for m in bench.seen["tacho"] if m.omega_radps == 0][5:] and list(bench.seen["tacho"])
        )
    )
    turning = [m for m in got if m.omega_radps]
    still = [m for m in got if not m.omega_radps]
    assert (
        all(abs(m.omega_radps + 6.283185) < 5 * m.sigma_radps + 1e-6 for m in turning)
        and len(turning) > 10
    )
    assert turning[-1].pulses == 359 and turning[-1].direction_known
    assert still[-1].sigma_radps < still[0].sigma_radps < 0.2
    link.close()


def test_second_gateway_with_the_same_name_is_refused_and_takes_over(bench, caplog):
    first, second = PtyLink(), PtyLink()
    stop = bench.gateway(first.path)
    until(lambda: first.connected)
    bench.gateway(second.path, journal="other", live=False)
    until(lambda: "another gateway serves this device name" in caplog.text)
    until(lambda: not second.connected and not locked(bench.folder / "other" / "cube"))
    stop.set()
    until(lambda: second.connected)
    bench.status(lambda s: s.port == second.path)
    assert locked(bench.folder / "other" / "cube")
    first.close()
    second.close()


def test_second_gateway_with_the_same_journal_is_refused_also_without_a_bus(dark_bench, caplog):
    bench, first, second = dark_bench, TcpLink(), TcpLink()
    stop = bench.gateway(first.path, live=False)
    until(lambda: first.connected)
    bench.gateway(second.path, live=False)
    until(lambda: "another gateway writes it; stop the other one" in caplog.text)
    assert not second.connected
    stop.set()
    until(lambda: second.connected)
    first.close()
    second.close()


def test_without_a_router_all_is_journalled_and_counted_and_not_published_later(dark_bench):
    bench, link = dark_bench, TcpLink()
    bench.gateway(link.path, live=False)
    board = VirtualBoard(link, SIMULATED, epoch=3, sample_period_s=PERIOD_S)
    board.run(samples(100), threading.Event(), wait_for_reader=True)
    until(lambda: frames(journalled(bench.folder / "journal" / "cube")) == board.built)
    early = board.built

    bench.start_router()
    status = bench.status(lambda s: s.good_frames == early)
    assert status.journal_sequence and status.lost_frames == 0 and not bench.seen["accel"]
    board.run(samples(100, first=100), threading.Event())
    got = until(
        lambda: (m := list(bench.seen["accel"])) and sum(len(b.counts) for b in m) >= 1200 and m
    )
    assert got[0].first_index == 100 and got[0].header.epoch == 3
    # what went before is not sent as if it were live, but is there for who asks
    asked = pb.HistoryQuery(
        topics=["accel"],
        of="accel",
        until_run=got[0].header.run,
        until_sequence=got[0].header.sequence,
    )
    reply = ask(bench.session, bench.bus.prefix, "cube", "gateway", asked)
    before = [pb.AccelBatch.FromString(item.payload) for item in reply.items]
    ends = list(
        accumulate(len(b.counts) // 12 for b in before)
    )  # how a busy machine cuts the batches is its own
    assert [b.first_index for b in before] == [0, *ends[:-1]] and ends[-1] == 100
    assert [b.header.sequence for b in before] == list(range(1, got[0].header.sequence))
    assert [c for b in got for c in b.counts] == [
        c for s in samples(100, first=100) for c in s.counts12
    ]
    assert sum(b.lost_samples for b in got) == 0
    status = bench.status(lambda s: s.good_frames == board.built)
    assert (
        status.lost_samples == 0
        and status.bytes_in == status.good_bytes + status.bad_bytes + status.pending_bytes
    )
    link.close()


@pytest.mark.parametrize(
    "flags, source", [(FLAG_SIMULATED, pb.SOURCE_SIMULATED), (0, pb.SOURCE_UNKNOWN)]
)
def test_before_hello_the_source_is_what_the_flag_says(bench, flags, source):
    link = TcpLink()
    bench.gateway(link.path)
    until(lambda: link.connected)
    for seq in range(5):
        counts = tuple(tuple(range(12)) for _ in range(10))
        frame = Acc12(seq * 10, 2_000_000, 0xF, 0, counts)
        link.write(encode(frame, epoch=1, seq=seq, t_us=seq * 20_000, flags=flags))
    got = until(lambda: len(bench.seen["accel"]) >= 5 and list(bench.seen["accel"]))
    assert {m.header.source for m in got} == {source} and not bench.seen["board"]
    # the board says what it is; the next boot, which has not said so yet, is not taken for the same
    # one
    board = VirtualBoard(link, PLAYED, epoch=2, sample_period_s=PERIOD_S)
    board.run(samples(10), threading.Event())
    until(
        lambda: any(
            m.header.epoch == 2 and m.header.source == pb.SOURCE_PLAYED for m in bench.seen["accel"]
        )
    )
    link.write(encode(Acc12(0, 2_000_000, 0xF, 0, counts), epoch=3, seq=0, t_us=0, flags=flags))
    again = until(lambda: [m for m in list(bench.seen["accel"]) if m.header.epoch == 3])
    assert again[0].header.source == source
    link.close()


def test_message_of_a_failed_sync_leaves_the_status_once_a_sync_succeeds(bench):
    """The first segment is /dev/null: it takes writes, and fdatasync on it fails."""
    link = TcpLink()
    bench.gateway(link.path)
    until(
        lambda: link.connected
    )  # the journal is open, its first segment comes with the first read
    (bench.folder / "journal" / "cube" / f"{1:020d}.gfj").symlink_to("/dev/null")
    link.write(bytes(range(1, 256)))
    failed = bench.status(lambda s: "NOT SAFE" in s.message)
    assert failed.durable_sequence == 0

    def cleared():
        link.write(bytes(range(1, 256)) * 16)  # on into the next segment, a real one
        last = bench.seen["link"][-1]
        return last.durable_sequence and "NOT SAFE" not in last.message

    until(cleared)
    link.close()


def test_unwritable_journal_is_said_and_data_go_on(bench):
    (bench.folder / "journal").write_text("a file where a folder is wanted")
    link = TcpLink()
    bench.gateway(link.path)
    VirtualBoard(link, SIMULATED, sample_period_s=PERIOD_S).run(
        samples(50), threading.Event(), wait_for_reader=True
    )
    status = bench.status(lambda s: s.good_frames >= 50)
    assert "NOT KEPT" in status.message and status.journal_sequence == 0
    until(lambda: sum(len(b.counts) for b in bench.seen["accel"]) == 600)
    link.close()


def test_history_answers_the_very_records(bench):
    link = TcpLink()
    bench.gateway(link.path)
    VirtualBoard(link, SIMULATED, sample_period_s=PERIOD_S).run(
        samples(100), threading.Event(), wait_for_reader=True
    )
    status = bench.status(
        lambda s: s.good_frames >= 100 and s.durable_sequence == s.journal_sequence
    )
    key = history_key(bench.bus.prefix, "cube")
    replies = list(bench.session.get(f"{key}?first=2;last={status.journal_sequence}"))
    got = list(records(replies[0].ok.payload.to_bytes()))
    assert [r.sequence for r in got] == list(range(2, status.journal_sequence + 1))
    files = sorted((bench.folder / "journal" / "cube").glob("*.gfj"))
    kept = [r for f in files for _, _, r in scan(f.read_bytes()).records]
    assert got == kept[1 : status.journal_sequence]
    refused = list(bench.session.get(f"{key}?first=x"))
    assert refused[0].err is not None
    link.close()


NOON, PLACE = datetime.datetime(2024, 1, 1, 12, tzinfo=datetime.UTC), (40.1, -105.1, 1600.0)


def epoch_bytes(t_s: float) -> bytes:
    return ubx_bytes(
        Epoch(
            LOG_EPOCH_S,
            t_s,
            40.0966268,
            -105.1474483,
            1601.474,
            1,
            (0.01, 0.01, 0.02),
            (3.0, 4.0, 0.5),
        )
    )


def test_gnss_in_frames_of_the_board(bench):
    """Without delay the time of fix on the board's clock is exact; the location repeats the
    position.
    """
    link = TcpLink()
    bench.gateway(link.path)
    items = sorted(
        [
            *samples(200, period_s=0.01),
            *(BoardBytes(k / 4, epoch_bytes(k / 4) + of_sky(NOON, PLACE)) for k in range(1, 8)),
        ],
        key=lambda item: item.t_s,
    )
    VirtualBoard(link, SIMULATED, sample_period_s=0.01).run(
        items, threading.Event(), wait_for_reader=True
    )
    got = until(lambda: len(bench.seen["gnss"]) >= 6 and list(bench.seen["gnss"]))
    for k, fix in enumerate(got, start=1):
        assert fix.fix_utc_ns == LOG_EPOCH_S * 10**9 + k * 250_000_000
        assert fix.device_time_s == pytest.approx(k / 4, abs=1e-5)
        assert fix.header.device_us == pytest.approx(k * 250_000, abs=2)
        assert fix.quality == pb.GnssFix.QUALITY_RTK_FIXED and list(fix.v_n_mps) == pytest.approx(
            [3.0, 4.0, 0.5]
        )
    place = bench.seen["location"][0]
    assert (place.latitude, place.longitude, place.altitude) == (
        got[0].latitude_deg,
        got[0].longitude_deg,
        got[0].height_m,
    )
    skies = bench.seen["sky"]  # told four times a second, published once
    assert 1 <= len(skies) <= 2 and skies[0].header.sequence == 1 and len(skies[0].satellites) > 9
    link.close()


def test_gnss_on_its_own_port(bench):
    link, receiver = TcpLink(), TcpLink()
    bench.gateway(link.path, gnss_port=receiver.path)
    until(lambda: receiver.connected)
    stop = threading.Event()
    board = VirtualBoard(link, SIMULATED, sample_period_s=0.01)
    running = threading.Thread(
        target=board.run, args=(samples(100_000, period_s=0.01), stop, 1.0, True)
    )
    running.start()
    until(lambda: bench.seen["accel"])
    for k in range(1, 5):
        receiver.write(epoch_bytes(float(k)))
        receiver.write(b"$GPGGA,damaged*00\r\n")
    got = until(lambda: len(bench.seen["gnss"]) >= 3 and list(bench.seen["gnss"]))
    assert got[0].header.device_us > 0 and abs(got[0].header.utc_ns - time.time_ns()) < 30e9
    assert bench.status(lambda s: s.gnss_bad == 4).gnss_good == 8
    stop.set()
    running.join(10)
    link.close()
    receiver.close()
