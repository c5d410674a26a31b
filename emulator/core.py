"""The processor's shell: time, events, exceptions. Time is the count of clocks, so two runs are the
same run.

Unicorn executes instructions but, for M-profile processors, neither interrupts nor their return;
both are done here as ARM v7-M B1.5.6 to B1.5.8 say: eight words on the stack, EXC_RETURN in lr, and
back. There is one stack (MSP), no SVC and no MPU: the image uses none of them, and an attempt ends
the run with a clear error.
"""

import heapq
import struct
from collections.abc import Callable

from emulator import cycles as cy
from emulator.engine import EXCEPTION, EmulationError, Engine
from emulator.nvic import Nvic

EXC_RETURN_HANDLER, EXC_RETURN_THREAD = 0xFFFFFFF1, 0xFFFFFFF9
ENTRY_CLOCKS = EXIT_CLOCKS = 12  # Cortex-M3 TRM 3.9.1; tail-chaining (6) is not modelled
WFI = 0xBF30
THUMB = 1 << 24
ALIGNED = 1 << 9


class Event:
    """Something that happens at a clock; `cancelled` keeps it from happening."""

    __slots__ = ("at", "action", "cancelled")

    def __init__(self, at: int, action: Callable[[], None]) -> None:
        self.at, self.action, self.cancelled = at, action, False


class Core:
    """Runs the image; peripherals schedule events and raise interrupt lines."""

    def __init__(self) -> None:
        self.engine = Engine()
        self.state = self.engine.state
        self.nvic = Nvic(self)
        self.asleep = False
        self.idle = 0  # clocks asleep
        self.warped = 0  # clocks that a busy wait would have taken, of those not asleep
        self.exceptions = 0
        self.lowest_sp = 0xFFFFFFFF
        self.on_reset: Callable[[str], None] = lambda why: None
        self._pc = 0
        self._events: list[tuple[int, int, Event]] = []
        self._number = 0
        self._reset_wanted = ""

    @property
    def now(self) -> int:
        """Clocks since power came."""
        return self.state[cy.CYCLES]

    @property
    def instructions(self) -> int:
        """Instructions executed since power came."""
        return self.state[cy.INSTRUCTIONS]

    def schedule(self, at: int, action: Callable[[], None]) -> Event:
        """Call action when the clock reaches `at`."""
        event = Event(at, action)
        self._number += 1
        heapq.heappush(self._events, (at, self._number, event))
        if at < self.state[cy.DEADLINE]:
            self.state[cy.DEADLINE] = at
        return event

    def attend(self) -> None:
        """Leave the present slice at its next block: an interrupt may have come."""
        self.state[cy.DEADLINE] = self.state[cy.CYCLES]

    def wait_until(self, at: int) -> None:
        """Skip a busy wait: the clock goes on to `at`, but not beyond what happens before."""
        step = min(at, self.state[cy.DEADLINE]) - self.state[cy.CYCLES]
        if step > 0:
            self.state[cy.CYCLES] += step
            self.warped += step

    def request_reset(self, why: str) -> None:
        """Reset the processor as soon as the present slice ends."""
        self._reset_wanted = why
        self.attend()

    def boot(self) -> None:
        """Take stack and start from the vectors."""
        sp, start = struct.unpack("<II", self.engine.read(0, 8))
        if not start & 1:
            raise EmulationError(
                f"image: the reset vector {start:#010x} is no Thumb address; is this an image at"
                " all?"
            )
        self.engine.set_frame([0, 0, 0, 0, 0, 0xFFFFFFFF, start & ~1, THUMB, sp])
        self.engine.set("PRIMASK", 0)
        self.engine.set("BASEPRI", 0)
        self._pc, self.asleep = start & ~1, False
        self.nvic.reset()

    def run_until(self, end: int) -> None:
        """Run to the clock `end`; a block of instructions that has begun is finished."""
        state, events, nvic = self.state, self._events, self.nvic
        while state[cy.CYCLES] < end:
            now = state[cy.CYCLES]
            while events and events[0][0] <= now:
                event = heapq.heappop(events)[2]
                if not event.cancelled:
                    event.action()
            if self._reset_wanted:
                self._reset()
            deadline = min(end, events[0][0]) if events else end
            if nvic.waiting:
                self.asleep = False
                number = nvic.next()
                if number and self._masked(number):
                    deadline = min(deadline, now + 1)  # block by block until the mask is lifted
                elif number:
                    self._enter(number)
            if self.asleep:
                if deadline > now:
                    self.idle += deadline - now
                    state[cy.CYCLES] = deadline
                continue
            self._slice(deadline)

    def _slice(self, deadline: int) -> None:
        code = self.engine.run(self._pc, deadline)
        self._pc = self.engine.get("PC") & ~1
        if code == 0 and self.state[cy.STOPPED]:
            return
        if code == 0 and self.engine.code_before(self._pc) == WFI:
            self.asleep = True
        elif code == EXCEPTION and self._pc >= 0xFFFFFFE0 and self.nvic.active:
            self._leave()
        else:
            frame = self.engine.frame()
            raise EmulationError(
                f"image: fault (Unicorn error {code}) at pc {self._pc:#010x}, lr {frame[5]:#010x},"
                f" sp {frame[8]:#010x}, exception {frame[7] & 0x1FF}, clock {self.now}: look the"
                " addresses up in the map file"
            )

    def _masked(self, number: int) -> bool:
        if self.engine.get("PRIMASK") & 1:
            return True
        base = self.engine.get("BASEPRI") & 0xF8
        return bool(base) and self.nvic.priority(number) >= base

    def _enter(self, number: int) -> None:
        engine = self.engine
        frame = engine.frame()
        sp, xpsr = frame[8], frame[7]
        pad = sp & 4
        low = sp - pad - 32
        stacked = frame[:6] + [self._pc, (xpsr | THUMB) & ~ALIGNED | (ALIGNED if pad else 0)]
        engine.write_frame(low, stacked)
        handler = engine.flash_word(self.nvic.vectors + 4 * number)
        frame[5] = EXC_RETURN_HANDLER if self.nvic.active else EXC_RETURN_THREAD
        frame[6], frame[7], frame[8] = handler & ~1, THUMB | number, low
        engine.set_frame(frame)
        self._pc = handler & ~1
        self.nvic.enter(number)
        self.exceptions += 1
        self.lowest_sp = min(self.lowest_sp, low)
        self.state[cy.CYCLES] += ENTRY_CLOCKS
        self.state[cy.LAST_END] = -1

    def _leave(self) -> None:
        engine = self.engine
        sp = engine.get("SP")
        r0, r1, r2, r3, r12, lr, pc, xpsr = engine.read_frame(sp)
        sp += 32 + (4 if xpsr & ALIGNED else 0)
        self.nvic.leave()
        number = self.nvic.active[-1] if self.nvic.active else 0
        engine.set_frame([r0, r1, r2, r3, r12, lr, pc, xpsr & ~ALIGNED & ~0x1FF | number, sp])
        self._pc = pc
        self.state[cy.CYCLES] += EXIT_CLOCKS
        self.state[cy.LAST_END] = -1

    def _reset(self) -> None:
        why, self._reset_wanted = self._reset_wanted, ""
        self.on_reset(why)
        self.boot()
