"""The line to a rate table: its limits are of the table's silence, and not of a process that was
stopped. Real processes and signals, real pseudo-terminals.
"""

import os
import select
import signal
import subprocess
import sys
import time
import tty

import pytest
import serial
from hypothesis import given
from hypothesis import strategies as st

from sessions.procedure.driven import line as lines
from sessions.procedure.driven.line import LOOK_S, Patience, opened, send

LIMIT_S = 1.0
LONG = 200_000  # bytes; more than a pseudo-terminal holds
ITSELF = """
import os, signal, sys, threading
from sessions.procedure.driven.description import described
from sessions.procedure.driven.line import opened, send
from sessions.procedure.driven.table import TextTable

def stopped_after(seconds):
    threading.Timer(seconds, os.kill, (os.getpid(), signal.SIGSTOP)).start()
"""
SENDS = "stopped_after(0.3); send(opened(sys.argv[1], 9600), bytes({long}), {limit})"
ASKS = """
said = described("simulated").model_copy(update={{"timeout_s": {limit}}})
table = TextTable(said, sys.argv[1])
stopped_after(0.3)
print(table.rate())
"""


@pytest.fixture
def ends():
    ours, other = os.openpty()
    tty.setraw(other)
    yield ours, os.ttyname(other)
    os.close(ours)
    os.close(other)


def stopped(code: str, port: str) -> subprocess.Popen:
    """A process that runs it and has stopped itself."""
    code = ITSELF + code.format(long=LONG, limit=LIMIT_S)
    child = subprocess.Popen(
        [sys.executable, "-c", code, port], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    _, how = os.waitpid(child.pid, os.WUNTRACED)
    assert os.WIFSTOPPED(how), child.communicate()
    return child


def taken(ours: int, wait_s: float) -> bytes:
    """What has come, until nothing more does."""
    came = b""
    while select.select([ours], [], [], wait_s)[0]:
        came += os.read(ours, 65536)
    return came


def test_a_command_that_there_was_room_for_while_the_process_was_stopped_goes_out(ends):
    ours, port = ends
    child = stopped(SENDS, port)
    came = taken(ours, LIMIT_S + 0.3)
    assert 0 < len(came) < LONG
    child.send_signal(signal.SIGCONT)
    while child.poll() is None:
        came += taken(ours, 0.05)
    wrong = child.communicate()[1].decode()
    assert child.returncode == 0 and len(came + taken(ours, 0.05)) == LONG, wrong


def test_an_answer_that_comes_after_both_were_stopped_is_one(ends):
    ours, port = ends
    child = stopped(ASKS, port)
    assert taken(ours, LIMIT_S + 0.3) == b"SENS:RATE?\n"
    child.send_signal(signal.SIGCONT)
    time.sleep(0.2)
    os.write(ours, b"90.0\n")
    told, wrong = child.communicate()
    assert child.returncode == 0, wrong.decode()
    assert float(told) == pytest.approx(1.5708, abs=1e-4)


def test_a_table_that_takes_nothing_is_given_up(ends):
    _, port = ends
    with pytest.raises(serial.SerialTimeoutException, match="takes nothing for 0.3 s"):
        send(opened(port, 9600), bytes(LONG), 0.3)


@given(st.lists(st.floats(0.0, 5.0), max_size=40), st.floats(0.05, 5.0))
def test_a_look_counts_as_one_however_long_it_was(rounds, limit_s):
    with pytest.MonkeyPatch.context() as patch:
        now = [100.0]
        patch.setattr(lines.time, "monotonic", lambda: now[0])
        patience, left = Patience(limit_s), limit_s
        for passed in rounds:
            now[0] += passed
            left -= min(passed, LOOK_S)
            if abs(left) > 1e-6:  # sums of floats
                assert patience.over() == (left < 0.0)
            else:
                patience.over()
