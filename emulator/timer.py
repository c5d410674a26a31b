"""Timers with match and capture, GPIO with chip selects and straps, the converter."""

from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from emulator.core import Core, Event
    from emulator.system import SystemControl

WRAP = 1 << 32
IR, TCR, TC, PR, PC, MCR, MR0, CCR, CR0 = 0x00, 0x04, 0x08, 0x0C, 0x10, 0x14, 0x18, 0x28, 0x2C


class Timer:
    """32 bits; the count is computed from the clock, and only a match that does something is an
    event.
    """

    def __init__(self, core: "Core", system: "SystemControl", name: str, irq: int) -> None:
        self._core, self._system, self._name, self._irq = core, system, name, irq
        self._events: list[Event | None] = [None] * 4
        self.reset()

    def reset(self) -> None:
        """Stopped at 0."""
        for event in self._events:
            if event is not None:
                event.cancelled = True
        self._events = [None] * 4
        self._ir = self._tcr = self._pr = self._mcr = self._ccr = 0
        self._match, self._capture = [0] * 4, [0] * 4
        self.base_clock = self._base_count = 0

    def _step(self) -> int:
        return self._system.divider(self._name) * (self._pr + 1)

    def count(self, clock: int) -> int:
        """TC at a clock."""
        if self._tcr & 3 != 1:
            return self._base_count
        return (self._base_count + (clock - self.base_clock) // self._step()) % WRAP

    def edge(self, channel: int, rising: bool) -> None:
        """An edge on a capture pin now."""
        bits = self._ccr >> 3 * channel & 7
        if not bits & (1 if rising else 2):
            return
        self._capture[channel] = self.count(self._core.now)
        if bits & 4:
            self._ir |= 0x10 << channel
            self._update()

    def _update(self) -> None:
        self._core.nvic.line(self._irq, bool(self._ir))

    def _arm(self, k: int) -> None:
        if self._events[k] is not None:
            self._events[k].cancelled = True
            self._events[k] = None
        if self._tcr & 3 != 1 or not self._mcr >> 3 * k & 7:
            return
        now = self._core.now
        left = (self._match[k] - self.count(now)) % WRAP
        done = (now - self.base_clock) % self._step()
        at = now + (left or WRAP) * self._step() - done
        self._events[k] = self._core.schedule(at, lambda: self._matched(k))

    def _matched(self, k: int) -> None:
        self._events[k] = None
        bits = self._mcr >> 3 * k & 7
        if bits & 1:
            self._ir |= 1 << k
            self._update()
        if bits & 6:
            self._rebase(0 if bits & 2 else self._match[k])
            if bits & 4:
                self._tcr &= ~1
        self._arm(k)

    def _rebase(self, count: int) -> None:
        self.base_clock, self._base_count = self._core.now, count

    def read(self, offset: int, size: int) -> int:
        """A register."""
        if offset == TC:
            return self.count(self._core.now)
        if MR0 <= offset < CCR:
            return self._match[(offset - MR0) // 4]
        if CR0 <= offset < CR0 + 16:
            return self._capture[(offset - CR0) // 4]
        return {IR: self._ir, TCR: self._tcr, PR: self._pr, MCR: self._mcr, CCR: self._ccr}.get(
            offset, 0
        )

    def write(self, offset: int, size: int, value: int) -> None:
        """A register."""
        if offset == IR:
            self._ir &= ~value
            self._update()
        elif MR0 <= offset < CCR:
            k = (offset - MR0) // 4
            self._match[k] = value
            self._arm(k)
        elif offset == CCR:
            self._ccr = value
        else:
            self._rebase(self.count(self._core.now))
            if offset == TCR:
                self._tcr = value & 3
                if value & 2:
                    self._rebase(0)
            elif offset == TC:
                self._rebase(value)
            elif offset == PR:
                self._pr = value
            elif offset == MCR:
                self._mcr = value
            for k in range(4):
                self._arm(k)


class Gpio:
    """Five ports. Outputs call `changed(port, old, new)`; inputs are what `inputs[port]` says,
    pulled up by default.
    """

    FIODIR, FIOMASK, FIOPIN, FIOSET, FIOCLR = 0x00, 0x10, 0x14, 0x18, 0x1C

    def __init__(self) -> None:
        self.inputs = [0xFFFFFFFF] * 5
        self.changed: Callable[[int, int, int], None] = lambda port, old, new: None
        self.direction, self._latch, self._mask = [0] * 5, [0] * 5, [0] * 5

    def reset(self) -> None:
        """All pins are inputs with pull-ups."""
        for port in range(5):
            self._set(port, 0, 0)
            self._mask[port] = 0

    def levels(self, port: int) -> int:
        """What the pins show."""
        direction = self.direction[port]
        return self._latch[port] & direction | self.inputs[port] & ~direction & 0xFFFFFFFF

    def _set(self, port: int, direction: int, latch: int) -> None:
        before = self.levels(port)
        self.direction[port], self._latch[port] = direction, latch
        after = self.levels(port)
        if before != after:
            self.changed(port, before, after)

    def read(self, offset: int, size: int) -> int:
        """A register; bytes and halfwords too."""
        port, register = offset >> 5, offset & 0x1C
        if port > 4:
            return 0
        if register == self.FIODIR:
            value = self.direction[port]
        elif register == self.FIOMASK:
            value = self._mask[port]
        elif register == self.FIOPIN:
            value = self.levels(port) & ~self._mask[port]
        else:
            value = self._latch[port] if register == self.FIOSET else 0
        return value >> 8 * (offset & 3) & ((1 << 8 * size) - 1)

    def write(self, offset: int, size: int, value: int) -> None:
        """A register; bytes and halfwords too."""
        port, register, shift = offset >> 5, offset & 0x1C, 8 * (offset & 3)
        if port > 4:
            return
        value, lane = value << shift, ((1 << 8 * size) - 1) << shift
        free = lane & ~self._mask[port]
        latch = self._latch[port]
        if register == self.FIODIR:
            self._set(port, self.direction[port] & ~lane | value, self._latch[port])
        elif register == self.FIOMASK:
            self._mask[port] = self._mask[port] & ~lane | value
        else:
            if register == self.FIOPIN:
                latch = latch & ~free | value & free
            elif register == self.FIOSET:
                latch |= value & free
            elif register == self.FIOCLR:
                latch &= ~(value & free)
            self._set(port, self.direction[port], latch)


class Adc:
    """12 bits, single conversions and burst; `level(channel, clock)` gives counts 0 to 4095."""

    CONVERSION = 65  # converter clocks

    def __init__(self, core: "Core", system: "SystemControl", irq: int) -> None:
        self._core, self._system, self._irq = core, system, irq
        self._event: Event | None = None
        self.level: Callable[[int, int], int] = lambda channel, clock: 2048
        self.reset()

    def reset(self) -> None:
        """Powered down."""
        self._cr = self._inten = 0
        self._global = 0
        self._data = [0] * 8
        self._next = 0
        if self._event is not None:
            self._event.cancelled = True
            self._event = None

    def _clocks(self) -> int:
        return self.CONVERSION * ((self._cr >> 8 & 0xFF) + 1) * self._system.divider("adc")

    def _start(self) -> None:
        if self._event is not None:
            self._event.cancelled = True
            self._event = None
        chosen = [k for k in range(8) if self._cr >> k & 1]
        if chosen and self._cr & 1 << 21 and (self._cr & 1 << 16 or self._cr >> 24 & 7 == 1):
            later = [k for k in chosen if k >= self._next]
            channel = (later or chosen)[0]
            self._event = self._core.schedule(
                self._core.now + self._clocks(), lambda: self._converted(channel)
            )

    def _converted(self, channel: int) -> None:
        self._event = None
        count = min(4095, max(0, int(self.level(channel, self._core.now))))
        overrun = 1 << 30 if self._data[channel] >> 31 else 0
        self._data[channel] = 1 << 31 | overrun | count << 4
        self._global = 1 << 31 | channel << 24 | count << 4
        self._next = channel + 1
        if self._cr & 1 << 16:
            self._start()
        self._update()

    def _update(self) -> None:
        done = sum(1 << k for k in range(8) if self._data[k] >> 31)
        high = bool(done & self._inten & 0xFF) or bool(self._inten & 0x100 and self._global >> 31)
        self._core.nvic.line(self._irq, high)

    def read(self, offset: int, size: int) -> int:
        """A register. A read that finds no conversion done is a busy wait, see ssp.py."""
        if offset == 0x00:
            return self._cr
        if offset == 0x04:
            self._wait(self._global)
            value, self._global = self._global, self._global & 0x7FFFFFFF
            self._update()
            return value
        if 0x10 <= offset < 0x30:
            k = (offset - 0x10) // 4
            self._wait(self._data[k])
            value, self._data[k] = self._data[k], self._data[k] & 0x3FFFFFFF
            self._update()
            return value
        if offset == 0x30:
            return sum(1 << k for k in range(8) if self._data[k] >> 31)
        return self._inten if offset == 0x0C else 0

    def _wait(self, data: int) -> None:
        if not data >> 31 and self._event is not None:
            self._core.wait_until(self._event.at)

    def write(self, offset: int, size: int, value: int) -> None:
        """A register."""
        if offset == 0x00:
            self._cr = value
            self._start()
        elif offset == 0x0C:
            self._inten = value
