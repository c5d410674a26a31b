"""A line that brings more than can be decoded: bounded, said, and no other line waits for it."""

import queue
import socket
import threading

import pytest
from support.waiting import until

from gateway.board.device import DeviceLink
from gateway.ports.backlog import MOST_BYTES, Backlog, Pace
from gateway.ports.keeper import Keeper
from gateway.ports.ports import READ_BYTES
from gateway.ports.reader import Chunk, Reader
from gateway.settings import DeviceSettings, GatewaySettings
from messages.history.journal_file import BOARD, GNSS


@pytest.fixture
def torrent():
    """The address of a server that sends one byte for ever, as fast as it is read."""
    server = socket.create_server(("127.0.0.1", 0))
    ended = threading.Event()

    def pour() -> None:
        client, _ = server.accept()
        client.settimeout(0.1)
        with client:
            while not ended.is_set():
                try:
                    client.send(b"U" * 65536)
                except TimeoutError:
                    continue
                except OSError:
                    return

    thread = threading.Thread(target=pour)
    thread.start()
    yield f"tcp://127.0.0.1:{server.getsockname()[1]}"
    ended.set()
    thread.join()
    server.close()


@pytest.fixture
def link(torrent, tmp_path):
    settings = GatewaySettings(journal=tmp_path, journal_bytes=1 << 20)
    link = DeviceLink(DeviceSettings(name="cube", port=torrent), settings)
    yield link
    link.journal.close()
    link.spool.close()


def test_what_waits_is_bounded_and_the_status_says_that_reading_waits(link):
    reader = Reader(
        link.device.port, 0, BOARD, link.journal, link.queue, Keeper(), time_scale=1000.0
    )
    try:
        assert until(lambda: reader.held > 3)
        assert MOST_BYTES <= link.queue.waiting(BOARD) <= MOST_BYTES + READ_BYTES
        assert not link.queue.full(GNSS)  # the receiver of the same board goes on
        status = link.report.message([reader], link.queue.qsize())
        assert status.refused["reads held back"] >= 3
        assert "more comes than can be taken" in status.message
        held, late = reader.held, False
        while not late:  # reading goes on, and says that what it brings has waited
            late = link.queue.get(timeout=10.0).late
        assert reader.held >= held and reader.connected
    finally:
        reader.close()


def test_a_line_ten_times_as_fast_as_any_board_is_read_at_the_pace_of_one(link):
    reader = Reader(link.device.port, 0, BOARD, link.journal, link.queue, Keeper())
    stop = threading.Event()

    def drain() -> None:
        while not stop.is_set():
            try:
                link.queue.get(timeout=0.1)
            except queue.Empty:
                continue

    thread = threading.Thread(target=drain)
    thread.start()
    try:
        assert until(lambda: reader.held > 0)
    finally:
        stop.set()
        thread.join()
        reader.close()


def test_a_backlog_counts_what_it_holds_by_channel():
    backlog: Backlog[Chunk] = Backlog(most_bytes=10)
    backlog.put(None)
    backlog.put(Chunk(BOARD, b"x" * 9, 1))
    assert not backlog.full(BOARD)
    backlog.put(Chunk(BOARD, b"x", 2))
    backlog.put(Chunk(GNSS, b"x", 3))
    assert backlog.full(BOARD) and not backlog.full(GNSS) and backlog.qsize() == 4
    assert backlog.get() is None
    assert [backlog.get().monotonic_ns for _ in range(3)] == [1, 2, 3]
    assert not backlog.full(BOARD) and backlog.waiting(BOARD) == backlog.waiting(GNSS) == 0
    with pytest.raises(queue.Empty):
        backlog.get(timeout=0.0)


def test_the_fastest_serial_line_never_waits_for_its_pace():
    pace = Pace(rate=400_000.0, burst=1000)
    assert pace.wait_s(1000) == 0.0
    assert pace.wait_s(400_000) == pytest.approx(1.0, abs=0.1)
