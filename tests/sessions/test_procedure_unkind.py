"""Procedures where things go wrong: tables that are silent, pour, or do not take their stop, a disk
that is full, orders that come too late, files with names of any kind.
"""

import os
import resource
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from support.procedures import Answers, start
from support.waiting import until

from messages.contract import gyrofree_pb2 as pb
from messages.contract.checks import check
from sessions.procedure import library
from sessions.procedure.conductor import Conductor
from sessions.procedure.desk import late
from sessions.procedure.driven.description import TableError, described
from sessions.procedure.driven.table import TextTable
from sessions.procedure.library import of_text
from sessions.procedure.model import DEG
from sessions.procedure.run import HELD, STOPPED, Journal, unfinished
from sessions.procedure.status import status_of

TURN = """
title = "Turn"
[[steps]]
kind = "rate"
rate_dps = 90
dwell_s = 5
[[steps]]
kind = "still"
seconds = 1
"""
IDENTITY = "gyrofree,simulated rate table"


class SlowTable:
    """A table on a pty that says what `replies` has for a command, else OK; None: nothing."""

    def __init__(self, timeout_s: float = 0.6, **replies: str | None) -> None:
        self.replies: dict[str, str | None] = {"*IDN?": IDENTITY, "SENS:RATE?": "0.0"} | replies
        self.line = Answers(lambda text: self.replies.get(text, "OK"))
        said = described("simulated").model_copy(update={"timeout_s": timeout_s})
        self.table = TextTable(said, self.line.path)

    def heard(self, command: str) -> None:
        end = time.monotonic() + 30.0
        while command not in self.line.lines:
            assert time.monotonic() < end, self.line.lines
            time.sleep(0.01)


def conductor(tmp_path: Path, table: TextTable | None = None, **more) -> Conductor:
    journal = Journal.begin(tmp_path, start(toml=TURN, **more))
    return Conductor(journal, table, lambda *_: None, lambda _: "")


def ticked(one: Conductor, wanted, seconds: float = 60.0) -> None:
    end = time.monotonic() + seconds
    while not wanted():
        assert time.monotonic() < end, status_of(one)
        one.tick()
        time.sleep(0.02)


def test_a_stop_does_not_wait_for_a_table_that_is_slow_to_answer():
    slow = SlowTable(timeout_s=10.0, **{"SENS:RATE?": None})
    slow.table.take()
    told: list[str] = []

    def ask() -> None:
        try:
            slow.table.rate()
        except TableError as error:
            told.append(str(error))

    asking = threading.Thread(target=ask)
    asking.start()
    slow.heard("SENS:RATE?")
    slow.table.stop()
    asking.join(30.0)
    assert slow.line.lines[-1] == "OUTP:STOP" and "given up for a stop" in told[0]
    slow.table.release()


def test_a_table_that_pours_or_takes_nothing_holds_nobody_up():
    with socket.create_server(("127.0.0.1", 0)) as server:

        def pour() -> None:
            there, _ = server.accept()
            with there:
                while True:
                    try:
                        there.sendall(b"rubbish " * 4096)
                    except OSError:
                        return

        threading.Thread(target=pour, daemon=True).start()
        url = f"tcp://127.0.0.1:{server.getsockname()[1]}"
        table = TextTable(described("simulated").model_copy(update={"timeout_s": 0.2}), url)
        for order in (table.rate, table.stop):
            with pytest.raises(TableError, match="was answered by"):
                order()
        table.close()
    ours, other = os.openpty()
    mute = described("simulated").model_copy(update={"timeout_s": 0.05, "answer": ""})
    table = TextTable(mute, os.ttyname(other))
    with pytest.raises(TableError):
        for _ in range(10_000):
            table.set_rate(1.0)
    os.close(ours)
    os.close(other)


def test_an_answer_that_came_while_the_process_was_frozen_is_one(tmp_path):
    """A debugger, or a machine that sleeps, in the middle of an answer: real signals."""
    slow = SlowTable(**{"SENS:RATE?": "89.5"})
    begun, enough = tmp_path / "begun", tmp_path / "enough"
    asks = (
        "import pathlib, sys\n"
        "from sessions.procedure.driven.description import described\n"
        "from sessions.procedure.driven.table import TextTable\n"
        "table = TextTable(described('simulated'), sys.argv[1])\n"
        "begun, enough = map(pathlib.Path, sys.argv[2:])\n"
        "while not enough.exists():\n"
        "    told = table.rate()\n"
        "    begun.touch()\n"
        "print(told)\n"
    )
    words = [sys.executable, "-c", asks, slow.line.path, str(begun), str(enough)]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as asking:
        until(lambda: begun.exists() or asking.poll() is not None, "the first answer")
        for _ in range(4):
            asking.send_signal(signal.SIGSTOP)
            time.sleep(described("simulated").timeout_s + 0.2)
            asking.send_signal(signal.SIGCONT)
            time.sleep(0.05)
        enough.touch()
        told, wrong = asking.communicate()
    assert asking.returncode == 0, wrong.decode()
    assert float(told) == pytest.approx(89.5 * DEG)


def test_two_on_one_line_do_not_take_each_others_answers():
    """As the guard, which stops the table of a service that was killed, and its next life."""
    slow = SlowTable(timeout_s=5.0)
    slow.line.pause_s = 0.2
    other = TextTable(described("simulated"), slow.line.path)
    told: list[str] = []

    def leave() -> None:
        other.stop()
        other.close()
        told.append("stopped")

    other._open()
    leaving = threading.Thread(target=leave)
    leaving.start()
    slow.table.take()
    leaving.join(30.0)
    assert told == ["stopped"] and slow.line.lines[:2] == ["OUTP:STOP", "*IDN?"]
    slow.table.release()


def test_a_table_is_told_to_stand_until_it_takes_it(tmp_path):
    slow = SlowTable(**{"SENS:RATE?": "90.0"})
    one = conductor(tmp_path, slow.table)
    one.begin()
    slow.heard("SOUR:RATE 90.0000")
    slow.replies |= dict.fromkeys(("SENS:RATE?", "SOUR:RATE 0.0000", "OUTP:STOP"))
    ticked(one, lambda: one.run.state == HELD and one.drive.alarm)
    message = status_of(one)
    assert "DID NOT TAKE THE STOP" in message.alarm and not check(message)
    slow.replies |= {"OUTP:STOP": "OK", "SENS:RATE?": "0.0"}
    ticked(one, lambda: not one.drive.alarm)
    slow.line.lines.clear()
    assert not one.repeat("anna")  # it may have been off meanwhile: taken over anew
    assert slow.line.lines[:3] == ["*IDN?", "SYST:REM", "SYST:WATC 3.0000"]
    one.abort("anna")
    ticked(one, lambda: one.run.closed)
    assert slow.line.lines[-1] == "SYST:LOC"


def test_a_table_that_is_lost_at_the_end_is_left_to_its_guard(tmp_path, monkeypatch):
    monkeypatch.setattr("sessions.procedure.driven.drive.CLOSING_S", 2.0)
    slow = SlowTable()
    one = conductor(tmp_path, slow.table)
    one.begin()
    slow.replies |= dict.fromkeys(("SENS:RATE?", "OUTP:STOP"))
    one.abort("anna")
    ticked(one, lambda: one.run.closed)
    assert "switch it off" in status_of(one).alarm and "SYST:LOC" not in slow.line.lines
    slow.line.lines.clear()
    slow.replies["OUTP:STOP"] = "OK"
    slow.heard("OUTP:STOP")


def test_after_an_emergency_stop_a_new_life_turns_nothing(tmp_path):
    slow = SlowTable()
    one = conductor(tmp_path, slow.table)
    one.begin()
    assert one.emergency() == ""
    slow.table.close()
    slow.line.lines.clear()
    after = Conductor(unfinished(tmp_path)["cube"], slow.table, lambda *_: None, lambda _: "")
    after.begin()
    assert after.run.state == STOPPED
    assert not [line for line in slow.line.lines if "RATE 90" in line]
    slow.table.release()


def test_a_held_step_is_not_left_out_on_a_table_that_is_not_there(tmp_path):
    one = conductor(tmp_path, TextTable(described("simulated"), str(tmp_path / "none")))
    one.begin()
    assert one.run.state == HELD
    assert "No such file" in one.next("anna", "") and one.run.at == 0


def test_a_full_disk_holds_the_run_and_loses_nothing_that_happened(tmp_path):
    one = conductor(tmp_path)
    one.begin()
    size = one.journal.path.stat().st_size
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (size + 10, before[1]))
        one.repeat("anna")
        one.tick()
        assert one.run.state == HELD and "cannot be saved" in status_of(one).message
        assert one.journal.path.stat().st_size == size  # no half line
        one.abort("anna")
        with pytest.raises(OSError):
            resource.setrlimit(resource.RLIMIT_FSIZE, (10, before[1]))
            Journal.begin(tmp_path, start(run="99", toml=TURN))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert not (tmp_path / "cube" / "99.jsonl").exists()
    ticked(one, lambda: one.run.closed)
    assert Journal.read(one.journal.path).run == one.run


def test_an_order_for_what_another_has_answered_is_refused(tmp_path):
    one = conductor(tmp_path)
    one.begin()
    order = pb.ProcedureCommand(action=pb.ProcedureCommand.ACTION_NEXT, run=one.run.id, step=1)
    assert late(one, order) == ""
    assert "another test" in late(one, pb.ProcedureCommand(run="x"))
    order.step = 2
    assert "answered already" in late(one, order)
    assert late(one, pb.ProcedureCommand()) == ""  # a terminal means the present one


@pytest.mark.parametrize("name", ["Prüfung 7", "ü" * 120, "a" * 250, "漢字 テスト", "-x", "%s {0}"])
def test_a_procedure_may_have_any_name_that_can_be_shown(tmp_path, name):
    (tmp_path / f"{name}.toml").write_text(TURN)
    assert name in library.names(tmp_path)
    plan = library.find(name, tmp_path)
    journal = Journal.begin(tmp_path, start(toml=TURN, procedure=plan.name, unit="ß" * 64))
    assert not check(status_of(Conductor(journal, None, lambda *_: None, lambda _: "")))


def test_what_cannot_be_shown_or_read_is_left_out(tmp_path):
    for name in (b"\xff.toml", b"a\nb.toml", "\u202eb.toml".encode()):
        with open(os.path.join(os.fsencode(tmp_path), name), "w") as file:
            file.write(TURN)
    (tmp_path / "folder.toml").mkdir()
    os.mkfifo(tmp_path / "pipe.toml")
    assert library.names(tmp_path) == library.names(None)


def test_every_sound_procedure_gives_a_status_that_may_be_sent(tmp_path):
    """The longest texts that a procedure may have, in every place."""
    long = "ä" * 200
    text = f"""
title = "{long}"
unit = "{long}"
[[steps]]
kind = "open"
name = "{long}"
instruction = "{long}"
ask = "{long}"
[[steps]]
kind = "staircase"
name = "{long}"
from_dps = 0
to_dps = {90 / DEG:.3f}
stairs = 3
dwell_s = 1
"""
    assert of_text(text, "x").steps
    journal = Journal.begin(tmp_path, start(toml=text))
    one = Conductor(journal, None, lambda *_: None, lambda _: "")
    one.begin()
    assert not check(status_of(one))
    assert one.next("anna" * 16, "w" * 200) == ""
    assert not check(status_of(one))
