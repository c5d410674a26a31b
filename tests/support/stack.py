"""The real stack as real processes, for browser tests and benchmarks."""

import re
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import psutil

START = 120.0  # s; a cold compile cache and a busy machine
STOP = 15.0  # s


def free_port() -> int:
    """A TCP port of the loopback that was free a moment ago."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class RunningDemo:
    """`gyrofree demo` in a folder of its own; a context manager."""

    def __init__(
        self,
        folder: Path,
        *arguments: str,
        command: str = "demo",
        python: str | Path = sys.executable,
        environment: dict[str, str] | None = None,
        ports: tuple[int, int] | None = None,
    ) -> None:
        """`python`: of the installation to run; `environment`: all of it, None for this one's;
        `ports`: of page and bus, None for free ones.
        """
        self.folder = folder
        self.port, self.bus_port = ports or (free_port(), free_port())
        folder.mkdir(parents=True, exist_ok=True)
        self.log = folder / "demo.log"
        self._environment = environment
        self._arguments = [
            str(python),
            "-P",
            "-m",
            "gyrofree",
            command,
            *arguments,
            "--folder",
            str(folder / "run"),
            "--port",
            str(self.port),
            "--bus-port",
            str(self.bus_port),
        ]
        self.process: subprocess.Popen | None = None
        self.link = ""

    @property
    def url(self) -> str:
        """Address of the dashboard."""
        return f"http://127.0.0.1:{self.port}"

    @property
    def config(self) -> Path:
        """The configuration that the demo wrote."""
        return self.folder / "run" / "gyrofree.toml"

    def text(self) -> str:
        """The log so far."""
        return self.log.read_text(errors="replace")

    def __enter__(self) -> "RunningDemo":
        with self.log.open("wb") as log:
            self.process = subprocess.Popen(
                self._arguments,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                env=self._environment,
            )
        try:
            self.wait_for(r"open\s+(http://\S+)", START)
        except BaseException:
            self.__exit__()
            raise
        self.link = re.search(r"open\s+(http://\S+)", self.text())[1]
        return self

    def wait_for(self, pattern: str, seconds: float) -> None:
        """Wait for a line of the log."""
        end = time.monotonic() + seconds
        while not re.search(pattern, self.text()):
            if self.process.poll() is not None or time.monotonic() > end:
                raise AssertionError(f"no {pattern!r} in the log:\n{self.text()}")
            time.sleep(0.1)

    def children(self) -> dict[str, psutil.Process]:
        """Processes of the services by the command they run."""
        found = {}
        for process in psutil.Process(self.process.pid).children(recursive=True):
            try:
                words = process.cmdline()
            except psutil.Error:
                continue  # it has just ended
            if "gyrofree" in words:
                name = words[
                    words.index("gyrofree") + 1
                ]  # of a guarded service the child, which is younger
                found[name] = max(process, found.get(name, process), key=lambda p: p.pid)
        return found

    def __exit__(self, *_: object) -> None:
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
        try:
            self.process.wait(STOP)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
