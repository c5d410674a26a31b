"""Two of each service on one bus, begun in the same moment: one serves, the other waits and takes
over when the first is killed. Real processes over a real router.
"""

import re
import subprocess
import sys
import time
from pathlib import Path

import pytest
from support.stack import free_port

from gyrofree.running.process import EXIT_TAKEN
from messages.bus import orders
from messages.bus.claiming import rank_of
from messages.bus.session import BusSettings, open_client, open_router, subscribe
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import ESTIMATES, PROCEDURES, RECORDER, STATUS, claim_key
from sessions.recording.manifest import read_manifest

SERVICES = (ESTIMATES, PROCEDURES, RECORDER)
ALL_THREE = """
import logging, sys, threading, time
from pathlib import Path
from estimator import service as estimator
from estimator.settings import EstimatorSettings
from gyrofree.running.process import stop_on_signals
from messages.bus.session import BusSettings
from sessions.procedure import service as procedures
from sessions.procedure.settings import ProcedureSettings
from sessions.recording import service as recorder
from sessions.recording.settings import RecorderSettings
logging.basicConfig(level="INFO", stream=sys.stderr)
stop, folder = stop_on_signals(), Path(sys.argv[1])
bus = BusSettings(prefix="t", router=sys.argv[2], lease_ms=4000)
filters = EstimatorSettings(rate=[sys.argv[3]], navigators=[], attitudes=[], journal=None)
tests = ProcedureSettings(root=folder / "procedures", folder=folder)
parts = [
    (recorder, RecorderSettings(root=folder / "sessions")),
    (estimator, filters),
    (procedures, tests),
]
threads = [threading.Thread(target=one.run, args=(settings, bus, stop)) for one, settings in parts]
print("ready", flush=True)
sys.stdin.readline()
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
"""


class Two:
    """Two processes with all services each, and who is heard to serve."""

    def __init__(self, folder: Path) -> None:
        endpoint = f"tcp/127.0.0.1:{free_port()}"
        self.bus = BusSettings(prefix="t", router=endpoint, listen=[endpoint], lease_ms=4000)
        self.folder = folder
        self._router, self.session = open_router(self.bus), open_client(self.bus)
        self.recorded: list[str] = []  # sessions, as the recorders say
        self._listening = subscribe(self.session, STATUS, "t", self._on_status)
        self.processes = [
            self._start(name, rate)
            for name, rate in (("one", "least-squares"), ("two", "products-ekf"))
        ]
        for process in self.processes:
            assert process.stdout.readline() == b"ready\n"
        for process in self.processes:
            process.stdin.write(b"go\n")
            process.stdin.flush()

    def _on_status(self, _: str, status: pb.RecorderStatus) -> None:
        if status.recording:
            self.recorded.append(status.session)

    def _start(self, name: str, rate: str) -> subprocess.Popen:
        with (self.folder / f"{name}.log").open("wb") as log:
            return subprocess.Popen(
                [sys.executable, "-c", ALL_THREE, self.folder / name, self.bus.router, rate],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=log,
            )

    def logs(self) -> list[str]:
        return [(self.folder / f"{name}.log").read_text() for name in ("one", "two")]

    def serving(self, source: str) -> list[str]:
        """Ids of the sessions that claim it."""
        replies = self.session.liveliness().get(f"{claim_key('t', source)}/*", timeout=5.0)
        ranks = [rank_of(str(reply.ok.key_expr)) for reply in replies if reply.ok is not None]
        return [rank[1] for rank in ranks if rank is not None]

    def order(self, action: int) -> list[pb.RecorderStatus]:
        """Every answer of whoever takes it."""
        command = pb.RecorderCommand(action=action, name="two of each")
        key = orders.RECORDER.key("t", "")
        return [
            pb.RecorderStatus.FromString(reply.ok.payload.to_bytes())
            for reply in self.session.get(key, payload=command.SerializeToString(), timeout=20.0)
            if reply.ok is not None
        ]

    def until(self, condition, what: str) -> None:
        end = time.monotonic() + 90.0
        while not condition():
            assert time.monotonic() < end, "\n".join([f"no {what}", *self.logs()])
            time.sleep(0.05)

    def close(self) -> None:
        for process in self.processes:
            process.kill()
            process.communicate()
        self._listening.undeclare()
        self.session.close()
        self._router.close()


@pytest.fixture
def two(tmp_path):
    made = Two(tmp_path)
    yield made
    made.close()


def refusals(logs: list[str]) -> list[list[str]]:
    found = [re.findall(r"another (\w+).* runs here", log) for log in logs]
    return [sorted(names) for names in found]


def test_one_of_each_serves_and_the_other_takes_over_what_was_recorded(two):
    two.until(lambda: len(sum(refusals(two.logs()), [])) == len(SERVICES), "three refusals")
    for source in SERVICES:
        two.until(lambda source=source: len(two.serving(source)) == 1, f"one {source}")
    assert sorted(sum(refusals(two.logs()), [])) == sorted(SERVICES)  # each refused at one place
    started = two.order(pb.RecorderCommand.ACTION_START)
    assert [status.recording for status in started] == [True], started
    recorder = next(k for k, log in enumerate(two.logs()) if "recording /" in log)
    two.until(lambda: two.recorded, "status of what is recorded")
    two.processes[recorder].kill()
    other = 1 - recorder
    two.until(lambda: "going on where" in two.logs()[other], "recorder that goes on")
    for source in SERVICES:
        two.until(lambda source=source: len(two.serving(source)) == 1, f"second {source}")
    assert [status.recording for status in two.order(pb.RecorderCommand.ACTION_STOP)] == [False]
    made = sorted(two.folder.glob("*/sessions/*/session.json"))
    sessions = {path.parts[-4]: read_manifest(path.parent) for path in made}
    assert len(made) == 2 and sessions[("one", "two")[other]].continues == started[0].session


def test_a_second_router_at_the_same_port_says_that_it_is_taken(tmp_path):
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    (tmp_path / "gyrofree.toml").write_text(
        f'[bus]\nrouter = "{endpoint}"\nlisten = ["{endpoint}"]\n'
    )
    command = [sys.executable, "-P", "-m", "gyrofree", "router"]
    both = [
        subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True) for _ in range(2)
    ]
    end = time.monotonic() + 90.0
    while all(one.poll() is None for one in both):
        assert time.monotonic() < end
        time.sleep(0.05)
    ended = next(one for one in both if one.poll() is not None)
    staying = next(one for one in both if one is not ended)
    said = ended.communicate()[1]
    try:
        assert ended.returncode == EXIT_TAKEN and endpoint.removeprefix("tcp/") in said, said
        assert "Traceback" not in said and staying.poll() is None
    finally:
        staying.terminate()
        staying.communicate(timeout=30.0)
