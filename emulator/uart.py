"""A 16550 as in the LPC1768: 16-byte FIFOs, time per byte from the divisor, four kinds of
interrupt.

Enabling the transmit interrupt while the FIFO is empty does not raise it (UM10360 14.4.4: it
follows a byte that has left), so a driver must write the first bytes itself.
"""

from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from emulator.core import Core
    from emulator.system import SystemControl

DATA, IER, IIR_FCR, LCR, LSR, FDR, TER = 0x00, 0x04, 0x08, 0x0C, 0x14, 0x28, 0x30
RDR, OVERRUN, THRE, TEMT = 0x01, 0x02, 0x20, 0x40
DLAB = 0x80
DEPTH = 16
TRIGGER = (1, 4, 8, 14)
TIMEOUT_BYTES = 4  # times of a byte without a new one until the receive time-out


class Uart:
    """One UART. `sink(byte, clock)` gets every byte when its stop bit has left."""

    def __init__(self, core: "Core", system: "SystemControl", name: str, irq: int) -> None:
        self._core, self._system, self._name, self._irq = core, system, name, irq
        self.sink: Callable[[int, int], None] = lambda byte, clock: None
        self.lost_to_full_fifo = 0  # bytes written while the FIFO was full
        self.overruns = 0
        self._held_until = 0
        self._to_come: deque[int] = deque()  # bytes on their way to the receive pin
        self._arrival = self._empty_event = self._timeout_event = None
        self.reset()

    def reset(self) -> None:
        """Registers after reset; bytes being sent are cut off."""
        self._ier = self._fcr = self._lcr = 0
        self._dll, self._dlm, self._fdr = 1, 0, 0x10
        self._step_of, self._step = -1, 0  # byte_clocks as computed for this version of the clocks
        self._leaving: deque[tuple[int, int]] = (
            deque()
        )  # (clock at which its stop bit has left, byte)
        for event in (self._empty_event, self._timeout_event):
            if event is not None:
                event.cancelled = True
        self._empty_event = self._timeout_event = None
        self._empty_at = 0
        self._thre_pending = self._timed_out = self._overrun = self._raised = False
        self._received: deque[int] = deque()

    @property
    def _bits(self) -> int:
        """Bits of one byte on the line, start and stop included."""
        return 7 + (self._lcr & 3) + (self._lcr >> 2 & 1) + (self._lcr >> 3 & 1)

    @property
    def byte_clocks(self) -> int:
        """Core clocks of one byte on the line."""
        if self._step_of != self._system.version:
            self._step_of, self._step = self._system.version, self._byte_clocks()
        return self._step

    def _byte_clocks(self) -> int:
        mul, add = max(1, self._fdr >> 4), self._fdr & 15
        divisor = max(1, self._dll | self._dlm << 8)
        return self._bits * 16 * divisor * (mul + add) * self._system.divider(self._name) // mul

    @property
    def baud(self) -> float:
        """Bits per second now."""
        return (
            self._system.cclk
            * (7 + (self._lcr & 3) + (self._lcr >> 2 & 1) + (self._lcr >> 3 & 1))
            / self.byte_clocks
        )

    def hold(self, clocks: int) -> None:
        """The line's other end takes nothing for so long: what has not left waits."""
        now = self._core.now
        self._drain(now)
        self._held_until = max(self._held_until, now + clocks)
        self._leaving = deque((at + clocks, byte) for at, byte in self._leaving)
        self._empty_at += clocks

    def feed(self, data: bytes) -> None:
        """Bytes come in, one per byte time from now on, behind those still on their way."""
        self._to_come.extend(data)
        if self._arrival is None and self._to_come:
            self._arrival = self._core.schedule(self._core.now + self.byte_clocks, self._arrive)

    def flush(self) -> None:
        """Hand out what has left by now."""
        self._drain(self._core.now)

    def _drain(self, now: int) -> None:
        while self._leaving and self._leaving[0][0] <= now:
            at, byte = self._leaving.popleft()
            self.sink(byte, at)

    def _arrive(self) -> None:
        byte = self._to_come.popleft()
        now = self._core.now
        self._arrival = (
            self._core.schedule(now + self.byte_clocks, self._arrive) if self._to_come else None
        )
        if len(self._received) >= (DEPTH if self._fcr & 1 else 1):
            self._overrun = True
            self.overruns += 1
        else:
            self._received.append(byte)
        self._restart_timeout()
        self._update()

    def _restart_timeout(self) -> None:
        self._timed_out = False
        if self._timeout_event is not None:
            self._timeout_event.cancelled = True
            self._timeout_event = None
        if self._received:
            at = self._core.now + TIMEOUT_BYTES * self.byte_clocks
            self._timeout_event = self._core.schedule(at, self._time_out)

    def _time_out(self) -> None:
        self._timeout_event = None
        self._timed_out = bool(self._received)
        self._update()

    def _send(self, byte: int) -> None:
        now = self._core.now
        if self._leaving and self._leaving[0][0] <= now:
            self._drain(now)
        self._thre_pending = False
        if len(self._leaving) > DEPTH:  # sixteen wait, one is in the shift register
            self.lost_to_full_fifo += 1
            return
        step = self.byte_clocks
        begin = max(now, self._held_until, self._leaving[-1][0] if self._leaving else 0)
        self._leaving.append((begin + step, byte))
        # The FIFO is empty when its last byte enters the shift register, a byte's time before that
        # one has left.
        self._empty_at = max(begin, now + 1)
        if self._empty_event is None:
            self._empty_event = self._core.schedule(self._empty_at, self._empty)
        if self._raised:
            self._update()

    def _empty(self) -> None:
        if self._core.now < self._empty_at:  # bytes were added since
            self._empty_event = self._core.schedule(self._empty_at, self._empty)
            return
        self._empty_event = None
        self._thre_pending = True
        self._drain(self._core.now)
        self._update()

    def _cause(self) -> int:
        """IIR's identification, 1: none."""
        if self._ier & 4 and self._overrun:
            return 0x06
        if self._ier & 1 and self._received:
            if not self._fcr & 1 or len(self._received) >= TRIGGER[self._fcr >> 6 & 3]:
                return 0x04
            if self._timed_out:
                return 0x0C
        return 0x02 if self._ier & 2 and self._thre_pending else 0x01

    def _update(self) -> None:
        raised = self._cause() != 1
        if raised != self._raised:
            self._raised = raised
            self._core.nvic.line(self._irq, raised)

    def read(self, offset: int, size: int) -> int:
        """A register."""
        if offset == IIR_FCR:
            cause = self._cause()
            if cause == 0x02:
                self._thre_pending = False
                self._update()
            return cause | (0xC0 if self._fcr & 1 else 0)
        if offset == DATA:
            if self._lcr & DLAB:
                return self._dll
            byte = self._received.popleft() if self._received else 0
            self._restart_timeout()
            self._update()
            return byte
        if offset == LSR:
            return self._line_status()
        if offset == IER:
            return self._dlm if self._lcr & DLAB else self._ier
        return {LCR: self._lcr, FDR: self._fdr, TER: 0x80}.get(offset, 0)

    def _line_status(self) -> int:
        self._drain(self._core.now)
        status = RDR if self._received else 0
        if self._overrun:
            status |= OVERRUN
            self._overrun = False
            self._update()
        if self._empty_event is None:
            status |= THRE
        return status | (TEMT if not self._leaving else 0)

    def write(self, offset: int, size: int, value: int) -> None:
        """A register."""
        if offset == DATA:
            if self._lcr & DLAB:
                self._dll, self._step_of = value & 0xFF, -1
            else:
                self._send(value & 0xFF)
        elif offset == IER:
            if self._lcr & DLAB:
                self._dlm, self._step_of = value & 0xFF, -1
            else:
                self._ier = value & 7
                self._update()
        elif offset == IIR_FCR:
            self._fcr = value
            if value & 2:
                self._received.clear()
                self._restart_timeout()
            self._update()
        elif offset == LCR:
            self._lcr, self._step_of = value & 0xFF, -1
        elif offset == FDR:
            self._fdr, self._step_of = value & 0xFF, -1
