"""What the pages know of the bus and what they can order: devices, recorder, replay."""

import logging
import subprocess
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

import zenoh

from messages.bus.session import decode, subscribe
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import (
    BOARD,
    ESTIMATOR,
    LINK,
    NAME,
    RECORDER,
    STATUS,
    parse,
    recorder_control_key,
)

log = logging.getLogger(__name__)

DEVICES = 64  # devices remembered; a foreign publisher cannot fill the memory
ANSWER_S = 10.0  # s, for the recorder to close a file


class ControlError(RuntimeError):
    """An order that was not carried out; the text says why and what to do."""


class Device:
    """The newest messages of one device, and when they came (s, monotonic)."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.seen = time.monotonic()
        self.link: pb.LinkStatus | None = None
        self.board: pb.BoardInfo | None = None
        self.estimators: dict[str, pb.EstimatorStatus] = {}

    @property
    def age_s(self) -> float:
        """Time since its last link status, s."""
        return time.monotonic() - self.seen


class BusWatch:
    """Newest state of all devices and of the recorder, from the topics that come at 1 Hz or
    less.
    """

    def __init__(self, session: zenoh.Session, prefix: str) -> None:
        self._lock = threading.Lock()
        self._devices: dict[str, Device] = {}
        self._recorder: tuple[float, pb.RecorderStatus] | None = None
        topics = (LINK, BOARD, ESTIMATOR, STATUS)
        self._subscribers = [
            subscribe(session, topic, prefix, self._on_message) for topic in topics
        ]

    def _on_message(self, key: str, message: object) -> None:
        address = parse(key)
        with self._lock:
            if isinstance(message, pb.RecorderStatus):
                self._recorder = (time.monotonic(), message)
                return
            if not NAME.fullmatch(address.device) or address.device == RECORDER:
                return
            if address.device not in self._devices and len(self._devices) >= DEVICES:
                return
            device = self._devices.setdefault(address.device, Device(address.device))
            if isinstance(message, pb.LinkStatus):
                device.link, device.seen = message, time.monotonic()
            elif isinstance(message, pb.BoardInfo):
                device.board = message
            elif isinstance(message, pb.EstimatorStatus) and len(device.estimators) < DEVICES:
                device.estimators[address.estimator] = message

    def devices(self) -> list[Device]:
        """All devices heard of, by name."""
        with self._lock:
            return [self._devices[name] for name in sorted(self._devices)]

    def recorder(self) -> tuple[float, pb.RecorderStatus] | None:
        """Age in s and newest state of the recorder; None before its first word."""
        with self._lock:
            return (
                (time.monotonic() - self._recorder[0], self._recorder[1])
                if self._recorder
                else None
            )


class RecorderControl:
    """Orders to the recorder, as queries on the bus."""

    def __init__(self, session: zenoh.Session, prefix: str) -> None:
        self._session, self._key = session, recorder_control_key(prefix)

    def order(self, action: int, user: str, name: str = "", note: str = "") -> pb.RecorderStatus:
        """Send one order and wait for the answer, up to 10 s; raises ControlError."""
        command = pb.RecorderCommand(action=action, name=name, note=note, user=user)
        payload = command.SerializeToString()
        for reply in self._session.get(self._key, payload=payload, timeout=ANSWER_S):
            if reply.ok is None:
                raise ControlError(
                    f"recorder: {reply.err.payload.to_bytes().decode(errors='replace')[:500]}"
                )
            status = decode(STATUS, reply.ok.payload.to_bytes())
            if status is not None:
                return status
        raise ControlError(
            "the recorder does not answer: see that `gyrofree record` runs and reaches the router"
        )


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
