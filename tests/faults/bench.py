"""The whole product as real processes around a board on a real pty, for faults to be done to it.

`gyrofree up` looks after all services but the router, which the bench keeps in its own hands so
that it can be away. Where this is root, recordings and journals lie on small disks of their own.
"""

import contextlib
import os
import signal
import subprocess
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Self

import psutil
from support.stack import free_port
from support.wall_clock import SlowSync, WallClock

from faults.board import Board
from faults.disk import Disk
from faults.ground import Ground, services_below
from faults.watch import ESTIMATORS, Watch
from gyrofree.running.process import command
from messages.bus.session import BusSettings
from sites.joining import make_site

ROOT = Path(__file__).resolve().parents[2]
STOP_S = 20.0
SERVICES = ("gateway", "estimator", "record", "procedures", "alarms", "dashboard")
CONFIGURATION = """
[bus]
prefix = "{prefix}"
router = "{router}"
listen = ["{router}"]
lease_ms = 4000
{tls}
[gateway]
journal = "{journals}/gateway"
[[gateway.devices]]
name = "cube"
port = "{folder}/board"
[estimator]
journal = "{journals}/estimates"
axes = "{folder}/axes"
cards = "{folder}/cards"
rate = {estimators}
[recorder]
root = "{sessions}"
[procedures]
root = "{folder}/procedures"
folder = "{folder}/own-procedures"
[alarms]
state = "{folder}/alarms.json"
disk_free_bytes = 1048576
[dashboard]
port = {port}
users = "{folder}/users.json"
sessions_root = "{sessions}"
"""


class Bench(Ground):
    """A context manager; everything of it ends with it."""

    def __init__(self, folder: Path, site: str = "", disk: type[Disk] = Disk) -> None:
        """site: its name, where all links are encrypted and each process has its certificate.
        disk: of what kind those of recordings and journals are. Raises NoDevice.
        """
        self.log = folder / "up.log"
        super().__init__(self.log)
        folder.mkdir(parents=True, exist_ok=True)
        self.folder = folder
        self.sessions, self.journals = disk(folder / "sessions"), disk(folder / "journals")
        self.wall = WallClock(folder / "wall")
        self.sync = SlowSync(folder / "sync", self.wall.environment)
        self.site = folder / "site" if site else None
        if self.site is not None:
            make_site(self.site, site)
        router = f"{'tls' if site else 'tcp'}/127.0.0.1:{free_port()}"
        self.bus = BusSettings(
            prefix=site or "gyrofree", router=router, listen=[router], tls=self.site
        )
        self.port = free_port()
        self.config = folder / "gyrofree.toml"
        self.board = Board(folder / "board")
        self._router: subprocess.Popen | None = None
        self._up: subprocess.Popen | None = None
        self.config.write_text(
            CONFIGURATION.format(
                prefix=self.bus.prefix,
                router=router,
                tls=f'tls = "{self.site}"' if site else "",
                estimators=list(ESTIMATORS),
                folder=folder,
                port=self.port,
                sessions=self.sessions.path,
                journals=self.journals.path,
            )
        )

    def __enter__(self) -> Self:
        try:
            self.start_up()
            self.start_router()
            self.watch = Watch(self.bus)
            self.board.boot()
            self.until(lambda: self._ended() or self.well(), "first picture")
            if self._ended():  # on a machine too busy for its page within a minute
                self.start_up()
                self.until(self.well, "first picture")
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self.wall.set(0.0)
        self.sync.set(0.0)
        if hasattr(self, "watch"):
            self.watch.close()
        self.stop_up()
        self.stop_router()
        self.board.close()
        self.sessions.close()
        self.journals.close()

    def start_up(self) -> None:
        """All services but the router."""
        without = ["--without", "router"]
        if self.site is not None:
            without += ["--without", "site"]  # it would renew what a scenario lets end
        self._up = self._start("up", *without, log=self.log)

    def _ended(self) -> bool:
        return self._up.poll() is not None

    def stop_up(self, number: signal.Signals = signal.SIGTERM) -> float:
        """End them all; how long they took, s."""
        if self._up is None:
            return 0.0
        began = time.monotonic()
        for process in self.children().values():
            process.resume()
        self._up.send_signal(number)
        try:
            self._up.wait(STOP_S)
        except subprocess.TimeoutExpired:
            self._up.kill()
            self._up.wait()
        self.ended, self._up = self._up.returncode, None
        return time.monotonic() - began

    def kill_all(self) -> None:
        """kill -9 of everything at once."""
        for process in [psutil.Process(self._up.pid), *sum(self._all().values(), [])]:
            process.kill()
        self._up.wait()
        self.stop_router()

    def start_router(self) -> None:
        """In a process of its own."""
        self._router = self._start("router", log=self.folder / "router.log")

    def stop_router(self) -> None:
        """With kill -9."""
        if self._router is not None:
            self._router.kill()
            self._router.wait()
            self._router = None

    def _start(self, *words: str, log: Path, config: Path | None = None) -> subprocess.Popen:
        with log.open("ab") as stream:
            return subprocess.Popen(
                command(*words, "--config", str(config or self.config)),
                stdin=subprocess.DEVNULL,
                stdout=stream,
                stderr=stream,
                env=self.sync.environment,
                cwd=self.folder,
            )

    @contextlib.contextmanager
    def another(self, service: str, **changed: object) -> Iterator[subprocess.Popen]:
        """A second process of a service; changed: texts of the configuration and what stands there
        for it.
        """
        text, config = self.config.read_text(), self.config.with_name("another.toml")
        for old, new in changed.items():
            text = text.replace(f"{self.folder}/{old}", f"{self.folder}/{new}")
        config.write_text(text)
        process = self._start(service, log=self.log, config=config)
        try:
            yield process
        finally:
            process.terminate()
            process.wait(STOP_S)

    def children(self) -> dict[str, psutil.Process]:
        """By service its process; of the gateway, which is guarded, the one that serves."""
        return {name: found[-1] for name, found in self._all().items()}

    @property
    def supervisor(self) -> psutil.Process:
        """`gyrofree up`."""
        return psutil.Process(self._up.pid)

    def processes(self, service: str) -> list[psutil.Process]:
        """All of a service, the guardian first."""
        return self._all().get(service, [])

    def _all(self) -> dict[str, list[psutil.Process]]:
        return {} if self._up is None else services_below(self._up.pid)

    def signal(self, service: str, number: signal.Signals) -> None:
        """Send it to a service; "router" is one."""
        os.kill(self.pid(service), number)

    def pid(self, service: str) -> int:
        """Of a service; "router" is one."""
        return self._router.pid if service == "router" else self.children()[service].pid

    def kill(self, service: str) -> None:
        """kill -9, and until there is another one."""
        victim = self.children()[service].pid
        os.kill(victim, signal.SIGKILL)
        self.until(
            lambda: self.children().get(service, psutil.Process(1)).pid not in (victim, 1),
            f"another {service}",
        )

    def freeze(self, service: str, seconds: float) -> None:
        """SIGSTOP, and SIGCONT after so long."""
        self.signal(service, signal.SIGSTOP)
        time.sleep(seconds)
        self.signal(service, signal.SIGCONT)

    def well(self, since_ns: int = 0) -> bool:
        """Is everything there: each service, the newest samples with their estimates, the
        recording without a gap, and the page? since_ns: monotonic; nothing older counts.
        """
        return self.watch.well(since_ns) and self.children().keys() >= set(SERVICES) and self.page()

    def page(self) -> bool:
        """Does the dashboard answer?"""
        try:
            with urllib.request.urlopen(f"http://127.0.0.1:{self.port}/api/health", timeout=1.0):
                return True
        except (urllib.error.URLError, OSError):
            return False
