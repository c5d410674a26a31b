"""kill -9 of gateway and recorder while a board speaks: real processes, and every sample accounted
for.

tests/bench/bench_crash.py does this twenty times to every service of the whole stack.
"""

import itertools
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import psutil
import pytest
from support.waiting import until

from gateway.virtual.board_link import PtyLink
from gateway.virtual.virtual_board import SIMULATED, BoardAccel, VirtualBoard
from messages.bus.session import BusSettings, open_client, open_router, subscribe
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import LINK, STATUS
from sessions.library.catalogue import Catalogue
from sessions.recording.mcap_log import read

ROOT = Path(__file__).resolve().parents[2]
PATIENCE = 60.0  # s; generous, the tests wait for states
PERIOD_S = 0.01


class Stack:
    """Router and board in this process, gateway and recorder in their own."""

    def __init__(self, folder: Path, port: int, period_s: float = PERIOD_S) -> None:
        self.folder = folder
        endpoint = f"tcp/127.0.0.1:{port}"
        self.bus = BusSettings(router=endpoint, listen=[endpoint])
        self.link = PtyLink()
        self.config = folder / "gyrofree.toml"
        self.config.write_text(
            f'[bus]\nrouter = "{endpoint}"\n[gateway]\njournal = "{folder}/journal"\n'
            f'[[gateway.devices]]\nname = "cube"\nport = "{self.link.path}"\n'
            f'[recorder]\nroot = "{folder}/sessions"\nauto_start = true\n'
        )
        self.status, self.line = pb.RecorderStatus(), pb.LinkStatus()
        self._stop = threading.Event()
        items = (
            BoardAccel(k * period_s, tuple((k + axis) % 300 for axis in range(12)))
            for k in range(1 << 30)
        )
        board = VirtualBoard(self.link, SIMULATED, epoch=3, sample_period_s=period_s)
        self._board = threading.Thread(
            target=board.run, args=(items, self._stop), kwargs={"speed": 1.0}
        )

    def __enter__(self) -> "Stack":
        self._router = open_router(self.bus)
        self._client = open_client(self.bus)
        self._held = [
            subscribe(self._client, STATUS, "gyrofree", lambda _, m: setattr(self, "status", m)),
            subscribe(self._client, LINK, "gyrofree", lambda _, m: setattr(self, "line", m)),
        ]
        self.gateway, self.recorder = self.start("gateway"), self.start("record")
        until(lambda: self.status.recording and self.line.connected, "recorder and gateway")
        self._board.start()
        until(lambda: self.status.messages > 100, "the first messages in the recording")
        return self

    def start(self, command: str) -> subprocess.Popen:
        log = (self.folder / f"{command}.log").open("ab")
        words = [sys.executable, "-m", "gyrofree", command, "--config", str(self.config)]
        return subprocess.Popen(words, stdout=log, stderr=log, cwd=ROOT)

    def __exit__(self, *_: object) -> None:
        if self._stop.is_set():
            return
        self._stop.set()
        self._board.join(PATIENCE)
        for process in (self.gateway, self.recorder):
            process.terminate()
            process.wait(PATIENCE)
        self._client.close()
        self._router.close()
        self.link.close()


@pytest.fixture
def stack(tmp_path, free_port):
    with Stack(tmp_path, free_port) as running:
        yield running


def test_killed_gateway_and_recorder_are_back_by_themselves_and_nothing_acknowledged_is_lost(stack):
    gateway = psutil.Process(stack.gateway.pid)
    (child,) = gateway.children()
    run = stack.line.header.run
    os.kill(child.pid, signal.SIGKILL)
    until(
        lambda: stack.line.header.run != run and stack.line.good_frames > 100,
        "the gateway's next life",
    )
    safe = until(lambda: stack.status.durable_messages, "an acknowledgement")
    session = stack.status.session
    stack.recorder.send_signal(signal.SIGKILL)
    stack.recorder.wait(PATIENCE)
    time.sleep(1.0)  # what comes meanwhile is in nobody's recording yet
    stack.recorder = stack.start("record")
    until(
        lambda: stack.status.session != session and stack.status.messages > 300, "the next session"
    )
    until(lambda: not stack.status.repairing, "the gap to be filled")
    stack.__exit__()
    catalogue = Catalogue(stack.folder / "sessions")
    sessions = sorted(catalogue.list(), key=lambda info: info.id)
    assert [info.state for info in sessions] == ["recovered", "closed"]
    assert catalogue.manifest(sessions[1].id).continues == sessions[0].id == session
    rows = [
        [row for row in read(info.path) if row.key == "gyrofree/cube/accel"] for info in sessions
    ]
    assert sum(1 for _ in read(sessions[0].path)) >= safe
    batches = [pb.AccelBatch.FromString(row.payload) for part in rows for row in part]
    by_run: dict[int, list[int]] = {}
    for batch in batches:
        by_run.setdefault(batch.header.run, []).append(batch.header.sequence)
    assert len(by_run) == 2
    for (
        sequences
    ) in by_run.values():  # in order, none twice, none missing: the recorder's death left no trace
        assert sequences == list(range(sequences[0], sequences[0] + len(sequences)))
    indices = [batch.first_index for batch in batches]
    assert indices == sorted(set(indices))
    # A machine that gives the gateway no time for seconds overflows the port itself: lost on the
    # line, and said so.
    for before, after in itertools.pairwise(batches):
        assert (
            before.first_index + len(before.counts) // before.axes + after.lost_samples
            == after.first_index
        )
    assert (
        len({b.header.run for b in batches}) == 2
    )  # one gateway read the first half of a frame, the other the rest
    lost = any(pb.AccelBatch.FromString(row.payload).lost_samples for row in rows[0])
    assert lost or catalogue.manifest(sessions[0].id).certificate["cube"]["complete"]
