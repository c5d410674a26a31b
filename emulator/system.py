"""System control: PLL, clock dividers, reset cause, watchdog, boot ROM, and registers that only
read back.
"""

import struct
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from emulator.core import Core

CRYSTAL = 12_000_000  # Hz
INTERNAL_RC = 4_000_000  # Hz
POWER_ON, EXTERNAL, WATCHDOG, BROWN_OUT = 1, 2, 4, 8  # RSID
# Bit positions of the peripheral clock selections, PCLKSEL0 then PCLKSEL1 (UM10360, tables 40 and
# 41).
PCLK_BITS = {
    "wdt": 0,
    "timer0": 2,
    "timer1": 4,
    "uart0": 6,
    "uart1": 8,
    "ssp1": 20,
    "adc": 24,
    "ssp0": 42,
    "timer2": 44,
    "timer3": 46,
    "uart2": 48,
    "uart3": 50,
}
DIVIDERS = (4, 1, 2, 8)

PLL0CON, PLL0CFG, PLL0STAT, PLL0FEED = 0x080, 0x084, 0x088, 0x08C
PLL1STAT = 0x0A8
CCLKCFG, CLKSRCSEL, RSID, SCS, PCLKSEL0, PCLKSEL1 = 0x104, 0x10C, 0x180, 0x1A0, 0x1A8, 0x1AC


class SystemControl:
    """0x400FC000. The PLL locks at once; a wrong feed sequence is ignored as in the chip."""

    def __init__(self) -> None:
        self.cause = POWER_ON
        self.version = 0  # of the clocks; whoever keeps something computed from them compares it
        self.reset()

    def reset(self) -> None:
        """Registers after reset; the cause stays."""
        self._registers = {0: 0x303A, 0x0C4: 0x042887DE}
        self._pll = [0, 0]  # control and configuration in force
        self._feed = 0
        self.version += 1

    @property
    def cclk(self) -> int:
        """Processor clock, Hz."""
        control, configuration = self._pll
        source = CRYSTAL if self._registers.get(CLKSRCSEL, 0) & 3 == 1 else INTERNAL_RC
        if control & 3 == 3:
            source = (
                2 * source * ((configuration & 0x7FFF) + 1) // ((configuration >> 16 & 0xFF) + 1)
            )
        return source // (self._registers.get(CCLKCFG, 0) + 1)

    def divider(self, peripheral: str) -> int:
        """CCLK over the peripheral's clock."""
        both = self._registers.get(PCLKSEL0, 0) | self._registers.get(PCLKSEL1, 0) << 32
        return DIVIDERS[both >> PCLK_BITS[peripheral] & 3]

    def read(self, offset: int, size: int) -> int:
        """A register."""
        if offset == PLL0STAT:
            control, configuration = self._pll
            return configuration & 0xFF7FFF | (control & 3) << 24 | (1 << 26 if control & 1 else 0)
        if offset == RSID:
            return self.cause
        if offset == SCS:
            value = self._registers.get(SCS, 0)
            return value | (1 << 6 if value & 1 << 5 else 0)
        return self._registers.get(offset & ~3, 0) >> 8 * (offset & 3)

    def write(self, offset: int, size: int, value: int) -> None:
        """A register."""
        self.version += 1
        if offset == PLL0FEED:
            if self._feed == 0xAA and value == 0x55:
                self._pll = [self._registers.get(PLL0CON, 0), self._registers.get(PLL0CFG, 0)]
            self._feed = value
        elif offset == RSID:
            self.cause &= ~value
        else:
            self._registers[offset & ~3] = value


class Watchdog:
    """0x40000000. It resets when it is not fed; it runs on the internal RC oscillator or the
    peripheral clock.
    """

    def __init__(self, core: "Core", system: SystemControl) -> None:
        self._core, self._system = core, system
        self.bites = 0
        self._event = None
        self.reset()

    def reset(self) -> None:
        """Off."""
        self._mode, self._constant, self._select, self._feed = 0, 0xFF, 0, 0
        self._end = 0
        if self._event is not None:
            self._event.cancelled = True
            self._event = None

    def read(self, offset: int, size: int) -> int:
        """A register."""
        if offset == 0x0C:
            return max(0, self._end - self._core.now) // self._clocks() if self._end else 0xFF
        return {0x00: self._mode, 0x04: self._constant, 0x10: self._select}.get(offset, 0)

    def write(self, offset: int, size: int, value: int) -> None:
        """A register."""
        if offset == 0x00:
            self._mode |= value & 3  # cannot be switched off again
        elif offset == 0x04:
            self._constant = max(0xFF, value)
        elif offset == 0x10:
            self._select = value
        elif offset == 0x08:
            if self._feed == 0xAA and value == 0x55 and self._mode & 1:
                self._end = self._core.now + self._constant * self._clocks()
                if self._event is None:
                    self._event = self._core.schedule(self._end, self._look)
            self._feed = value

    def _clocks(self) -> int:
        """Core clocks per count."""
        if self._select & 3 == 0:
            return 4 * self._system.cclk // INTERNAL_RC
        return 4 * self._system.divider("wdt")

    def _look(self) -> None:
        """Fed in between: look again at the new end, so that feeding costs no event."""
        if self._core.now < self._end:
            self._event = self._core.schedule(self._end, self._look)
        elif self._mode & 2:
            self.bites += 1
            self._core.request_reset("watchdog")


class Registers:
    """A peripheral without behaviour: reads back what was written."""

    def __init__(self) -> None:
        self.values: dict[int, int] = {}

    def reset(self) -> None:
        """All zero."""
        self.values.clear()

    def read(self, offset: int, size: int) -> int:
        """A register."""
        return self.values.get(offset & ~3, 0) >> 8 * (offset & 3)

    def write(self, offset: int, size: int, value: int) -> None:
        """A register."""
        self.values[offset & ~3] = value


class BackupRegisters(Registers):
    """The RTC with its battery: nothing but loss of the battery clears it."""

    def reset(self) -> None:
        """Keeps everything."""


class BootRom:
    """IAP of the boot ROM: the part number and serial number commands; all others answer
    INVALID_COMMAND.

    `code` is what stands at the entry: it hands r0 and r1 to two registers of this model and
    returns.
    """

    ENTRY = 0x1FFF1FF0
    MAILBOX = 0xF0000000
    code = bytes.fromhex(
        "4ff07042106051607047"
    )  # mov.w r2,#0xF0000000; str r0,[r2]; str r1,[r2,#4]; bx lr

    def __init__(self, core: "Core", uid: bytes) -> None:
        self._core, self._uid, self._command = core, uid.ljust(16, b"\0")[:16], 0

    def read(self, offset: int, size: int) -> int:
        """Nothing to read."""
        return 0

    def write(self, offset: int, size: int, value: int) -> None:
        """r0 (address of the command table), then r1 (address of the result table)."""
        if offset == 0:
            self._command = value
            return
        command = struct.unpack("<I", self._core.engine.read(self._command, 4))[0]
        answers = {54: struct.pack("<II", 0, 0x26013F37), 58: struct.pack("<I", 0) + self._uid}
        self._core.engine.write(value, answers.get(command, struct.pack("<I", 1)))
