"""How long after its fault a service that is frozen or hangs is on the page of places and an alarm.

    python tests/bench/bench_presence.py [TIMES] [BUSY]

TIMES: of each fault (3). BUSY: processes that take all the time they get (0); with some, it also
counts alarms of services for a minute in which nothing is wrong. Real processes and SIGSTOP, or one
thread stopped as a debugger does; the times are those of this machine's clock.
"""

import os
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, ExitStack, contextmanager
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]

from faults.bench import Bench  # noqa: E402
from support.one_thread import held  # noqa: E402

from messages.bus.presence import LOOK_S, Presence, State, Watching  # noqa: E402
from messages.bus.session import connected, subscribe  # noqa: E402
from messages.contract.topics import BEAT  # noqa: E402

CALM_S = 15.0  # from the first picture: nobody is young any more
QUIET_S = 60.0  # in which nothing is wrong
MOST_S = 30.0
ROLES = {"record": "recorder"}
FROZEN = ("gateway", "record", "estimator", "procedures", "dashboard")
HUNG = {"gateway": "link cube", "record": "", "estimator": "estimator", "dashboard": ""}


class Places:
    """What the page of places shows: the same code, in this process."""

    def __init__(self, bench: Bench) -> None:
        session, prefix = bench.watch.session, bench.bus.prefix
        self.presence, self._session = Presence("here"), session
        self._watching = Watching(session, prefix, self.presence)
        self._beats = subscribe(session, BEAT, prefix, self._heard)

    def _heard(self, key: str, beat) -> None:
        _, place, _, name = key.split("/")
        self.presence.beat(place, name, beat)

    def state(self, role: str) -> State | None:
        self.presence.look(time.monotonic(), connected(self._session))
        return next((one.state for one in self.presence.all() if one.role == role), None)


@contextmanager
def stopped(pid: int):
    os.kill(pid, signal.SIGSTOP)
    try:
        yield
    finally:
        os.kill(pid, signal.SIGCONT)


def wait(condition: Callable[[], bool], places: Places, seconds: float) -> None:
    end = time.monotonic() + seconds
    while not condition() and time.monotonic() < end:
        places.state("")
        time.sleep(LOOK_S / 5)


def measure(
    bench: Bench, places: Places, role: str, state: State, fault: AbstractContextManager
) -> tuple[float, float]:
    """Until the page shows it and until the alarm is published, s; infinite beyond MOST_S."""
    alarm, shown, told = f"service-here-{role}", float("inf"), float("inf")
    bench.watch.begin()
    with fault:
        began = time.monotonic()
        while time.monotonic() - began < MOST_S and max(shown, told) == float("inf"):
            if shown == float("inf") and places.state(role) is state:
                shown = time.monotonic() - began
            if told == float("inf") and alarm in bench.watch.alarms:
                told = time.monotonic() - began
            time.sleep(0.02)
    wait(lambda: places.state(role) is State.RUNNING and bench.well(), places, 60.0)
    wait(lambda: alarm not in bench.watch.active, places, 60.0)
    wait(lambda: False, places, 2.0)
    return shown, told


def row(what: str, found: list[tuple[float, float]]) -> None:
    shown, told = zip(*found, strict=True)
    parts = [f"{statistics.median(all_):.2f}, at most {max(all_):.2f} s" for all_ in (shown, told)]
    print(f"{what:22} {len(found)} times: on places after {parts[0]}; alarm after {parts[1]}")


def main(times: int = 3, busy: int = 0) -> None:
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        bench = stack.enter_context(Bench(folder))
        places = Places(bench)
        wait(lambda: False, places, CALM_S)
        for _ in range(busy):
            burning = subprocess.Popen([sys.executable, "-c", "while True: pass"])
            stack.callback(burning.wait)
            stack.callback(burning.kill)
        if busy:
            bench.watch.begin()
            wait(lambda: False, places, QUIET_S)
            false = sorted(one for one in bench.watch.alarms if one.startswith("service"))
            print(f"{QUIET_S:g} s with {busy} others that burn: alarms {false or 'none'}")
        frozen, hung = [], []
        for _ in range(times):
            for service in FROZEN:
                pid, role = bench.children()[service].pid, ROLES.get(service, service)
                frozen.append(measure(bench, places, role, State.FROZEN, stopped(pid)))
            for service, thread in HUNG.items():
                pid, role = bench.children()[service].pid, ROLES.get(service, service)
                hung.append(measure(bench, places, role, State.HUNG, held(pid, thread)))
        row("SIGSTOP", frozen)
        row("one thread stopped", hung)
        print(f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
