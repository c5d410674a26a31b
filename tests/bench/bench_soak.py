"""Hours of a board at 1 kHz, compressed in time: does the memory of every process stay flat?

    python tests/bench/bench_soak.py [hours, default 8] [services, default all of gateway recorder estimator dashboard]

Each service is a process that does what it does live, with the real parts, as fast as it can (soak_services.py says
what); with the dashboard comes a real router. Private memory of each (USS) is read at every hundredth of the way; the
slope is that of a straight line through the second half, when everything that is kept up to a bound has reached it.
"""

import multiprocessing
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import psutil

sys.path[:0] = [str(Path(__file__).resolve().parent.parent), str(Path(__file__).resolve().parent.parent.parent)]

import soak_services as services  # noqa: E402
from kill_stack import line  # noqa: E402

CONTEXT = multiprocessing.get_context("spawn")
ALONE = ("gateway", "recorder", "estimator")


def watch(name: str, process: Any, hours: float, done: Any, rows: list[tuple[float, float]]) -> None:
    """Private memory of a process, MB, at every hundredth of the way, until it has come to its end or died."""
    due = 0.0
    while process.is_alive():
        time.sleep(0.1)
        if done.value >= due:
            due = done.value + 0.01 * hours
            try:
                rows.append((done.value, psutil.Process(process.pid).memory_full_info().uss / 1e6))
            except psutil.Error:
                return
            if len(rows) % 5 == 0:
                print(f"{name}: {rows[-1][0]:.2f} of {hours:g} h, {rows[-1][1]:.1f} MB", file=sys.stderr, flush=True)


def say(service: str, hours: float, rows: list[tuple[float, float]], seconds: float) -> None:
    """Figures of a service; of what was done when it was cut short."""
    if len(rows) < 8:
        line(f"soak_memory_slope_{service}", None, "MB/h", target=0.0, not_measured="it ended too soon")
        return
    t, memory = np.array(rows).T
    late = t >= 0.5 * t[-1]
    slope = np.polyfit(t[late], memory[late], 1)[0]
    at = {f"MB_at_{share}%": round(float(np.interp(share / 100.0 * t[-1], t, memory)), 1) for share in (5, 25, 50, 100)}
    line(
        f"soak_memory_slope_{service}", round(float(slope), 3), "MB/h", target=0.0, hours=round(float(t[-1]), 2),
        of_hours=hours, **at, second_half_MB=[round(float(f(memory[late])), 1) for f in (min, max)],
        compression=round(3600.0 * t[-1] / seconds),
    )  # fmt: skip


def alone(service: str, hours: float) -> None:
    """A service that needs no other."""
    with tempfile.TemporaryDirectory() as name:
        done, rows, begun = CONTEXT.Value("d", 0.0), [], time.monotonic()
        process = CONTEXT.Process(target=getattr(services, service), args=(Path(name), hours, done), daemon=True)
        process.start()
        watch(service, process, hours, done, rows)
        process.join()
        say(service, hours, rows, time.monotonic() - begun)


def on_a_bus(hours: float) -> None:
    """Router and dashboard, and one who talks to them."""
    bus, done, taken = services.bus_of(), CONTEXT.Value("d", 0.0), CONTEXT.Value("q", 0)
    parts = [
        CONTEXT.Process(target=services.router, args=(bus,), daemon=True),
        CONTEXT.Process(target=services.dashboard, args=(bus, hours, done, taken), daemon=True),
        CONTEXT.Process(target=services.talk, args=(bus, hours, taken), daemon=True),
    ]
    for part in parts:
        part.start()
    begun, found = time.monotonic(), {"router": [], "dashboard": []}
    threads = [
        threading.Thread(target=watch, args=(name, part, hours, done, rows), daemon=True)
        for part, (name, rows) in zip(parts, found.items(), strict=False)
    ]
    for thread in threads:
        thread.start()
    parts[2].join()
    seconds = time.monotonic() - begun
    for part in parts[:2]:
        part.kill()
        part.join()
    for service, rows in found.items():
        say(service, hours, rows, seconds)


def main(hours: float = 8.0, *names: str) -> None:
    """Run side by side and print."""
    names = names or (*ALONE, "dashboard")
    threads = [threading.Thread(target=alone, args=(name, hours)) for name in names if name in ALONE]
    threads += [threading.Thread(target=on_a_bus, args=(hours,))] if "dashboard" in names else []
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 8.0, *sys.argv[2:])
