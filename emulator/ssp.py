"""SSP: 8-deep FIFOs, every frame takes its time, one of several devices on the bus answers.

A read of SR while a transfer runs is the body of a busy wait; the clock goes on to the moment the
answer changes (or to the next interrupt), which is what the loop would have waited for.
"""

from collections import deque
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from emulator.core import Core
    from emulator.system import SystemControl

CR0, CR1, DR, SR, CPSR, IMSC, RIS, MIS, ICR = range(0x00, 0x24, 4)
TFE, TNF, RNE, RFF, BUSY = 1, 2, 4, 8, 16
DEPTH = 8


class SpiDevice(Protocol):
    """What hangs on a bus: bytes while its chip select is low."""

    selected: bool

    def exchange(self, byte: int, clock: int) -> int: ...


class Ssp:
    """One SSP as SPI master. A frame of 16 bits is two bytes to the device."""

    def __init__(self, core: "Core", system: "SystemControl", name: str, irq: int) -> None:
        self._core, self._system, self._name, self._irq = core, system, name, irq
        self.devices: list[SpiDevice] = []
        self.conflicts = 0  # frames with two devices selected
        self.frames = 0
        self.reset()

    def reset(self) -> None:
        """Registers after reset."""
        self._cr0 = self._cr1 = self._cpsr = self._imsc = 0
        self._done: deque[tuple[int, int]] = (
            deque()
        )  # (clock, value) of frames on the wire or received
        self._overrun = False
        self._settle()

    def _settle(self) -> None:
        """Compute what follows from registers and clocks."""
        bits = (self._cr0 & 15) + 1
        bit_clocks = max(2, self._cpsr) * ((self._cr0 >> 8) + 1) * self._system.divider(self._name)
        self._settled = self._system.version
        self.frame_clocks = bits * bit_clocks  # core clocks of one frame
        # Clock idle high, sampled on the second edge, at most 5 MHz: what an ADXL345 understands.
        self.mode3 = self._cr0 & 0xF0 == 0xC0 and bit_clocks * 5_000_000 >= self._system.cclk

    def _transfer(self, value: int) -> None:
        if self._settled != self._system.version:
            self._settle()
        now, busy_until = self._core.now, self._done[-1][0] if self._done else 0
        waiting = -((now - busy_until) // self.frame_clocks) if busy_until > now else 0
        if not self._cr1 & 2 or waiting > DEPTH:
            return
        self.frames += 1
        end = max(now, busy_until) + self.frame_clocks
        if len(self._done) >= DEPTH + waiting:
            self._overrun = True
            return
        self._done.append((end, self._exchange(value, end)))

    def _exchange(self, value: int, clock: int) -> int:
        wide = self._cr0 & 15 == 15
        chosen = [device for device in self.devices if device.selected]
        self.conflicts += len(chosen) > 1
        if not chosen:
            return 0xFFFF if wide else 0xFF  # nobody drives MISO: it is pulled up
        if not self.mode3:
            return 0
        device = chosen[0]
        if wide:
            high = device.exchange(value >> 8 & 0xFF, clock)
            return high << 8 | device.exchange(value & 0xFF, clock)
        return device.exchange(value & 0xFF, clock)

    def read(self, offset: int, size: int) -> int:
        """A register."""
        if offset == DR:
            done = self._done
            return done.popleft()[1] if done and done[0][0] <= self._core.now else 0
        if offset == SR:
            return self._status()
        values = {
            CR0: self._cr0,
            CR1: self._cr1,
            CPSR: self._cpsr,
            IMSC: self._imsc,
            RIS: int(self._overrun) | 8,
        }
        return values.get(offset, 0)

    def _status(self) -> int:
        done = self._done
        if done and done[-1][0] > self._core.now:
            self._core.wait_until(done[-1][0])
        now = self._core.now
        received = sum(1 for at, _ in done if at <= now)
        waiting = len(done) - received
        status = TFE if waiting <= 1 else 0
        status |= TNF if waiting <= DEPTH else 0
        status |= RNE if received else 0
        status |= RFF if received >= DEPTH else 0
        return status | (BUSY if waiting else 0)

    def write(self, offset: int, size: int, value: int) -> None:
        """A register."""
        if offset == DR:
            self._transfer(value & 0xFFFF)
        elif offset == CR0:
            self._cr0 = value & 0xFFFF
            self._settle()
        elif offset == CR1:
            self._cr1 = value
        elif offset == CPSR:
            self._cpsr = value & 0xFE
            self._settle()
        elif offset == IMSC:
            self._imsc = value
        elif offset == ICR:
            self._overrun = False
