"""Hours of a board at 1 kHz, compressed in time: does the memory of every process stay flat?

    python tests/bench/bench_soak.py [hours, default 8] [services, default all of gateway recorder
    estimator dashboard]

Each service is a process that does what it does live, with the real parts, as fast as it can
(soak_services.py says what); with the dashboard comes a real router. Private memory of each (USS)
is read at every hundredth of the way; the slope is that of a straight line through the second half,
when everything that is kept up to a bound has reached it. Ctrl-C ends it early: the figures are
those of what was done.
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

sys.path[:0] = [
    str(Path(__file__).resolve().parent.parent),
    str(Path(__file__).resolve().parent.parent.parent),
]

import soak_services as services  # noqa: E402
from support.kill_stack import line  # noqa: E402

CONTEXT = multiprocessing.get_context("spawn")
ALONE = ("gateway", "recorder", "estimator")


def watch(
    name: str, process: Any, hours: float, done: Any, rows: list[tuple[float, float]]
) -> None:
    """Private memory of a process, MB, at every hundredth of the way, until it has come to its end
    or died.
    """
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
                print(
                    f"{name}: {rows[-1][0]:.2f} of {hours:g} h, {rows[-1][1]:.1f} MB",
                    file=sys.stderr,
                    flush=True,
                )


def say(service: str, hours: float, rows: list[tuple[float, float]], seconds: float) -> None:
    """Figures of a service."""
    if len(rows) < 8:
        line(
            f"soak_memory_slope_{service}",
            None,
            "MB/h",
            target=0.0,
            not_measured="it ended too soon",
        )
        return
    t, memory = np.array(rows).T
    late = t >= 0.5 * t[-1]
    slope = np.polyfit(t[late], memory[late], 1)[0]
    at = {
        f"MB_at_{share}%": round(float(np.interp(share / 100.0 * t[-1], t, memory)), 1)
        for share in (5, 25, 50, 100)
    }
    line(
        f"soak_memory_slope_{service}",
        round(float(slope), 3),
        "MB/h",
        target=0.0,
        hours=round(float(t[-1]), 2),
        of_hours=hours,
        **at,
        second_half_MB=[round(float(f(memory[late])), 1) for f in (min, max)],
        compression=round(3600.0 * t[-1] / seconds),
    )


def alone(service: str, hours: float, told: dict[str, list]) -> None:
    """A service that needs no other."""
    with tempfile.TemporaryDirectory() as name:
        done = CONTEXT.Value("d", 0.0)
        process = CONTEXT.Process(
            target=getattr(services, service), args=(Path(name), hours, done), daemon=True
        )
        process.start()
        watch(service, process, hours, done, told.setdefault(service, []))
        process.join()


def on_a_bus(hours: float, told: dict[str, list]) -> None:
    """Router and dashboard, and one who talks to them."""
    bus, done, taken = services.bus_of(), CONTEXT.Value("d", 0.0), CONTEXT.Value("q", 0)
    parts = {
        "router": CONTEXT.Process(target=services.router, args=(bus,), daemon=True),
        "dashboard": CONTEXT.Process(
            target=services.dashboard, args=(bus, hours, done, taken), daemon=True
        ),
        "talk": CONTEXT.Process(target=services.talk, args=(bus, hours, taken), daemon=True),
    }
    for part in parts.values():
        part.start()
    talking = parts.pop("talk")
    for name, part in parts.items():
        arguments = (name, part, hours, done, told.setdefault(name, []))
        threading.Thread(target=watch, args=arguments, daemon=True).start()
    talking.join()
    for part in parts.values():
        part.kill()
        part.join()


def main(hours: float = 8.0, *names: str) -> None:
    """Run side by side and print."""
    names, told, begun = names or (*ALONE, "dashboard"), {}, time.monotonic()
    works = [
        threading.Thread(target=alone, args=(name, hours, told), daemon=True)
        for name in names
        if name in ALONE
    ]
    works += (
        [threading.Thread(target=on_a_bus, args=(hours, told), daemon=True)]
        if "dashboard" in names
        else []
    )
    for work in works:
        work.start()
    try:
        for work in works:
            work.join()
    except KeyboardInterrupt:
        print("ended early", file=sys.stderr)
    for service, rows in told.items():
        say(service, hours, rows, time.monotonic() - begun)


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 8.0, *sys.argv[2:])
