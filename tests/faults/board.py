"""A board on a real pseudo-terminal whose cable and power a scenario holds in its hands."""

import itertools
import random
import threading
import time
from collections.abc import Iterator
from pathlib import Path

from gateway.virtual.board_link import PtyLink
from gateway.virtual.virtual_board import SIMULATED, BoardAccel, BoardPulse, Item, VirtualBoard
from inertial.simulation.table import BLOCK, TableTest

PERIOD_S = 0.01
AXES = 12
JOIN_S = 10.0
SEED = 7


class Cable:
    """The board's end of the line, which can be pulled, cut through and made to babble."""

    def __init__(self, path: Path) -> None:
        self._path, self._lock = path, threading.RLock()
        self._pty: PtyLink | None = PtyLink(path)
        self._cut_next = self._mute = False

    @property
    def connected(self) -> bool:
        """True while somebody has the port open."""
        with self._lock:
            return self._pty is not None and self._pty.connected

    def write(self, data: bytes) -> bool:
        """A frame; False when the board had to drop it."""
        with self._lock:
            if self._pty is None or self._mute:
                return True  # into the air
            if self._cut_next:
                data, self._cut_next = data[: len(data) // 2], False
            return self._pty.write(data)

    def read(self) -> bytes:
        """What the host said."""
        with self._lock:
            return b"" if self._pty is None else self._pty.read()

    def unplug(self) -> None:
        """Out with it; the port is gone."""
        with self._lock:
            if self._pty is not None:
                self._pty.close()
                self._pty = None

    def plug(self) -> None:
        """In again; the port is another one under the old name, as udev makes it."""
        with self._lock:
            self._pty = self._pty or PtyLink(self._path)

    def babble(self, data: bytes) -> None:
        """Bytes that no board sent, between two frames, in pieces that the line can take."""
        for start in range(0, len(data), 1024):
            with self._lock:
                while not self._pty.write(data[start : start + 1024]):
                    time.sleep(0.01)

    def cut_a_frame(self) -> None:
        """Of the next frame only the first half gets through."""
        with self._lock:
            self._cut_next = True

    def mute(self, silent: bool) -> None:
        """The wire to the host is broken inside, or whole again; the port is there."""
        with self._lock:
            self._mute = silent


class Board:
    """The simulated cube on its table."""

    def __init__(self, path: Path) -> None:
        self.cable = Cable(path)
        self._boots = itertools.count(1)
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None

    def boot(self) -> None:
        """Switch it on."""
        self._stop = threading.Event()
        number = next(self._boots)
        board = VirtualBoard(self.cable, SIMULATED, epoch=number, sample_period_s=PERIOD_S)
        self._thread = threading.Thread(
            target=board.run, args=(_items(number), self._stop), daemon=True
        )
        self._thread.start()

    def off(self) -> None:
        """Switch it off."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join(JOIN_S)
            self._thread = None

    def close(self) -> None:
        """Switch it off and take it away."""
        self.off()
        self.cable.unplug()


def garbage(size: int, seed: int = SEED) -> bytes:
    """Random bytes; the end of them ends a frame that they may seem to begin."""
    return random.Random(seed).randbytes(size) + b"\0"


def _items(run: int) -> Iterator[Item]:
    """Samples and pulses of the published test, again and again."""
    test = TableTest(seed=SEED, run=run)
    for number in itertools.count():
        block = test.block(number)
        pulses = iter(test.pulses(float(block.t_s[0]), float(block.t_s[-1]) + PERIOD_S))
        pulse = next(pulses, None)
        for row in range(BLOCK):
            t_s = float(block.t_s[row])
            while pulse is not None and pulse.t_s <= t_s:
                yield BoardPulse(pulse.t_s, pulse.direction)
                pulse = next(pulses, None)
            yield BoardAccel(t_s, tuple(block.counts[row].tolist()))
