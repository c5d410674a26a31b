"""`gyrofree play`: a log whatever its name, to its end and no further."""

import socket
import subprocess
import sys
from pathlib import Path

import pytest

from firmware_protocol.frames import Hello
from gyrofree.running.play import NAME, board_name
from gyrofree.running.simulate_csv import write
from gyrofree.running.supervisor import Supervisor

AWKWARD = [
    "a.csv",
    "sixteen_chars.cs",
    "seventeen_chars.c",
    "Messung Prüfstand (1) #2 50%.csv",
    "Messung Prüfstand (1) #3 50%.csv",
    "Messung Pru\u0308fstand (2).csv",
    "-leading.csv",
    "two\nlines.csv",
    "測定.csv",
    "測量.csv",
    "\udcff.csv",
    "0123456789abcdef0123456789abcdef01234567",
]


def test_every_name_has_its_own_that_a_board_can_say():
    said = [board_name(name) for name in AWKWARD]
    assert len(set(said)) == len(AWKWARD) and said[:2] == AWKWARD[:2]
    for name in said:
        assert len(name) <= NAME and name.isascii() and name.isprintable()
        hello = Hello(0, 2, 1, 6, 1, 1, 1, firmware=f"log {name}", sensors=())
        assert hello.firmware_text == f"log {name}"
    assert board_name("Pr\u00fcfstand 12345678.csv") == board_name("Pru\u0308fstand 12345678.csv")


@pytest.mark.parametrize(("code", "done"), [(0, True), (1, False)])
def test_a_child_that_runs_once_is_not_started_again(code, done, monkeypatch):
    supervisor = Supervisor()
    monkeypatch.setattr(
        supervisor, "_command", lambda child: [sys.executable, "-c", f"raise SystemExit({code})"]
    )
    supervisor.add("board", "play", once=True)
    supervisor.start()
    child = supervisor.children[0]
    child.process.wait(20)
    for _ in range(3):
        supervisor.step()
    assert supervisor.done is done and (supervisor.fatal is None) is done
    assert child.restarts == 0 and child.process is None


def another_port(taken: int) -> int:
    """A free port besides this one."""
    with socket.socket() as first, socket.socket() as second:
        for probe in (first, second):
            probe.bind(("127.0.0.1", 0))
        ports = [probe.getsockname()[1] for probe in (first, second)]
    return next(port for port in ports if port != taken)


def test_a_log_is_played_to_its_end_and_what_was_recorded_is_said(tmp_path, free_port):
    whole = tmp_path / "log.csv"
    write(whole, "published", 3, "cube", 0.05)
    log = tmp_path / "-Messung Prüfstand [1] #2 50%.csv"
    log.write_text("".join(whole.read_text().splitlines(keepends=True)[:500]))
    command = [sys.executable, "-P", "-m", "gyrofree", "play", "--speed", "4"]
    command += ["--port", str(free_port), "--bus-port", str(another_port(free_port))]
    command += ["--folder", str(tmp_path / "play"), "--", str(log)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "played to its end: session" in done.stdout and " 0 lost" in done.stdout
    assert "starting it again" not in done.stderr and "Traceback" not in done.stderr
    assert (
        "498 of 498 samples played" in done.stderr and "calls itself 'log -Messung" in done.stderr
    )
    recordings = list(Path(tmp_path, "play", "sessions").glob("*/recording.mcap"))
    assert len(recordings) == 1 and recordings[0].stat().st_size > 10_000
