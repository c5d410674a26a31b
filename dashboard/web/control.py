"""Replays that the pages start, each in a process of its own."""

import subprocess
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol


class ControlError(RuntimeError):
    """An order that was not carried out; the text says why and what to do."""


class Replay(Protocol):
    """How the pages start a replay through the bus; the composition root says how it is done."""

    def start(self, path: Path, speed: float, at_s: float = 0.0) -> None:
        """Begin in the background, at this second of it; raises ControlError."""

    def stop(self) -> None:
        """End what runs."""

    def running(self) -> Path | None:
        """The recording that is being replayed."""


class ProcessReplay:
    """Replay in a process of its own: `<command> <path> --speed N`; one at a time."""

    def __init__(self, command: Sequence[str], look_s: float = 0.5) -> None:
        self._command, self._look_s = (
            list(command),
            look_s,
        )  # look_s: how long start() waits for an early end
        self._lock = threading.Lock()
        self._process: subprocess.Popen | None = None
        self._path: Path | None = None

    def start(self, path: Path, speed: float, at_s: float = 0.0) -> None:
        """Begin in the background; raises ControlError when one runs or the command cannot be
        started.
        """
        with self._lock:
            if self._alive():
                raise ControlError("a replay runs already: stop it first")
            command = [*self._command, str(path), "--speed", f"{speed:g}"]
            command += ["--at", f"{at_s:g}"] if at_s else []
            try:
                self._process = subprocess.Popen(
                    command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL
                )
            except OSError as error:
                raise ControlError(f"{command[0]}: {error.strerror}: no replay") from None
            self._path = path
            # a recording that cannot be opened ends the process at once; then say so to the one who
            # clicked
            try:
                code = self._process.wait(self._look_s)
            except subprocess.TimeoutExpired:
                return
            if code:
                raise ControlError(
                    f"replay of {path.name} ended at once with code {code}: see the log"
                )

    def stop(self) -> None:
        """End what runs: SIGTERM, after 3 s SIGKILL."""
        with self._lock:
            if not self._alive() or self._process is None:
                return
            self._process.terminate()
            try:
                self._process.wait(3.0)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()

    def running(self) -> Path | None:
        """The recording that is being replayed."""
        return self._path if self._alive() else None

    def _alive(self) -> bool:
        return self._process is not None and self._process.poll() is None
