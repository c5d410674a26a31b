"""Interrupt controller, system control block, SysTick and cycle counter: the page at 0xE000E000 and
the DWT's.

Masks are Python integers, bit n is exception n (16 + interrupt number). A line of a peripheral
pends its interrupt as long as it is high, also again after the handler's return, as the LPC1768's
level lines do.
"""

from collections.abc import Callable
from typing import Any, Protocol

BASE, SIZE = 0xE0000000, 0x10000
SYSTICK = 15
THREAD_PRIORITY = 256
CPUID = 0x412FC230
RESET_KEY = 0x05FA


class Processor(Protocol):
    """What the controller asks of the processor that it interrupts."""

    @property
    def now(self) -> int:
        """Clocks since power came."""

    def schedule(self, at: int, action: Callable[[], None]) -> Any:
        """Call action when the clock reaches `at`; the event can be cancelled."""

    def attend(self) -> None:
        """Leave the present slice at its next block: an interrupt may have come."""

    def request_reset(self, why: str) -> None:
        """Reset the processor as soon as the present slice ends."""


class Nvic:
    """What pends, what is enabled, what runs."""

    def __init__(self, core: Processor) -> None:
        self._core = core
        self.reset()

    def reset(self) -> None:
        """State after reset; lines of peripherals fall with them."""
        self._latched = self._lines = self._enabled = 0
        self._priorities: dict[int, int] = {}
        self.vectors = 0
        self.active: list[int] = []
        self.waiting = 0  # pending and enabled
        self._systick = [0, 0xFFFFFF, 0]  # control, reload, clock of the last reload
        self._systick_event = None
        self._registers: dict[int, int] = {}

    def line(self, irq: int, high: bool) -> None:
        """Level of a peripheral's interrupt line."""
        bit = 1 << (16 + irq)
        if high and not self._lines & bit:
            self._lines |= bit
            self._changed()
        elif not high and self._lines & bit:
            self._lines &= ~bit
            self._changed()

    def pulse(self, irq: int) -> None:
        """Pend once."""
        self._latched |= 1 << (16 + irq)
        self._changed()

    def _changed(self) -> None:
        self.waiting = (self._latched | self._lines) & self._enabled
        for number in self.active:  # what runs does not wait for itself
            self.waiting &= ~(1 << number)
        if self.waiting:
            self._core.attend()

    def priority(self, number: int) -> int:
        """0 (first) to 248."""
        return self._priorities.get(number, 0)

    def next(self) -> int:
        """The exception that should be entered now; 0: none is urgent enough."""
        current = self.priority(self.active[-1]) if self.active else THREAD_PRIORITY
        best, rest = 0, self.waiting
        while rest:
            bit = rest & -rest
            rest ^= bit
            number = bit.bit_length() - 1
            if self.priority(number) < current:
                current, best = self.priority(number), number
        return best

    def enter(self, number: int) -> None:
        """The handler starts."""
        self._latched &= ~(1 << number)
        self.active.append(number)
        self._changed()

    def leave(self) -> None:
        """The newest handler ends."""
        self.active.pop()
        self._changed()

    def read(self, offset: int, size: int) -> int:
        """A register of the private peripheral bus."""
        if offset == 0x1004:  # DWT_CYCCNT
            return self._core.now & 0xFFFFFFFF
        register = offset & ~3
        shift = 8 * (offset & 3)
        return self._word(register) >> shift & ((1 << 8 * size) - 1)

    def _word(self, register: int) -> int:
        if 0xE100 <= register < 0xE300:
            kind, index = (register - 0xE100) // 0x80, (register & 0x7F) // 4
            mask = self._enabled if kind in (0, 1) else self._latched | self._lines
            return mask >> (16 + 32 * index) & 0xFFFFFFFF
        if 0xE400 <= register < 0xE4F0:
            return sum(self.priority(16 + register - 0xE400 + k) << 8 * k for k in range(4))
        if register == 0xE018:
            return self._systick_value()
        if register == 0xED00:
            return CPUID
        if register == 0xED04:
            return self.active[-1] if self.active else 0
        if register == 0xED08:
            return self.vectors
        if register == 0xE010:
            return self._systick[0]
        return self._registers.get(register, 0)

    def write(self, offset: int, size: int, value: int) -> None:
        """A register of the private peripheral bus."""
        if 0xE400 <= offset < 0xE4F0 or 0xED18 <= offset < 0xED24:
            first = offset - 0xE400 + 16 if offset < 0xE4F0 else offset - 0xED18 + 4
            for k in range(size):
                self._priorities[first + k] = value >> 8 * k & 0xF8
        elif 0xE100 <= offset < 0xE300:
            kind, mask = (offset - 0xE100) // 0x80, value << (16 + 32 * ((offset & 0x7F) // 4))
            if kind == 0:
                self._enabled |= mask
            elif kind == 1:
                self._enabled &= ~mask
            elif kind == 2:
                self._latched |= mask
            else:
                self._latched &= ~mask
        elif offset in (0xE010, 0xE014, 0xE018):
            self._write_systick(offset, value)
        elif offset == 0xED04 and value & 1 << 28:
            self._latched |= 1 << 14
            self._enabled |= 1 << 14
        elif offset == 0xED08:
            self.vectors = value
        elif offset == 0xED0C and value >> 16 == RESET_KEY and value & 5:
            self._core.request_reset("software")
        else:
            self._registers[offset & ~3] = value
        self._changed()

    def _systick_value(self) -> int:
        control, reload, since = self._systick
        return reload - (self._core.now - since) % (reload + 1) if control & 1 else 0

    def _write_systick(self, offset: int, value: int) -> None:
        if offset == 0xE014:
            self._systick[1] = value & 0xFFFFFF
            return
        if offset == 0xE010:
            self._systick[0] = value & 7
        self._systick[2] = self._core.now
        if self._systick_event is not None:
            self._systick_event.cancelled = True
        self._arm_systick()

    def _arm_systick(self) -> None:
        control, reload, since = self._systick
        if control & 3 == 3:
            self._enabled |= 1 << SYSTICK
            self._systick_event = self._core.schedule(since + reload + 1, self._tick)

    def _tick(self) -> None:
        self._systick[2] = self._core.now
        self._latched |= 1 << SYSTICK
        self._arm_systick()
        self._changed()
