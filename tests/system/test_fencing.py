"""A gateway and an estimator that are stopped, replaced, and go on: real processes over a real
router, and each message once in the recording.
"""

import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from support.stack import free_port

from gateway.virtual.virtual_board import SIMULATED, BoardAccel, VirtualBoard
from messages.bus.session import BusSettings, open_client, open_router
from messages.contract.topics import ACCEL, RATE, parse
from sessions.recording import service as recorder
from sessions.recording.manifest import read_manifest
from sessions.recording.mcap_log import read
from sessions.recording.settings import RecorderSettings

LEASE_MS = 4000  # a process that gets no processor for so long is taken for a stopped one
GATEWAY = """
import sys
from pathlib import Path
from gateway import service
from gateway.settings import DeviceSettings, GatewaySettings
from gyrofree.running.process import stop_on_signals
from messages.bus.session import BusSettings
import logging
logging.basicConfig(level="INFO", stream=sys.stderr)
stop = stop_on_signals()
device = DeviceSettings(name="cube", port=sys.argv[2])
bus = BusSettings(prefix="t", router=sys.argv[3], lease_ms=int(sys.argv[4]))
service.run(GatewaySettings(journal=Path(sys.argv[1]), devices=[device]), bus, stop)
"""
ESTIMATOR = """
import sys
from pathlib import Path
from estimator import service
from estimator.settings import EstimatorSettings
from gyrofree.running.process import stop_on_signals
from messages.bus.session import BusSettings
import logging
logging.basicConfig(level="INFO", stream=sys.stderr)
stop = stop_on_signals()
bus = BusSettings(prefix="t", router=sys.argv[2], lease_ms=int(sys.argv[3]))
settings = EstimatorSettings(rate=["least-squares"], journal=Path(sys.argv[1]))
service.run(settings, bus, stop)
"""


class Board:
    """A board on a FIFO-like pseudo-terminal that never waits for its reader."""

    def __init__(self) -> None:
        import os
        import pty
        import tty

        self._fd, slave = pty.openpty()
        tty.setraw(slave)
        os.set_blocking(self._fd, False)
        self.path, self._slave, self._os = os.ttyname(slave), slave, os
        self._stop = threading.Event()
        self.connected = True
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def write(self, data: bytes) -> bool:
        try:
            return self._os.write(self._fd, data) == len(data)
        except BlockingIOError:
            return False

    def read(self) -> bytes:
        return b""

    def _run(self) -> None:
        board = VirtualBoard(self, SIMULATED, epoch=7, sample_period_s=0.01, batch=1)
        began, k = time.monotonic(), 0
        while not self._stop.wait(max(0.0, began + 0.01 * k - time.monotonic())):
            board.take(BoardAccel(0.01 * k, (k % 50, 0, 256) * 4))
            k += 1

    def close(self) -> None:
        self._stop.set()
        self._thread.join()
        self._os.close(self._fd)
        self._os.close(self._slave)


def start(program: str, log: Path, *arguments: object) -> subprocess.Popen:
    with log.open("ab") as stream:
        return subprocess.Popen(
            [sys.executable, "-c", program, *map(str, arguments)], stderr=stream, stdout=stream
        )


class Bench:
    """Router and recorder in this process, and a bystander that hears everything."""

    def __init__(self, folder: Path) -> None:
        endpoint = f"tcp/127.0.0.1:{free_port()}"
        self.folder, self.endpoint = folder, endpoint
        self.bus = BusSettings(prefix="t", router=endpoint, listen=[endpoint], lease_ms=LEASE_MS)
        self._router = open_router(self.bus)
        self._session = open_client(self.bus)
        self.heard: dict[str, dict[int, int]] = {}  # topic -> number of its publisher -> messages
        self._subscriber = self._session.declare_subscriber("t/**", self._on)
        self._stop = threading.Event()
        settings = RecorderSettings(root=folder / "sessions", auto_start=True)
        self._recorder = threading.Thread(
            target=recorder.run, args=(settings, self.bus, self._stop)
        )
        self._recorder.start()
        self.processes: list[subprocess.Popen] = []

    def until(self, condition, what: str, seconds: float = 60.0) -> None:
        """Wait for it; what all processes said where it does not come."""
        end = time.monotonic() + seconds
        while not condition():
            if time.monotonic() > end:
                said = [f"{log.name}:\n{log.read_text()}" for log in self.folder.glob("*.log")]
                pytest.fail("\n".join([f"no {what}", *said]))
            time.sleep(0.05)

    def _on(self, sample) -> None:
        if sample.attachment is not None:
            topic = str(sample.key_expr).split("/")[2]
            number = int.from_bytes(sample.attachment.to_bytes(), "little")
            counts = self.heard.setdefault(topic, {})
            counts[number] = counts.get(number, 0) + 1

    def numbers(self, topic: str) -> list[int]:
        return list(self.heard.get(topic, {}))

    def start(self, program: str, name: str, *arguments: object) -> subprocess.Popen:
        process = start(program, self.folder / f"{name}.log", *arguments)
        self.processes.append(process)
        return process

    def log(self, name: str) -> str:
        return (self.folder / f"{name}.log").read_text()

    def close(self) -> Path:
        if self._stop.is_set():
            return self.session
        for process in self.processes:
            process.send_signal(signal.SIGCONT)
            process.send_signal(signal.SIGTERM)
        for process in self.processes:
            try:
                process.wait(20.0)
            except subprocess.TimeoutExpired:
                process.kill()
        self._stop.set()
        self._recorder.join()
        self._subscriber.undeclare()
        self._session.close()
        self._router.close()
        return self.session

    @property
    def session(self) -> Path:
        """The folder of what was recorded."""
        return next((self.folder / "sessions").glob("*/session.json")).parent


@pytest.fixture
def bench(tmp_path):
    made = Bench(tmp_path)
    yield made
    made.close()


def recorded_once(folder: Path, topic) -> int:
    """Messages of a topic in the recording; none of them twice."""
    payloads = [
        row.payload
        for row in read(folder / read_manifest(folder).file)
        if parse(row.key).topic is topic
    ]
    assert len(set(payloads)) == len(payloads)
    return len(payloads)


def test_a_gateway_that_was_stopped_steps_back_behind_the_one_that_took_its_device(bench):
    boards = [Board(), Board()]
    try:
        places = [(bench.folder / f"journal{k}", board.path) for k, board in enumerate(boards)]
        ends = (bench.endpoint, LEASE_MS)
        first = bench.start(GATEWAY, "first", *places[0], *ends)
        bench.until(lambda: bench.numbers("accel"), "samples of the first")
        bench.start(GATEWAY, "second", *places[1], *ends)
        bench.until(lambda: "another gateway serves" in bench.log("second"), "refusal")
        first.send_signal(signal.SIGSTOP)
        old = max(bench.numbers("accel"))
        bench.until(lambda: max(bench.numbers("accel")) > old, "samples of the second")
        new = max(bench.numbers("accel"))
        first.send_signal(signal.SIGCONT)
        bench.until(lambda: "stepping back" in bench.log("first"), "stepping back")
        before = bench.heard["accel"][new]
        bench.until(lambda: bench.heard["accel"][new] > before + 100, "samples of the second")
        left = bench.heard["accel"][old]
        time.sleep(1.0)
        assert bench.heard["accel"][old] == left
    finally:
        folder = bench.close()
        for board in boards:
            board.close()
    assert recorded_once(folder, ACCEL) > 100
    rows = [
        row for row in read(folder / read_manifest(folder).file) if parse(row.key).topic is ACCEL
    ]
    runs = [ACCEL.type.FromString(row.payload).header.run for row in rows]
    assert runs == sorted(runs)  # none of the old one behind the new one's first


def test_a_second_estimator_waits_and_takes_over_and_the_first_steps_back(bench):
    board = Board()
    try:
        ends = (bench.endpoint, LEASE_MS)
        bench.start(GATEWAY, "gateway", bench.folder / "journal", board.path, *ends)
        first = bench.start(ESTIMATOR, "first", bench.folder / "one", *ends)
        bench.until(lambda: bench.numbers("rate"), "estimates of the first")
        bench.start(ESTIMATOR, "second", bench.folder / "two", *ends)
        bench.until(lambda: "another estimator runs" in bench.log("second"), "refusal")
        first.send_signal(signal.SIGSTOP)
        old = max(bench.numbers("rate"))
        bench.until(lambda: max(bench.numbers("rate")) > old, "estimates of the second")
        new = max(bench.numbers("rate"))
        first.send_signal(signal.SIGCONT)
        bench.until(lambda: "stepping back" in bench.log("first"), "stepping back")
        before = bench.heard["rate"][new]
        bench.until(lambda: bench.heard["rate"][new] > before + 100, "estimates of the second")
        assert max(bench.numbers("rate")) == new
    finally:
        folder = bench.close()
        board.close()
    assert recorded_once(folder, RATE) > 100
