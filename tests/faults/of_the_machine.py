"""Faults of what a machine gives its processes: memory, files, and journals that it damages."""

import contextlib
import itertools
import os
import resource
import signal
import time
from collections.abc import Iterator
from pathlib import Path

import psutil

from faults.bench import SERVICES, Bench
from faults.board import Board
from faults.scenario import Alarmed, Brief, Line, Scenario

GROUPS = Path("/sys/fs/cgroup")
LEAST = 65536  # bytes of memory; the next page that is wanted is one too many
LATEST = 24  # bytes of a journal that are spoilt
SHUT_S = 8.0  # that no file can be opened
TWINS_S = 6.0


def no_groups(bench: Bench) -> str:
    """Why no service can be short of memory here."""
    try:
        with memory_group():
            return ""
    except OSError as error:
        return f"no group of processes with a limit of memory can be made here: {error}"


@contextlib.contextmanager
def memory_group() -> Iterator[tuple[Path, Path]]:
    """A control group: the file of its processes, and that of its limit. Raises OSError."""
    old = (GROUPS / "memory").is_dir()  # version 1
    group = (GROUPS / "memory" if old else GROUPS) / f"gyrofree-faults-{os.getpid()}"
    limit = group / ("memory.limit_in_bytes" if old else "memory.max")
    group.mkdir()
    try:
        limit.write_text(str(1 << 40))
        yield group / "cgroup.procs", limit
    finally:
        group.rmdir()


def out_of_memory(bench: Bench, service: str) -> None:
    """The kernel kills it, as its group has no memory left."""
    victim = bench.children()[service]
    with memory_group() as (processes, limit):
        processes.write_text(str(victim.pid))
        limit.write_text(str(LEAST))
        bench.until(lambda: not victim.is_running(), f"end of {service}")
    bench.until(lambda: service in bench.children(), f"another {service}")


def lowest_free(process: psutil.Process) -> int:
    """The number that its next file would have; one that has closed some has gaps."""
    used = {int(entry.name) for entry in Path(f"/proc/{process.pid}/fd").iterdir()}
    return next(number for number in itertools.count() if number not in used)


def no_more_files(bench: Bench) -> None:
    """No process may open one, neither file nor connection; the page is asked meanwhile."""
    before: list[tuple[psutil.Process, tuple[int, int]]] = []
    for service in SERVICES:
        for process in bench.processes(service):
            limits = process.rlimit(resource.RLIMIT_NOFILE)
            process.rlimit(resource.RLIMIT_NOFILE, (lowest_free(process), limits[1]))
            before.append((process, limits))
    try:
        end = time.monotonic() + SHUT_S
        while time.monotonic() < end:
            bench.page()
            time.sleep(0.2)
        bench.hear("recorder", "disk-state")
    finally:
        for process, limits in before:
            with contextlib.suppress(psutil.NoSuchProcess):
                process.rlimit(resource.RLIMIT_NOFILE, limits)


def spoilt_tail(bench: Bench) -> None:
    """The newest bytes of the gateway's journal are others when it is started again."""
    victim = bench.children()["gateway"]
    victim.send_signal(signal.SIGSTOP)
    try:
        folder = bench.journals.path / "gateway"
        newest = max(folder.rglob("*.gfj"), key=lambda path: path.stat().st_mtime_ns)
        with newest.open("r+b") as stream:
            stream.seek(-LATEST, os.SEEK_END)
            stream.write(b"\xa5" * LATEST)
    finally:
        victim.kill()
    bench.until(
        lambda: bench.children().get("gateway", victim).pid != victim.pid, "another gateway"
    )


def second_gateway(bench: Bench) -> None:
    """Another one with the same configuration, for a while."""
    with bench.another("gateway"):
        time.sleep(TWINS_S)


def second_board(bench: Bench) -> None:
    """Another gateway with another board of the same name, for a while."""
    board = Board(bench.folder / "board2")
    board.boot()
    try:
        with bench.another("gateway", board="board2", journals="journals2"):
            time.sleep(TWINS_S)
            bench.hear("twin-cube")
    finally:
        board.close()


MACHINE = (
    Scenario(
        "recorder out of memory",
        "its control group has no memory left, and the kernel kills it",
        lambda bench: out_of_memory(bench, "record"),
        said=(Line("record ended by signal SIGKILL: starting it again"), Line("going on where")),
        needs=no_groups,
    ),
    Scenario(
        "gateway out of memory",
        "its control group has no memory left, and the kernel kills it",
        lambda bench: out_of_memory(bench, "gateway"),
        said=(Line("killed by SIGKILL: starting again"),),
        needs=no_groups,
    ),
    Scenario(
        "no file can be opened",
        f"neither file nor connection, for {SHUT_S:g} s and until that is said; the page is asked",
        no_more_files,
        said=(
            Alarmed("recorder"),
            Alarmed("disk-state"),
            Line("no file is left for another connection"),
            Brief(100),
        ),
    ),
    Scenario(
        "end of the gateway's journal spoilt",
        f"its newest {LATEST} bytes are others when it is killed and comes again",
        spoilt_tail,
        said=(Line("cut a torn tail"), Line("killed by SIGKILL: starting again")),
    ),
    Scenario(
        "second gateway of the same board",
        f"`gyrofree gateway` with the same configuration runs beside the first for {TWINS_S:g} s",
        second_gateway,
        said=(Line("another gateway writes it"),),
    ),
    Scenario(
        "second board of the same name",
        "another gateway, with another board and journal, beside the first until that is said",
        second_board,
        said=(Alarmed("twin-cube"),),
    ),
)
