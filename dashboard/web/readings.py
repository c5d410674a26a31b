"""Curves of recordings for the pages: made by a process of their own, so that scene and pages never
wait for them.
"""

import logging
import os
import shutil
import subprocess
import sys
import threading
from collections import OrderedDict
from dataclasses import dataclass, field
from pathlib import Path

from sessions.library.curves import Curves, load, stamp
from sessions.library.curves_build import LONG_CHUNKS, build, ensure
from sessions.library.scan import extent

log = logging.getLogger(__name__)

SHORT = 8_000_000  # bytes of a recording that is read here: starting a process would take longer
KEPT = 8  # sessions in memory, some MB each
AT_ONCE = 2  # processes


@dataclass
class Reading:
    """A recording that is being read."""

    done: float = 0.0  # share, 0 to 1
    fault: str = ""  # why it ended without a result
    of: list[int] = field(default_factory=list)  # state of the recording


class Readings:
    """Asks for curves, starts what makes them, remembers the latest."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._slots = threading.Semaphore(AT_ONCE)
        self._running: dict[Path, Reading] = {}
        self._failed: dict[Path, Reading] = {}
        self._kept: OrderedDict[Path, tuple[list[int], Curves]] = OrderedDict()
        self._processes: set[subprocess.Popen[str]] = set()
        self._closed = False

    def get(self, path: Path) -> tuple[Curves | None, Reading | None]:
        """(the curves or None, the reading that goes on or failed or None). A first, coarse form
        comes early.

        Raises OSError when the recording is not there.
        """
        now = stamp(path)
        with self._lock:
            kept = self._kept.get(path)
            if kept is not None and kept[0] == now and not kept[1].coarse:
                self._kept.move_to_end(path)
                return kept[1], None
        found = load(path)
        if found is not None:
            self._keep(path, now, found)
            return found, None
        with self._lock:
            found = kept[1] if kept is not None and kept[0] == now else None
            failed = self._failed.get(path)
            if failed is not None and failed.of == now:
                return found, failed
            reading = self._running.get(path)
            if reading is None and not self._closed:
                reading = self._running[path] = Reading(of=now)
                threading.Thread(
                    target=self._read, args=(path, reading), name="curves", daemon=True
                ).start()
        return found, reading

    def close(self) -> None:
        """End what runs."""
        with self._lock:
            self._closed = True
            for process in self._processes:
                process.terminate()

    def _keep(self, path: Path, now: list[int], found: Curves) -> None:
        with self._lock:
            self._kept[path] = (now, found)
            self._kept.move_to_end(path)
            while len(self._kept) > KEPT:
                self._kept.popitem(last=False)

    def _read(self, path: Path, reading: Reading) -> None:
        """A short one here; else one process, its numbers are the share done."""
        try:
            if reading.of[0] < SHORT:
                self._read_here(path, reading)
            else:
                self._read_there(path, reading)
        except Exception as error:  # whatever it was, nobody may wait for it for ever
            log.exception("%s", path)
            reading.fault = str(error) or type(error).__name__
        with self._lock:
            self._running.pop(path, None)
            if reading.fault:
                self._failed[path] = reading
                while len(self._failed) > 64:
                    self._failed.pop(next(iter(self._failed)))

    def _read_here(self, path: Path, reading: Reading) -> None:
        try:
            self._keep(path, reading.of, ensure(path))
        except (OSError, ValueError) as error:
            reading.fault = str(error)

    def _read_there(self, path: Path, reading: Reading) -> None:
        """A first look here, a second of work at most; all of it in a process of its own."""
        try:
            if extent(path).chunks > LONG_CHUNKS:
                self._keep(path, reading.of, build(path, coarse=True))
        except (OSError, ValueError) as error:
            reading.fault = str(error)
            return
        nice = ["nice", "-n", "5"] if shutil.which("nice") else []
        with self._slots:
            try:
                process = subprocess.Popen(
                    [*nice, sys.executable, "-P", "-m", "sessions.library.curves_build", str(path)],
                    stdin=subprocess.DEVNULL,
                    stdout=subprocess.PIPE,
                    stderr=subprocess.PIPE,
                    text=True,
                    env=os.environ | {"OMP_NUM_THREADS": "1"},
                )
            except OSError as error:
                reading.fault = f"the recording cannot be read: {error.strerror}"
            else:
                with self._lock:
                    self._processes.add(process)
                self._follow(process, reading)

    def _follow(self, process: subprocess.Popen[str], reading: Reading) -> None:
        assert process.stdout is not None and process.stderr is not None
        with process:
            for line in process.stdout:
                try:
                    reading.done = float(line)
                except ValueError:
                    continue
            said = process.stderr.read().strip().splitlines()
        with self._lock:
            self._processes.discard(process)
        if process.returncode:
            reading.fault = said[-1] if said else f"reading ended with code {process.returncode}"
