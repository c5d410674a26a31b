"""The thread between a port and the queue: read, journal, hand on; reopen what was lost.

It sleeps in poll() until bytes come, so an idle line costs nothing and a byte is never older than
the scheduler makes it.
"""

import logging
import os
import select
import threading
import time
from dataclasses import dataclass

from gateway.ports.backlog import LINE_BYTES_S, Backlog, Pace
from gateway.ports.keeper import Keeper
from gateway.ports.ports import Port, PortEnd, PortError, adopt_port, open_port
from messages.bus.turning import Loop
from messages.history.journal import Journal

log = logging.getLogger(__name__)

FIRST_RETRY_S = 0.1
LAST_RETRY_S = 2.0
LOOK_MS = 200  # a silent port is looked at so often, so that silence is told from being stopped
HOLD_S = 0.02
OPEN_S = 20.0  # that a port may take to be opened: over a network it has a conversation first
STOPPED_NS = 450_000_000  # between two looks: this process was stopped, or got no processor


@dataclass(frozen=True, slots=True)
class Chunk:
    """One read. monotonic_ns: just after the last byte was read; late: the process had been
    stopped, and the bytes may have waited in the port for it.
    """

    channel: int
    data: bytes
    monotonic_ns: int
    late: bool = False


class Reader:
    """Reads one port on its own thread into `out`; journals first."""

    def __init__(
        self,
        url: str,
        baud: int,
        channel: int,
        journal: Journal,
        out: "Backlog[Chunk]",
        keeper: Keeper,
        time_scale: float = 1.0,
    ) -> None:
        self.url = url
        self.baud = baud
        self.connected = False
        self.message = f"{url}: not opened yet"
        self.reconnects = 0
        self.held = 0  # times that reading waited, as more came than can be decoded
        self.held_at: float | None = None  # s, monotonic, of the last one
        self._came_ns = self._empty_ns = 0  # last bytes, and the last look that found none
        self._rate = LINE_BYTES_S * max(1.0, time_scale)
        self._opened = 0
        self._channel = channel
        self._journal = journal
        self._keeper = keeper
        self._out = out
        self._port: Port | None = None
        self._stop = threading.Event()
        self._wake_out, self._wake_in = os.pipe()
        self._thread = threading.Thread(target=self._run, name=f"reader-{url}", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop and wait for the thread."""
        self._stop.set()
        os.write(self._wake_in, b"x")
        self._thread.join()
        os.close(self._wake_in)
        os.close(self._wake_out)

    @property
    def silent_s(self) -> float:
        """For how long nothing came that is known: to the last look at the port that found none."""
        return max(0, self._empty_ns - self._came_ns) * 1e-9

    def write(self, data: bytes) -> None:
        """Send to the board; raises PortError when the port is not open or does not take it."""
        port = self._port
        if port is None:
            raise PortError(self.message or f"{self.url}: not open")
        port.write(data)

    def _run(self) -> None:
        with Loop(f"reader {self.url}") as loop:
            self._read(loop)

    def _read(self, loop: Loop) -> None:
        """Until it is told to stop."""
        retry_s = FIRST_RETRY_S
        while not self._stop.is_set():
            try:
                with loop.during("opening the port", OPEN_S):
                    port = self._open()
            except (PortError, ValueError) as error:
                self._say(str(error))
                self._stop.wait(retry_s)
                retry_s = min(2 * retry_s, LAST_RETRY_S)
                continue
            retry_s = FIRST_RETRY_S
            self._opened += 1
            self.reconnects = self._opened - 1
            self.connected, self.message = True, ""
            self._port = port
            self._out.put(Chunk(self._channel, b"", time.monotonic_ns()))  # says that it is open
            log.info("%s: open", self.url)
            try:
                self._read_until_lost(port, loop)
            except PortEnd as end:
                self._say(str(end))
                while not self._stop.wait(LOOK_MS * 1e-3):
                    loop.turn()
            except PortError as error:
                self._say(str(error))
                self._stop.wait(FIRST_RETRY_S)  # a port that opens and closes at once must not spin
            finally:
                self.connected, self._port = False, None
                self._keeper.drop(self.url)
                port.close()

    def _open(self) -> Port:
        """The port, as an earlier life of this gateway left it or newly opened. Raises PortError,
        ValueError.
        """
        left = self._keeper.take(self.url)
        if left is None:
            port = open_port(self.url, self.baud)
            if port.keepable:
                self._keeper.keep(self.url, port.fileno())
            return port
        offset_ns = time.time_ns() - time.monotonic_ns()
        for data, monotonic_ns in left.read:
            self._take(data, monotonic_ns, monotonic_ns + offset_ns)
        return adopt_port(self.url, left.fd)

    def _take(self, data: bytes, monotonic_ns: int, utc_ns: int, late: bool = False) -> None:
        self._journal.append(self._channel, data, monotonic_ns, utc_ns)
        self._out.put(Chunk(self._channel, data, monotonic_ns, late))

    def _read_until_lost(self, port: Port, loop: Loop) -> None:
        poller = select.poll()
        poller.register(port.fileno(), select.POLLIN)
        poller.register(self._wake_out, select.POLLIN)
        self._came_ns = time.monotonic_ns()
        looked, late, pace = time.monotonic_ns(), False, Pace(self._rate)
        while not self._stop.is_set():
            loop.turn()
            if self._out.full(self._channel):
                self._hold(HOLD_S)
                looked, late = time.monotonic_ns(), True
                continue
            ready = poller.poll(0)
            if not ready:
                late = False  # nothing of the time before is left
                ready = poller.poll(LOOK_MS)
            if self._stop.is_set():
                return
            now = time.monotonic_ns()
            late, looked = late or now - looked > STOPPED_NS, now
            data = port.read() if ready else b""
            if not ready:
                self._empty_ns = now
            if data:
                self._came_ns = time.monotonic_ns()
                self._take(data, time.monotonic_ns(), time.time_ns(), late)
            if not port.is_file and (wait_s := pace.wait_s(len(data))) > 0.0:
                self._hold(wait_s)
                looked, late = time.monotonic_ns(), True

    def _hold(self, seconds: float) -> None:
        """Read later: what comes now is too much."""
        self.held += 1
        self.held_at = time.monotonic()
        if self.held & (self.held - 1) == 0:  # a flood stays readable
            log.warning("%s: more comes than can be taken (%d so far)", self.url, self.held)
        self._stop.wait(seconds)

    def _say(self, message: str) -> None:
        if message != self.message:
            log.warning("%s", message)
        self.connected, self.message = False, message
