"""The board: the LPC1768 with the image in it, four ADXL345, and the wiring.

Pins, memory and interrupts are those of firmware_protocol/port/lpc1768/README.md.
"""

import struct
from collections.abc import Callable, Iterator
from pathlib import Path

from emulator.adxl345 import Adxl345
from emulator.core import Core
from emulator.engine import EmulationError
from emulator.nvic import BASE as PPB
from emulator.nvic import SIZE as PPB_SIZE
from emulator.ssp import Ssp
from emulator.system import (
    BROWN_OUT,
    EXTERNAL,
    WATCHDOG,
    BackupRegisters,
    BootRom,
    Registers,
    SystemControl,
    Watchdog,
)
from emulator.timer import Adc, Gpio, Timer
from emulator.uart import Uart
from emulator.world import SENSOR_FAULTS, Fault, World

# Hz, what the image sets; the short start on the internal oscillator is counted as if at this clock
CCLK = 96_000_000
RAM, RAM_SIZE = 0x10000000, 0x8000
AHB_RAM, AHB_RAM_SIZE = 0x2007C000, 0x8000
BOOT_ROM, BOOT_ROM_SIZE = 0x1FFF0000, 0x2000
GPIO_BASE = 0x2009C000
CHIP_SELECTS = {(0, 16): 0, (2, 5): 1, (0, 6): 2, (2, 4): 3}  # (port, pin): sensor
SENSOR_BUS = (0, 0, 1, 1)  # SSP of each sensor
DIRECTION_PIN, DIRECTION_STRAP, EMULATED_STRAP = 1 << 2, 1 << 1, 1 << 0  # of port 2
TACHO, PPS = 0, 1  # capture channels of TIMER2
VREF = 3.3  # V, full scale of the converter
STACK_TOP = RAM_SIZE - 32  # bytes from the start of RAM; the boot ROM has the rest
PAINT = 0xC5C5C5C5  # what the image fills its stack with


class Board:
    """Powered from the start; `run(seconds)` lets it live. `sink` gets what the host's UART sends.

    Deterministic: the same image, world, faults and fed bytes at the same times give the same bytes
    at the same times.
    """

    def __init__(
        self, image: bytes | Path, world: World | None = None, faults: list[Fault] | None = None
    ) -> None:
        """image: the flash from address 0, or the path of its .bin. Raises EmulationError and
        EmulatorMissing.
        """
        data = image.read_bytes() if isinstance(image, Path) else image
        self.world = world or World()
        self.core = core = Core()
        if not 512 <= len(data) <= len(core.engine.flash):
            raise EmulationError(
                f"image of {len(data)} bytes, want 512 to {len(core.engine.flash)}: is it the .bin?"
            )
        core.engine.flash[: len(data)] = memoryview(data)
        self.clocks_per_s = CCLK * (1.0 + self.world.clock_error)
        self.resets: list[tuple[float, str]] = []
        self.sink: Callable[[bytes], None] = lambda data: None
        self._sent = bytearray()
        self._peripherals()
        self._sensors()
        self._memory()
        core.on_reset = self._reset
        core.boot()
        self._feed_world()
        for fault in faults or []:
            self.schedule(fault.at_s, lambda fault=fault: self.inject(fault))

    def _peripherals(self) -> None:
        core, system = self.core, SystemControl()
        self.system = system
        self.watchdog = Watchdog(core, system)
        self.uart0 = Uart(core, system, "uart0", 5)
        self.uart2 = Uart(core, system, "uart2", 7)
        self.uart0.sink = lambda byte, clock: self._sent.append(byte)
        self.ssp = (Ssp(core, system, "ssp0", 14), Ssp(core, system, "ssp1", 15))
        self.timer2 = Timer(core, system, "timer2", 3)
        self.adc = Adc(core, system, 22)
        self.adc.level = lambda channel, clock: int(
            self.world.analog(channel, clock / self.clocks_per_s) / VREF * 4096
        )
        self.gpio = Gpio()
        self.gpio.inputs[2] &= ~(EMULATED_STRAP | DIRECTION_STRAP)
        self.gpio.changed = self._pins
        self.backup = BackupRegisters()
        self._at = {
            0x40000000: self.watchdog,
            0x400FC000: system,
            0x4000C000: self.uart0,
            0x40098000: self.uart2,
            0x40088000: self.ssp[0],
            0x40030000: self.ssp[1],
            0x40034000: self.adc,
            GPIO_BASE: self.gpio,
            0x40004000: Timer(core, system, "timer0", 1),
            0x40008000: Timer(core, system, "timer1", 2),
            0x40090000: self.timer2,
            0x40094000: Timer(core, system, "timer3", 4),
            0x40010000: Uart(core, system, "uart1", 6),
            0x4009C000: Uart(core, system, "uart3", 8),
            0x40024000: self.backup,
            0x4002C000: Registers(),
            0x40028000: Registers(),
        }

    def _memory(self) -> None:
        engine = self.core.engine
        for base, device in self._at.items():
            engine.map_device(base, 0x4000, device.read, device.write)
        engine.map_device(PPB, PPB_SIZE, self.core.nvic.read, self.core.nvic.write)
        engine.map_ram(RAM, RAM_SIZE)
        engine.map_ram(AHB_RAM, AHB_RAM_SIZE)
        engine.map_ram(BOOT_ROM, BOOT_ROM_SIZE)
        engine.write(BootRom.ENTRY, BootRom.code)
        rom = BootRom(self.core, self.world.uid)
        engine.map_device(BootRom.MAILBOX, 0x1000, rom.read, rom.write)

    def _sensors(self) -> None:
        world = self.world
        self.sensors = [
            Adxl345(
                lambda t, k=k: world.counts(k, t),
                self.clocks_per_s,
                world.odr_error[k],
                world.phase[k],
            )
            for k in range(4)
        ]
        for sensor, bus in zip(self.sensors, SENSOR_BUS, strict=True):
            self.ssp[bus].devices.append(sensor)

    @property
    def now_s(self) -> float:
        """World time since power came, s."""
        return self.core.now / self.clocks_per_s

    def run(self, until_s: float) -> bytes:
        """Live until this time; what the host's UART has sent since the last call, handed to `sink`
        too.
        """
        self.core.run_until(int(until_s * self.clocks_per_s))
        self.uart0.flush()
        data = bytes(self._sent)
        self._sent.clear()
        if data:
            self.sink(data)
        return data

    def feed(self, data: bytes) -> None:
        """Bytes from the host."""
        self.uart0.feed(data)

    def schedule(self, at_s: float, action: Callable[[], None]) -> None:
        """Do something to the world at a time."""
        self.core.schedule(int(at_s * self.clocks_per_s), action)

    def inject(self, fault: Fault) -> None:
        """Let something go wrong now."""
        if fault.name in SENSOR_FAULTS:
            self.sensors[fault.sensor].state = SENSOR_FAULTS[fault.name]
        elif fault.name == "uart-stall":
            self.uart0.hold(int(fault.seconds * self.clocks_per_s))
        else:
            self.core.request_reset(fault.name)

    def stack_used(self) -> int:
        """Bytes of stack ever touched, by the paint that the image puts there."""
        words = struct.unpack(f"<{STACK_TOP // 4}I", self.core.engine.read(RAM, STACK_TOP))
        longest = end = run = 0
        for i, word in enumerate(
            words
        ):  # locals that were never written leave paint inside the used part
            run = run + 1 if word == PAINT else 0
            if run > longest:
                longest, end = run, i + 1
        return STACK_TOP - 4 * end if longest else 0

    def _pins(self, port: int, old: int, new: int) -> None:
        changed = old ^ new
        for (of, pin), sensor in CHIP_SELECTS.items():
            if of == port and changed >> pin & 1:
                self.sensors[sensor].select(not new >> pin & 1, self.core.now)

    def _reset(self, why: str) -> None:
        self.resets.append((self.now_s, why))
        self.system.cause = {"brown-out": BROWN_OUT, "watchdog": WATCHDOG}.get(why, EXTERNAL)
        for device in self._at.values():
            device.reset()
        if why == "brown-out":  # the sensors' supply failed too, and the main memory's
            for sensor in self.sensors:
                sensor.reset()
            self.core.engine.write(RAM, bytes(RAM_SIZE))

    def _feed_world(self) -> None:
        world = self.world
        self._follow(world.pulses(), lambda item: item[0], self._pulse)
        self._follow(world.pps(), lambda item: item, lambda item: self.timer2.edge(PPS, True))
        self._follow(world.gnss(), lambda item: item[0], lambda item: self.uart2.feed(item[1]))

    def _follow(self, items: Iterator, time_of: Callable, action: Callable) -> None:
        """Let the items of an iterator happen one after the other, each scheduled when the one
        before has happened.
        """

        def happen(item: object) -> None:
            action(item)
            follow()

        def follow() -> None:
            item = next(items, None)
            if item is not None:
                self.schedule(max(time_of(item), 0.0), lambda: happen(item))

        follow()

    def _pulse(self, pulse: tuple[float, int]) -> None:
        if not pulse[1]:
            return
        pins = self.gpio.inputs[2] & ~DIRECTION_PIN
        self.gpio.inputs[2] = pins | (DIRECTION_PIN if pulse[1] > 0 else 0)
        self.timer2.edge(TACHO, True)
