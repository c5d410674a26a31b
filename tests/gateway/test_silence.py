"""What is said of a line that is silent, and of a process that did not look at it."""

import json
import os
import signal
import subprocess
import sys
import time
import tty
from itertools import pairwise

from support.waiting import until

from gateway.board.faults import SILENT_S, FaultWatch

READS = """
import json, pathlib, queue, sys, time
from types import SimpleNamespace
from gateway.ports.backlog import Backlog
from gateway.ports.reader import Reader

port, begun, enough = sys.argv[1], *map(pathlib.Path, sys.argv[2:])
out, nothing = Backlog(), lambda *_: None
keeper = SimpleNamespace(take=nothing, keep=nothing, drop=nothing)
reader = Reader(port, 115200, 0, SimpleNamespace(append=nothing), out, keeper)
came, silences = [], []
while not enough.exists():
    silences.append(reader.silent_s)
    try:
        chunk = out.get(timeout=0.05)
    except queue.Empty:
        continue
    if chunk.data:
        came.append((chunk.monotonic_ns * 1e-9, chunk.late))
        begun.touch()
reader.close()
print(json.dumps([came, max(silences)]))
"""


def read(tmp_path, frozen_s: float, silent_s: float) -> tuple[list, float, list]:
    """A real process reads a pty that gets 50 writes a second; it is frozen twice, and then the
    line is silent. When bytes came and whether they may have waited; the longest silence it saw;
    when bytes were written. Times are of one clock.
    """
    ours, theirs = os.openpty()
    tty.setraw(theirs)
    begun, enough, wrote = tmp_path / "begun", tmp_path / "enough", []
    words = [sys.executable, "-c", READS, os.ttyname(theirs), str(begun), str(enough)]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as process:

        def write(seconds: float) -> bool:
            end = time.monotonic() + seconds
            while time.monotonic() < end:
                wrote.append(time.monotonic())
                os.write(ours, b"0123456789")
                time.sleep(0.02)
            return begun.exists()

        until(lambda: write(0.1), "the first bytes")
        for _ in range(2):
            process.send_signal(signal.SIGSTOP)
            write(frozen_s)
            process.send_signal(signal.SIGCONT)
            write(0.5)
        time.sleep(silent_s)
        write(0.3)
        enough.touch()
        told = json.loads(process.communicate()[0])
    os.close(ours)
    os.close(theirs)
    return told[0], told[1], wrote


def test_a_process_that_was_frozen_for_a_moment_knows_nothing_of_the_line(tmp_path):
    came, _, wrote = read(tmp_path, frozen_s=0.8, silent_s=0.0)
    long = [(a, b, late) for (a, _), (b, late) in pairwise(came) if b - a > SILENT_S]
    assert any(late for _, _, late in long)
    # on a busy machine the other end, too, may be held up: then the line was silent
    wrong = [(a, b) for a, b, late in long if not late and any(a < w < b - 0.1 for w in wrote)]
    assert not wrong
    watch = FaultWatch()
    for at_s, late in came:
        watch.heard(at_s, 0, late)
    assert watch.news() == any(not late for _, _, late in long)


def test_a_silence_that_was_looked_at_is_said(tmp_path):
    came, silence, _ = read(tmp_path, frozen_s=0.0, silent_s=1.5)
    assert silence > 2 * SILENT_S
    watch = FaultWatch()
    for at_s, late in came:
        watch.heard(at_s, 0, late)
    assert watch.news()
