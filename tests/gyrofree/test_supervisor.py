"""The supervisor with real child processes."""

import io
import re
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from rich.console import Console

from gyrofree.config import Settings
from gyrofree.running.supervisor import Supervisor
from gyrofree.running.watch import BEGINNING, QUIET, SCREENFUL, Watch, _Greeter

ROOT = Path(__file__).resolve().parents[2]


class Scripts(Supervisor):
    """Children of `python -c` instead of gyrofree commands."""

    def add_script(self, name, text):
        self.add(name, text)

    def _command(self, child):
        return [super()._command(child)[0], "-c", child.arguments[0]]


@pytest.fixture
def supervisor():
    made = Scripts(Console(file=io.StringIO(), width=200))
    yield made
    made.stop()


def text(supervisor):
    return supervisor.console.file.getvalue()


def until(supervisor, condition, seconds=30):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, text(supervisor)
        supervisor.step()
        time.sleep(0.02)


def test_a_child_that_dies_is_started_again_and_the_log_says_so(supervisor):
    supervisor.add_script("worker", "import time; print('INFO up', flush=True); time.sleep(60)")
    supervisor.start()
    until(supervisor, lambda: "up" in text(supervisor))
    supervisor.children[0].process.kill()
    until(supervisor, lambda: text(supervisor).count("up") == 2)
    assert "worker ended by signal SIGKILL: starting it again" in text(supervisor)
    assert supervisor.children[0].restarts == 1


def test_a_taken_port_ends_the_whole(supervisor):
    supervisor.add_script("web", "import sys; print('ERROR port 8080 is taken'); sys.exit(3)")
    supervisor.start()
    until(supervisor, lambda: supervisor.fatal is not None)
    assert "cannot go on" in text(supervisor)


def test_children_end_in_order_when_asked(supervisor):
    supervisor.add_script("a", "import time; print('INFO up', flush=True); time.sleep(60)")
    supervisor.add_script("b", "import time; print('INFO up', flush=True); time.sleep(60)")
    supervisor.start()
    until(supervisor, lambda: text(supervisor).count("up") == 2)
    assert supervisor.stop()
    assert all(child.process.poll() is not None for child in supervisor.children)


def test_a_child_that_does_not_listen_is_killed_and_named(supervisor):
    supervisor.add_script(
        "deaf",
        "import signal, time; signal.signal(15, signal.SIG_IGN); print('INFO up', flush=True);"
        " time.sleep(60)",
    )
    supervisor.start()
    until(supervisor, lambda: "up" in text(supervisor))
    assert not supervisor.stop()
    assert "deaf did not end" in text(supervisor)


HELD = """
import signal, sys
from gyrofree.running.process import stop_on_signals
stop = stop_on_signals()
with stop._cond:  # as the main thread is for a moment inside every stop.wait()
    signal.raise_signal(signal.SIGINT)
    signal.raise_signal(signal.SIGTERM)
assert stop.wait(30.0)
print("ended")
"""


def test_a_signal_may_come_at_any_moment():
    """Ctrl-C of a terminal and the supervisor's SIGTERM reach a service within a millisecond of
    each other.
    """
    done = subprocess.run(
        [sys.executable, "-c", HELD], cwd=ROOT, capture_output=True, text=True, timeout=60
    )
    assert done.stdout == "ended\n", done.stderr


ENDS = """
import sys, weakref
from gyrofree.running import process
process.stop_on_signals()
class Held: pass
held = Held()
weakref.finalize(held, print, "let go")
sys.stdout.write("said")
try:
    {how}
except SystemExit as end:
    process.ending(end.code)
    raise
"""


@pytest.mark.parametrize(
    ("how", "code"), [("pass", 0), ("raise SystemExit(3)", 3), ("raise ValueError", 1)]
)
def test_a_service_ends_with_its_code_and_all_that_it_said(how, code):
    """Though its interpreter is not taken down, which a thread of the bus would not survive."""
    child = [sys.executable, "-c", ENDS.format(how=how)]
    done = subprocess.run(child, cwd=ROOT, capture_output=True, text=True, timeout=60)
    assert (done.stdout, done.returncode) == ("saidlet go\n", code), done.stderr


ASLEEP = """
from gyrofree.running.process import stop_on_signals
stop = stop_on_signals()
print("up", flush=True)
stop.wait()
"""


def test_two_signals_at_once_end_a_service_that_sleeps():
    for _ in range(4):
        child = subprocess.Popen(
            [sys.executable, "-c", ASLEEP], cwd=ROOT, stdout=subprocess.PIPE, text=True
        )
        assert child.stdout.readline() == "up\n"
        time.sleep(0.2)  # into its sleep
        child.send_signal(signal.SIGINT)
        child.send_signal(signal.SIGTERM)
        try:
            assert child.wait(30) == 0
        finally:
            child.kill()


def test_what_a_child_waits_for_is_no_news_before_it_is_there(supervisor):
    lines = "print('/b: not there'); print('/b: open'); print('/b: not there', flush=True)"
    supervisor.add("gateway", f"{lines}; import time; time.sleep(60)", hushed=("/b: not", "/b: op"))
    supervisor.start()
    until(supervisor, lambda: "/b: not there" in text(supervisor))
    shown = [line for line in text(supervisor).splitlines() if "/b" in line]
    assert len(shown) == 2 and "open" in shown[0] and "not there" in shown[1]


def test_the_address_is_said_again_below_what_covers_it(supervisor, monkeypatch):
    now = [1000.0]
    monkeypatch.setattr("gyrofree.running.watch.time.monotonic", lambda: now[0])
    greeter = _Greeter(supervisor, lambda: [("open  here", "bold")])

    def said_after(seconds):
        before = text(supervisor).count("open  here")
        now[0] += seconds
        greeter.look()
        return text(supervisor).count("open  here") - before

    greeter.say()
    assert said_after(QUIET + 1) == 0  # nothing covers it
    supervisor.say("board: open")
    assert said_after(QUIET / 2) == 0 and said_after(QUIET) == 1
    now[0] += BEGINNING
    supervisor.say("board: run ended")
    assert said_after(QUIET + 1) == 0  # one line does not cover it any more
    for k in range(SCREENFUL):
        supervisor.say(f"line {k}")
    assert said_after(QUIET + 1) == 0  # a file is no screen
    supervisor.console._force_terminal = True
    assert said_after(QUIET + 1) == 1 and said_after(QUIET + 1) == 0


def test_a_page_that_takes_its_time_ends_nothing_else(supervisor, monkeypatch, free_port):
    monkeypatch.setattr("gyrofree.running.watch.WAIT_FOR_PAGE", 0.0)
    settings = Settings(dashboard={"port": free_port})
    supervisor.add_script(
        "worker", "import time\nwhile True: print('INFO it works', flush=True); time.sleep(0.1)"
    )
    stop, watched = threading.Event(), Watch(supervisor, settings, lambda: [("open  here", "")])
    looking = threading.Thread(target=watched.run, args=(stop,))
    looking.start()
    goes_on = r"does not answer.*it works"
    end = time.monotonic() + 30.0
    while not re.search(goes_on, text(supervisor), re.DOTALL) and time.monotonic() < end:
        time.sleep(0.02)
    stop.set()
    looking.join(30.0)
    said = text(supervisor)
    assert said.count("does not answer") == 1 and "stopped cleanly" in said
    assert re.search(goes_on, said[: said.index("stopping")], re.DOTALL)
