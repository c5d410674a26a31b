"""A site of two places over an emulated link, all of real processes: a lab with a simulated board,
and an office that watches it.
"""

import contextlib
import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from support.far_link import FarLink, Line, Place, far_link

GYROFREE = [sys.executable, "-P", "-m", "gyrofree"]
ROOT = Path(__file__).resolve().parents[2]
PATHS = os.pathsep.join((str(ROOT), str(ROOT / "tests")))
SITE, DEVICE = "lab", "cube"
START_S = 90.0  # for everything to run and the first picture to come; a busy machine takes its time
STOP_S = 20.0
PROFILE = ("--profile", "wobble")
BOARD = f"""
[[gateway.devices]]
name = "{DEVICE}"
port = "board"
layout = "cube"
"""


@dataclass
class FarSite:
    """Two folders with a configuration each, and what runs in them."""

    link: FarLink
    lab: Path
    office: Path
    processes: list[subprocess.Popen]

    def begin(self, place: Place, folder: Path, *words: str, **options) -> subprocess.Popen:
        """`gyrofree WORDS` at a place, its output in a file there."""
        with (folder / f"{words[0]}.log").open("a") as stream:
            options = {"stdout": stream, "stderr": subprocess.STDOUT} | options
            process = place.popen(
                [*GYROFREE, *words],
                cwd=folder,
                env=os.environ | {"PYTHONPATH": str(ROOT)},
                start_new_session=True,
                **options,
            )
        self.processes.append(process)
        return process

    def run(self, place: Place, folder: Path, *words: str) -> str:
        """`gyrofree WORDS` to its end: what it printed."""
        done = place.run(
            [*GYROFREE, *words], cwd=folder, env=os.environ | {"PYTHONPATH": str(ROOT)}
        )
        return done.stdout

    def order(self, *words: str) -> None:
        """To the lab's recorder: "start", NAME or "stop" (far_order.py)."""
        self.link.a.run(
            [sys.executable, "-P", "-m", "support.far_order", SITE, *words],
            cwd=self.lab,
            env=os.environ | {"PYTHONPATH": PATHS},
        )

    def close(self) -> None:
        """End all that was begun, the last first."""
        for process in reversed(self.processes):
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGTERM)
        for process in reversed(self.processes):
            try:
                process.wait(STOP_S)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()


@contextlib.contextmanager
def far_site(
    folder: Path,
    line: Line,
    settings: str = "",
    office: str = "",
    services: tuple[tuple[str, ...], ...] = (("up",),),
    congestion: str = "cubic",
    syn_retries: int = 0,
    lab: tuple[str, ...] = ("up",),
    board: tuple[str, ...] | None = (),
    zenohd: Path | None = None,
) -> Iterator[FarSite]:
    """Made and joined as docs/sites.md says, with `lab` at the lab and `services` at the office.

    congestion: how TCP takes losses; CUBIC is what most machines have. syn_retries: of TCP's first
    packet; 0: as the machine has it. board: further words of `gyrofree simulate`; None: nothing is
    simulated, the lab's port is `board` in its folder. zenohd: the program that routes at both.
    settings, office: further lines of the gyrofree.toml of the lab and of the office. Raises
    NoNamespaces.
    """
    with far_link(Line()) as link:
        made = FarSite(link, folder / "lab", folder / "office", [])
        made.lab.mkdir(parents=True, exist_ok=True)
        made.office.mkdir(parents=True, exist_ok=True)
        for place in (link.a, link.b):
            place.congestion(congestion)
            if syn_retries:
                place.sysctl("net.ipv4.tcp_syn_retries", str(syn_retries))
        try:
            _join(made)
            _append(made.lab, BOARD + settings)
            _append(made.office, office)
            if zenohd is not None:
                for folder in (made.lab, made.office):
                    _route_by(folder / "gyrofree.toml", zenohd)
            link.line = line
            if board is not None:
                made.begin(link.a, made.lab, "simulate", "--link", "board", *PROFILE, *board)
            made.begin(link.a, made.lab, *lab)
            for words in services:
                made.begin(link.b, made.office, *words)
            yield made
        finally:
            made.close()


def _append(folder: Path, text: str) -> None:
    with (folder / "gyrofree.toml").open("a") as stream:
        stream.write(text)


def _route_by(config: Path, zenohd: Path) -> None:
    text = config.read_text()
    assert text.count("[bus]\n") == 1
    config.write_text(text.replace("[bus]\n", f'[bus]\nzenohd = "{zenohd}"\n'))


def _join(made: FarSite) -> None:
    link = made.link
    made.run(link.a, made.lab, "site", "init", SITE, "--simulator")
    given = made.run(link.a, made.lab, "site", "invite", "office", "--address", link.b.address)
    router = made.begin(link.a, made.lab, "router")
    serving = made.begin(link.a, made.lab, "site", "serve")
    made.run(link.b, made.office, "site", "join", given.strip())
    for process in (serving, router):
        os.killpg(process.pid, signal.SIGTERM)
        process.wait(STOP_S)
        made.processes.remove(process)


class Watcher:
    """What an office's page has of the board (far_watch.py), as it comes."""

    def __init__(self, site: FarSite, live: str = "auto") -> None:
        self._process = site.link.b.popen(
            [sys.executable, "-P", "-m", "support.far_watch", SITE, DEVICE, live],
            cwd=site.office,
            env=os.environ | {"PYTHONPATH": PATHS},
            stdout=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        site.processes.append(self._process)
        self.lines: list[dict] = []  # without their rows
        self.rows: list[float] = []  # UTC of the newest that was told in full, s
        threading.Thread(target=self._read, daemon=True).start()

    @property
    def newest(self) -> float:
        """UTC of the newest sample, s."""
        return self.lines[-1]["newest"] if self.lines else 0.0

    def _read(self) -> None:
        for text in self._process.stdout:
            line = json.loads(text)
            rows = line.pop("rows")
            self.rows = rows if len(rows) > 1 else self.rows
            self.lines.append(line)


def until(condition: Callable[[], bool], seconds: float, what: str) -> float:
    """Wait for it; how long it took, s. Raises TimeoutError."""
    begin = time.monotonic()
    while not condition():
        if time.monotonic() > begin + seconds:
            raise TimeoutError(f"not within {seconds:g} s: {what}")
        time.sleep(0.05)
    return time.monotonic() - begin
