"""A lab and an office in two network namespaces, all of real processes, and the link between them
in the hands of a scenario. What is counted is the office's copy of the lab's recording.
"""

import hashlib
import json
import os
import random
import subprocess
import sys
import threading
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Self

import psutil
from support.far_link import Line
from support.far_site import ROOT, SITE, FarSite, Watcher, far_site

from faults.bench import SERVICES
from faults.board import Board
from faults.disk import Disk
from faults.ground import Ground, NotWell, services_below
from sites.copying.fetching import load_copies

LINE = Line(rate=10e6, delay_s=0.01)  # a good link: what is done to it is the scenario's
FRESH_S = 3.0  # the newest sample of a well picture is no older
SYN_RETRIES = 2
AT_LAB = {*SERVICES, "router", "site"}
AT_OFFICE = {"router", "site", "dashboard"}
KEPT = (".mcap", ".json")
SEED = 11


class FarWatch:
    """The watch of the lab, which is a process there (far_ear.py)."""

    def __init__(self, site: FarSite) -> None:
        self._process = site.link.a.popen(
            [sys.executable, "-P", "-m", "faults.far_ear", SITE],
            cwd=site.lab,
            env=os.environ | {"PYTHONPATH": os.pathsep.join((str(ROOT), str(ROOT / "tests")))},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        site.processes.append(self._process)
        self._lock = threading.Lock()

    def _ask(self, *words) -> object:
        with self._lock:
            self._process.stdin.write(json.dumps(words) + "\n")
            self._process.stdin.flush()
            line = self._process.stdout.readline()
        if not line:
            raise NotWell("the watch at the lab has ended")
        said = json.loads(line)
        if "refused" in said:
            raise NotWell(said["refused"])
        return said["is"]

    def begin(self) -> None:
        """Forget what was said so far."""
        self._ask("begin")

    def record(self, name: str) -> None:
        """Begin a session at the lab."""
        self._ask("record", name)

    def stop(self) -> None:
        """End it."""
        self._ask("stop")

    def well(self, since_ns: int) -> bool:
        """Is all well at the lab?"""
        return self._ask("well", since_ns)

    @property
    def alarms(self) -> set[str]:
        """Ids that were ever active since `begin`."""
        return set(self._ask("state")["alarms"])

    @property
    def active(self) -> set[str]:
        """Ids that are."""
        return set(self._ask("state")["active"])

    @property
    def recording(self) -> list[str]:
        """Sessions since `begin`."""
        return self._ask("state")["recording"]

    @property
    def durable(self) -> dict[str, int]:
        """By session the messages that the recorder acknowledged."""
        return self._ask("state")["durable"]


class FarBench(Ground):
    """A context manager; everything of it ends with it. Raises NoNamespaces."""

    def __init__(self, folder: Path) -> None:
        self.lab, self.office = folder / "lab", folder / "office"
        super().__init__(self.lab / "up.log", self.office / "up.log")
        self._folder, self._open = folder, ExitStack()

    def __enter__(self) -> Self:
        with ExitStack() as opened:
            self.sessions = Disk(self.office / "var" / "sessions")
            opened.callback(self.sessions.close)
            board = Board(self.lab / "board")
            opened.callback(board.close)
            board.boot()
            self.site = opened.enter_context(
                far_site(self._folder, LINE, services=(), syn_retries=SYN_RETRIES, board=None)
            )
            self.link = self.site.link
            self._lab_up = self.site.processes[-1]
            self._office_up = self._begin_office()
            self.watcher = Watcher(self.site)
            self.watch = FarWatch(self.site)
            self.until(self.well, "first picture at the office")
            self._open = opened.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._open.close()

    def _begin_office(self) -> subprocess.Popen:
        return self.site.begin(self.link.b, self.office, "up")

    def at(self, place: str) -> dict[str, list[psutil.Process]]:
        """The services of "lab" or "office"."""
        up = self._lab_up if place == "lab" else self._office_up
        return {} if up.poll() is not None else services_below(up.pid)

    def kill(self, place: str, service: str) -> None:
        """kill -9 of one, and until there is another."""
        victim = self.at(place)[service][-1]
        victim.kill()
        self.until(
            lambda: [p for p in self.at(place).get(service, ()) if p.pid != victim.pid],
            f"another {service} at the {place}",
        )

    def power(self, place: str, off_s: float) -> None:
        """kill -9 of everything of a place at once; after a while it is switched on."""
        up = self._lab_up if place == "lab" else self._office_up
        for process in [psutil.Process(up.pid), *sum(self.at(place).values(), [])]:
            process.kill()
        up.wait()
        self.site.processes.remove(up)
        time.sleep(off_s)
        if place == "lab":
            self._lab_up = self.site.begin(self.link.a, self.lab, "up")
        else:
            self._office_up = self._begin_office()

    def well(self, since_ns: int = 0) -> bool:
        """Is everything there, at both places, and the picture at the office?"""
        since_s = time.time() - 1e-9 * (time.monotonic_ns() - since_ns)
        return (
            self.watcher.newest > max(since_s, time.time() - FRESH_S)
            and self.at("lab").keys() >= AT_LAB
            and self.at("office").keys() >= AT_OFFICE
            and self.watch.well(since_ns)
        )

    def settle(self) -> None:
        """Until the copies of what was recorded are equal."""
        for session in self.watch.recording:
            self.until(lambda session=session: self.equal(session), f"copy of {session}")

    def ballast(self, number: int, size: int) -> str:
        """A recording of random bytes at the lab, so that there is something to copy: its name."""
        session = f"20200101-0000{number:02d}-ballast"
        folder = self.lab / "var" / "sessions" / session
        folder.mkdir(parents=True)
        (folder / "recording.mcap").write_bytes(random.Random(SEED + number).randbytes(size))
        (folder / "session.json").write_text(json.dumps({"id": session, "state": "closed"}))
        return session

    def begun(self, session: str) -> bool:
        """Is its copy on the way, and not there yet?"""
        part = self.sessions.path / session / "recording.mcap.part"
        return part.exists() and part.stat().st_size > 0

    def equal(self, session: str) -> bool:
        """Has the office every file of it, byte for byte, and a proof that says so?"""
        there, here = self.lab / "var" / "sessions" / session, self.sessions.path / session
        proof = load_copies(self.office / "var" / "site").get(session, {}).get("files", {})
        names = sorted(p.name for p in there.iterdir() if p.suffix in KEPT)
        if not names or not proof.keys() >= set(names):
            return False
        return all(
            (here / name).exists()
            and sha256(there / name) == sha256(here / name)
            and set(proof[name].values()) == {sha256(here / name)}
            for name in names
        )


def sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
