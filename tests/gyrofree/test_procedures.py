"""Procedures with the real services: simulated board and table on pseudo-terminals, and all that
`gyrofree demo` starts.
"""

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator

import httpx
import pytest

from gyrofree.config import load
from messages.bus import orders
from messages.bus.session import open_client, subscribe
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import PROCEDURE, TRUTH
from sessions.report.build import Report, build
from sessions.report.verdict import load_spec
from tests.support.stack import RunningDemo
from tests.support.waiting import until

M = pb.ProcedureStatus
SHORT = """
title = "Short"
repeats = 9
settle_s = 0.3
[[steps]]
kind = "still"
seconds = 1.5
[[steps]]
kind = "rate"
rate_dps = 90
dwell_s = {dwell}
tolerance_dps = 4
[steps.limits.rate_error_dps]
min = -5
max = 5
[[steps]]
kind = "still"
seconds = 1.5
[limits.hysteresis_ppm]
max = 10000
"""
OPEN = """
title = "Open and posed"
settle_s = 0.3
[[steps]]
kind = "open"
instruction = "Read the thermometer"
ask = "temperature in deg C"
[[steps]]
kind = "pose"
up = "+x"
seconds = 1.0
[[steps]]
kind = "pose"
up = "+z"
seconds = 1.0
"""


class Bench:
    """A demo, and somebody who gives orders and listens."""

    def __init__(self, demo: RunningDemo) -> None:
        self.demo = demo
        settings = load(demo.config)
        self.prefix, self.sessions = settings.bus.prefix, settings.recorder.root
        folder = settings.procedures.folder
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "short.toml").write_text(SHORT.format(dwell=2.0))
        (folder / "longer.toml").write_text(SHORT.format(dwell=6.0))
        (folder / "open.toml").write_text(OPEN)
        self.session = open_client(settings.bus, timeout_s=20)
        self.said: list[M] = []
        self.truth = pb.Truth()
        self._kept = [
            subscribe(self.session, PROCEDURE, self.prefix, lambda _, m: self.said.append(m)),
            subscribe(self.session, TRUTH, self.prefix, lambda _, m: self.truth.CopyFrom(m)),
        ]

    def order(self, action: str, **more) -> pb.Reply:
        number = pb.ProcedureCommand.Action.Value(f"ACTION_{action}")
        command = pb.ProcedureCommand(action=number, device="cube", user="anna", **more)
        return orders.give(self.session, self.prefix, orders.PROCEDURES, command, "cube")

    def until(self, wanted, seconds: float = 120.0) -> M:
        """The first status that is as wanted."""
        end, seen = time.monotonic() + seconds, 0
        while time.monotonic() < end:
            for m in self.said[seen:]:
                seen += 1
                if wanted(m):
                    return m
            time.sleep(0.05)
        last = self.said[-1] if self.said else None
        raise AssertionError(f"not seen; last: {last}\n{self.demo.text()[-3000:]}")

    def start(self, name: str) -> None:
        before = {m.run for m in self.said}
        reply = self.order("START", procedure=name, unit="SN-1", own_session=True)
        assert reply.ok, reply.message
        run = self.until(lambda m: m.run and m.run not in before).run
        self.said[:] = [m for m in self.said if m.run == run]  # the one before may end late

    def ended(self) -> M:
        return self.until(lambda m: m.state >= M.STATE_DONE and "closed" not in m.instruction)

    @contextlib.contextmanager
    def page(self) -> Iterator[httpx.Client]:
        """A browser that is signed in; only once, as the link is."""
        url, token = self.demo.link.split("/login/link?token=")
        with httpx.Client(base_url=url, timeout=30.0, headers={"origin": url}) as client:
            assert client.post("/login/link", data={"token": token}).status_code == 303
            client.headers["x-csrf-token"] = client.get("/api/me").json()["csrf"]
            yield client

    def report(self, session: str) -> Report:
        return build(self.sessions / session / "recording.mcap", load_spec(None))

    def written(self, session: str) -> dict[str, bytes]:
        """The report by the command line, by kind of file."""
        out = self.demo.folder / "report"
        words = ["report", session, "--config", str(self.demo.config), "--out", str(out)]
        command = [sys.executable, "-P", "-m", "gyrofree", *words]
        made = subprocess.run(command, capture_output=True, text=True, timeout=240)
        assert made.returncode in (0, 1), made.stderr
        return {path.suffix: path.read_bytes() for path in out.iterdir()}


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    with RunningDemo(tmp_path_factory.mktemp("procedures")) as demo:
        made = Bench(demo)
        made.until(lambda m: m.state == M.STATE_IDLE and "short" in m.offered)
        yield made
        made.session.close()


def test_a_run_ends_with_a_report_of_its_steps_and_the_same_bytes(bench):
    bench.start("short")
    assert not bench.order("START", procedure="short").ok  # one at a time
    m = bench.ended()
    assert m.state == M.STATE_DONE, m.message
    assert [s.state for s in m.steps] == [M.Step.STATE_DONE] * 3
    assert m.unit == "SN-1" and m.operator == "anna"
    assert m.steps[1].state == M.Step.STATE_DONE and "tachometer" in m.reference
    made = bench.report(m.session)
    files = {".html": made.html.encode(), ".pdf": made.pdf, ".json": made.json.encode()}
    assert files == bench.written(m.session)
    said = json.loads(made.json)
    assert said["procedure"]["unit"] == "SN-1" and said["procedure"]["sha256"] == m.sha256
    step = said["procedure"]["steps"][1]
    assert step["segment"]["omega"] == pytest.approx(1.5708, abs=0.02)
    assert step["segment"]["end"] - step["segment"]["begin"] == pytest.approx(2.0, abs=0.01)
    assert step["standard_error_radps"] > 0.0
    checks = {check["name"]: check for check in said["checks"]}
    assert checks["step 2, +90 °/s: rate_error_dps"]["passed"] is True
    assert checks["hysteresis_ppm"]["passed"] is None and said["verdict"] == "incomplete"
    assert "SN-1" in made.html and m.sha256 in made.html


def test_killed_recorder_and_service_spoil_what_ran_and_the_report_is_whole(bench):
    """Both with -9 within the dwell; the run goes on in the recording that goes on."""
    bench.start("longer")

    def dwelling(m: M) -> bool:
        return m.step == 1 and m.steps[1].state == M.Step.STATE_DWELL

    m = bench.until(dwelling)
    os.kill(bench.demo.children()["record"].pid, signal.SIGKILL)
    bench.until(lambda m: m.step == 1 and m.steps[1].spoilt)
    m2 = bench.until(lambda m: (dwelling(m) and m.steps[1].spoilt) or m.state == M.STATE_HELD)
    held = int(m2.state == M.STATE_HELD)  # the recorder was longer away than a step waits for it
    if held:
        assert bench.order("REPEAT").ok
        bench.until(lambda m: dwelling(m) and m.header.sequence > m2.header.sequence)
    os.kill(bench.demo.children()["procedures"].pid, signal.SIGKILL)
    end = bench.ended()
    assert (end.run, end.state) == (m.run, M.STATE_DONE), end.message
    assert end.session != m.session
    spoilt = [s.spoilt for s in end.steps]  # by a machine that had no time for the samples, too
    wanted = [1 + n + held * (number == 1) for number, n in enumerate(spoilt)]
    assert [s.attempts for s in end.steps] == wanted and spoilt[1] >= 2
    told = " ".join(end.steps[1].trouble)
    # The recorder comes back before its silence is noticed, or after.
    assert "recorder" in told and "procedures service was cut off" in told
    assert end.steps[1].until_us - end.steps[1].from_us == 6_000_000
    # The table was driven all the while; the first step's window is still the one before the kills.
    assert end.steps[0].until_us == m.steps[0].until_us < end.steps[1].from_us
    made = bench.report(end.session)
    assert "procedures service was cut off" in made.html
    said = json.loads(made.json)
    assert said["procedure"]["before"] == [m.session]
    assert all(step["segment"] is not None for step in said["procedure"]["steps"])


def test_a_table_stops_by_itself_when_its_driver_hangs_and_the_step_is_repeated(bench):
    bench.start("longer")
    bench.until(lambda m: m.step == 1 and m.steps[1].state == M.Step.STATE_DWELL)
    service, end = bench.demo.children()["procedures"].pid, time.monotonic() + 30.0
    os.kill(service, signal.SIGSTOP)
    try:
        while abs(bench.truth.omega_ib_b_radps[2]) > 0.02:
            assert time.monotonic() < end, "it turns, and nobody holds it"
            time.sleep(0.05)
    finally:
        os.kill(service, signal.SIGCONT)
    assert "the table stops by itself" in bench.demo.text()
    m = bench.until(lambda m: m.steps[1].spoilt)
    assert "it turns at" in m.message, m.message
    assert bench.order("ABORT").ok
    assert bench.ended().state == M.STATE_ABORTED


def test_an_emergency_stop_stands_the_table_and_ends_the_run(bench):
    bench.start("longer")
    bench.until(lambda m: m.step == 1 and m.steps[1].state == M.Step.STATE_DWELL)
    assert abs(bench.truth.omega_ib_b_radps[2]) > 1.0
    with bench.page() as page:
        assert [one["device"] for one in page.get("/api/tables").json()] == ["cube"]
        assert page.post("/api/devices/cube/stop", json={}).json() == {"message": "stopped"}
        m = bench.ended()
        until(lambda: page.get("/api/tables").json() == [], "the table is let go")
    assert m.state == M.STATE_STOPPED and "by demo" in m.message
    assert abs(bench.truth.omega_ib_b_radps[2]) < 0.02 or bench.truth.profile_time_s < 5.0
    said = json.loads(bench.report(m.session).json)
    assert said["verdict"] == "incomplete" and said["procedure"]["state"] == "STATE_STOPPED"


def test_open_steps_are_confirmed_and_poses_are_followed(bench):
    bench.start("open")
    bench.until(lambda m: m.state == M.STATE_RUNNING and m.instruction.startswith("Read"))
    assert "temperature" in bench.order("NEXT").message  # what was read is wanted
    assert bench.order("NEXT", text="23.5", step=1).ok
    assert "answered already" in bench.order("NEXT", text="24", step=1).message
    m = bench.ended()
    assert m.state == M.STATE_DONE, m.message
    assert m.steps[0].reason == "temperature in deg C: 23.5" and m.steps[0].confirmed_by == "anna"
    said = json.loads(bench.report(m.session).json)
    assert [s["segment"] is not None for s in said["procedure"]["steps"]] == [False, True, True]


def test_an_emergency_stop_without_a_run_stands_the_table(bench):
    reply = bench.order("STOP")
    assert reply.ok and "no procedure runs" in reply.message
    end = time.monotonic() + 20.0
    while "the table is driven" not in bench.demo.text().rpartition("left to its profile")[2]:
        assert time.monotonic() < end
        time.sleep(0.1)
    while bench.truth.omega_ib_b_radps[2] != 0.0:
        assert time.monotonic() < end
        time.sleep(0.1)


def test_an_order_that_cannot_be_says_why(bench):
    assert "did you mean 'short'" in bench.order("START", procedure="shrt").message
    assert bench.order("REPEAT").message == "no procedure runs on cube"
