"""An ADXL345 as seen through SPI: registers, its own sampling clock, 32-level FIFO, self-test; and
broken ones.

Data sheet rev. G. What a driver may trip over is here: the FIFO pops when a read leaves the data
registers and needs 5 us before the next one; OVERRUN and DATA_READY fall with a read; at 1600 and
3200 Hz the lowest bit is 0.
"""

from collections import deque
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

DEVID, BW_RATE, POWER_CTL, INT_ENABLE, INT_SOURCE, DATA_FORMAT = 0x00, 0x2C, 0x2D, 0x2E, 0x30, 0x31
DATAX0, DATAZ1, FIFO_CTL, FIFO_STATUS = 0x32, 0x37, 0x38, 0x39
ID = 0xE5
DATA_READY, WATERMARK, OVERRUN = 0x80, 0x02, 0x01
FIFO_DEPTH = 32
FIFO_MOVE_S = 5e-6
TURN_ON_S = 1.1e-3
SELF_TEST_COUNTS = (230, -230, 330)  # typical at 3.3 V, 0.9 and 1.3 g
TOP_RATE = 3200.0  # Hz, rate code 15
LOOK_AHEAD = 256  # samples asked of the world at once
READ_ONLY = {DEVID, INT_SOURCE, FIFO_STATUS, *range(DATAX0, DATAZ1 + 1)}

Counts = Callable[
    [NDArray[np.float64]], NDArray[np.float64]
]  # times (n,) s -> (n, 3), counts of 3.9 mg, not rounded


class Adxl345:
    """One sensor. `state` is 'good', 'dead' (drives nothing), 'stuck' (new data never differ) or
    'wrong-id'.
    """

    def __init__(
        self, counts: Counts, clocks_per_s: float, odr_error: float = 0.0, phase: float = 0.0
    ) -> None:
        """odr_error: relative error of its sampling clock; phase: 0 to 1 of a period, of its first
        sample.
        """
        self.state = "good"
        self.selected = False
        self.overruns = 0  # samples that nobody read
        self.taken = 0
        self._counts, self._clocks_per_s = counts, clocks_per_s
        self._odr_error, self._phase = odr_error, phase
        self.reset()

    def reset(self) -> None:
        """Power-on values."""
        self._registers = [0] * 64
        self._registers[DEVID], self._registers[BW_RATE] = ID, 0x0A
        self._fifo: deque[tuple[int, int, int]] = deque()
        self._out = (0, 0, 0)
        self._frozen: tuple[int, int, int] | None = None
        self._ready = self._overrun = False
        self._moved_at = 0.0
        self._coming: deque[tuple[float, tuple[int, int, int]]] = deque()
        self._running = False
        self._begin(0)

    @property
    def rate_hz(self) -> float:
        """Its true sampling rate now."""
        return TOP_RATE / 2.0 ** (15 - (self._registers[BW_RATE] & 15)) * (1.0 + self._odr_error)

    def select(self, low: bool, clock: int) -> None:
        """The chip select changes."""
        if self.selected and not low:
            self._end_of_read(clock)
        self.selected, self._address, self._reading, self._multiple = low, -1, False, False
        self._touched = False
        if low:
            self._advance(clock)

    def exchange(self, byte: int, clock: int) -> int:
        """One byte each way; what a master reads."""
        if self.state == "dead":
            return 0xFF
        if self._address < 0:
            self._reading, self._multiple, self._address = (
                bool(byte & 0x80),
                bool(byte & 0x40),
                byte & 0x3F,
            )
            return 0x00
        address = self._address
        if self._multiple:
            self._address = (address + 1) & 0x3F
        if self._reading:
            return self._read(address, clock)
        self._write(address, byte, clock)
        return 0x00

    def _read(self, address: int, clock: int) -> int:
        if DATAX0 <= address <= DATAZ1:
            if not self._touched:
                self._touched = True
                if self._fifo and clock >= self._moved_at:
                    self._out = self._fifo[0]
                self._ready = self._overrun = False
            word = self._out[(address - DATAX0) // 2]
            return word >> 8 * ((address - DATAX0) & 1) & 0xFF
        if self._touched:
            self._end_of_read(clock)
        if address == INT_SOURCE:
            return self._interrupts()
        if address == FIFO_STATUS:
            return len(self._fifo) if self._fifo_mode else 0
        if address == DEVID and self.state == "wrong-id":
            return 0x00
        return self._registers[address]

    def _write(self, address: int, value: int, clock: int) -> None:
        if address in READ_ONLY:
            return
        before, self._registers[address] = self._registers[address], value
        if address in (BW_RATE, POWER_CTL, DATA_FORMAT) and value != before:
            self._begin(clock)
        if address == FIFO_CTL and value >> 6 != before >> 6:
            self._fifo.clear()

    @property
    def _fifo_mode(self) -> int:
        return self._registers[FIFO_CTL] >> 6

    def _interrupts(self) -> int:
        ready = bool(self._fifo) if self._fifo_mode else self._ready
        mark = self._fifo_mode and len(self._fifo) >= max(1, self._registers[FIFO_CTL] & 31)
        return (
            (DATA_READY if ready else 0)
            | (WATERMARK if mark else 0)
            | (OVERRUN if self._overrun else 0)
        )

    def _end_of_read(self, clock: int) -> None:
        if self._touched and self._fifo and clock >= self._moved_at:
            self._fifo.popleft()
            self._moved_at = clock + FIFO_MOVE_S * self._clocks_per_s
        self._touched = False

    def _begin(self, clock: int) -> None:
        """Start or stop sampling: settings have changed."""
        self._coming.clear()
        self._running = bool(self._registers[POWER_CTL] & 8)
        self._period_s = 1.0 / self.rate_hz
        self._next_s = clock / self._clocks_per_s + TURN_ON_S + (1.0 + self._phase) * self._period_s

    def _advance(self, clock: int) -> None:
        """Take what the sensor has sampled until now."""
        if not self._running or self.state == "dead":
            return
        now_s = clock / self._clocks_per_s
        coming = self._coming
        while True:
            if not coming:
                if self._next_s > now_s:
                    return
                self._look_ahead()
            if coming[0][0] > now_s:
                return
            self._take(coming.popleft()[1])

    def _look_ahead(self) -> None:
        """Samples of the time to come; a change of settings throws them away."""
        times = self._next_s + self._period_s * np.arange(LOOK_AHEAD)
        self._next_s = float(times[-1]) + self._period_s
        format_, code = self._registers[DATA_FORMAT], self._registers[BW_RATE] & 15
        counts = np.rint(self._counts(times))
        if format_ & 0x80:
            counts += SELF_TEST_COUNTS
        limit = 512 << (format_ & 3)
        counts = np.clip(counts, -limit, limit - 1).astype(np.int64)
        if not format_ & 0x08:
            counts >>= format_ & 3
        if code >= 14:
            counts &= ~1
        words = (counts & 0xFFFF).tolist()
        self._coming.extend(zip(times.tolist(), map(tuple, words), strict=True))

    def _take(self, words: tuple[int, int, int]) -> None:
        self.taken += 1
        if self.state == "stuck":
            self._frozen = words = self._frozen or self._out
        if self._fifo_mode:
            if len(self._fifo) >= FIFO_DEPTH:
                self._overrun = True
                self.overruns += 1
                if self._fifo_mode == 1:
                    return
                self._fifo.popleft()
            self._fifo.append(words)
            return
        if self._ready:
            self._overrun = True
            self.overruns += 1
        self._out, self._ready = words, True
