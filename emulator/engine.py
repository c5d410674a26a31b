"""The few calls of the Unicorn engine that are made thousands of times in a second, without the
binding's own cost.

Unicorn's GPL engine is an extra for tests and demonstrations; nothing else in the project imports
it.
"""

import ctypes
import struct
from collections.abc import Callable

import numpy as np

from emulator import cycles as cy

FLASH_SIZE = 512 << 10
EXCEPTION = 21  # UC_ERR_EXCEPTION: also what a jump to an EXC_RETURN value ends with
NOWHERE = 0xFFFFFFF0  # no code there: emu_start's mandatory end address
HOOK_BLOCK = 8
PAGE = 0x4000

_FRAME = struct.Struct("<8I")

Read = Callable[[int, int], int]  # offset, size -> value
Write = Callable[[int, int, int], None]  # offset, size, value

_READ = ctypes.CFUNCTYPE(
    ctypes.c_uint64, ctypes.c_void_p, ctypes.c_uint64, ctypes.c_uint, ctypes.c_void_p
)
_WRITE = ctypes.CFUNCTYPE(
    None, ctypes.c_void_p, ctypes.c_uint64, ctypes.c_uint, ctypes.c_uint64, ctypes.c_void_p
)


class EmulatorMissing(ImportError):
    """Unicorn is not installed."""


class EmulationError(RuntimeError):
    """The image did what the processor cannot do; the text says where."""


class Engine:
    """A Cortex-M3 with memory, registers by position, and a clock that counts as cycles.py says."""

    def __init__(self) -> None:
        """Raises EmulatorMissing."""
        try:
            import unicorn
            from unicorn import arm_const as arm
            from unicorn.unicorn_py3.unicorn import uclib
        except ImportError as error:
            raise EmulatorMissing(
                f"the emulated board needs the package unicorn ({error}): pip install"
                " --require-hashes -r requirements/board.txt"
            ) from None
        self._unicorn = unicorn.Uc(
            unicorn.UC_ARCH_ARM, unicorn.UC_MODE_THUMB | unicorn.UC_MODE_MCLASS
        )
        self._unicorn.ctl_set_cpu_model(arm.UC_CPU_ARM_CORTEX_M3)
        self._library, self._handle = uclib, self._unicorn._uch
        self._start, self._read_many, self._write_many = (
            uclib.uc_emu_start,
            uclib.uc_reg_read_batch,
            uclib.uc_reg_write_batch,
        )
        self.state = (ctypes.c_int64 * cy.STATE_SIZE)()
        self.flash = np.full(FLASH_SIZE, 0xFF, dtype=np.uint8)
        self._flash_view = memoryview(self.flash)
        self._buffer = ctypes.create_string_buffer(64)
        self._kept: list[object] = []
        self._map_flash()
        self._hook()
        frame = ("R0", "R1", "R2", "R3", "R12", "LR", "PC", "XPSR", "SP")
        self._frame = _Registers([getattr(arm, f"UC_ARM_REG_{name}") for name in frame])
        self._one = {
            name: _Registers([getattr(arm, f"UC_ARM_REG_{name}")])
            for name in (*frame, "PRIMASK", "BASEPRI")
        }

    def _map_flash(self) -> None:
        state = self.state
        self._check(
            self._library.uc_mem_map_ptr(
                self._handle, 0, FLASH_SIZE, 5, ctypes.c_void_p(self.flash.ctypes.data)
            )
        )
        state[cy.CODE], state[cy.CODE_SIZE], state[cy.FLASH_WAIT_AT] = (
            self.flash.ctypes.data,
            FLASH_SIZE,
            cy.FLASH_WAIT,
        )
        state[cy.STOP] = ctypes.cast(self._library.uc_emu_stop, ctypes.c_void_p).value

    def _hook(self) -> None:
        hook = ctypes.c_size_t()
        self._check(
            self._library.uc_hook_add(
                self._handle,
                ctypes.byref(hook),
                HOOK_BLOCK,
                cy.on_block,
                ctypes.cast(self.state, ctypes.c_void_p),
                ctypes.c_uint64(1),
                ctypes.c_uint64(0),
            )
        )

    def map_ram(self, address: int, size: int) -> None:
        """Memory that can be written and executed."""
        self._unicorn.mem_map(address, size)

    def map_device(self, address: int, size: int, read: Read, write: Write) -> None:
        """Registers: read(offset, size) and write(offset, size, value) are called for every
        access.
        """

        def on_read(_engine: int, offset: int, width: int, _data: int) -> int:
            return read(offset, width) & 0xFFFFFFFF

        def on_write(_engine: int, offset: int, width: int, value: int, _data: int) -> None:
            write(offset, width, value)

        calls = (_READ(on_read), _WRITE(on_write))
        self._kept.append(calls)
        self._check(
            self._library.uc_mmio_map(
                self._handle,
                ctypes.c_uint64(address),
                ctypes.c_uint64(size),
                ctypes.cast(calls[0], ctypes.c_void_p),
                None,
                ctypes.cast(calls[1], ctypes.c_void_p),
                None,
            )
        )

    def run(self, pc: int, deadline: int) -> int:
        """Execute from pc until the clock reaches the deadline, WFI, or a jump to EXC_RETURN; the
        code of Unicorn.
        """
        state = self.state
        state[cy.DEADLINE], state[cy.STOPPED] = deadline, 0
        return self._start(self._handle, pc | 1, NOWHERE, 0, 0)

    def frame(self) -> list[int]:
        """r0 r1 r2 r3 r12 lr pc xpsr sp."""
        registers = self._frame
        self._read_many(self._handle, registers.ids, registers.pointers, 9)
        return registers.values[:]

    def set_frame(self, values: list[int]) -> None:
        """r0 r1 r2 r3 r12 lr pc xpsr sp."""
        registers = self._frame
        registers.values[:] = values
        self._write_many(self._handle, registers.ids, registers.pointers, 9)

    def get(self, name: str) -> int:
        """One register."""
        register = self._one[name]
        self._read_many(self._handle, register.ids, register.pointers, 1)
        return register.values[0]

    def set(self, name: str, value: int) -> None:
        """One register."""
        register = self._one[name]
        register.values[0] = value & 0xFFFFFFFF
        self._write_many(self._handle, register.ids, register.pointers, 1)

    def read(self, address: int, size: int) -> bytes:
        """Memory."""
        return bytes(self._unicorn.mem_read(address, size))

    def write(self, address: int, data: bytes) -> None:
        """Memory, flash too."""
        self._unicorn.mem_write(address, data)

    def code_before(self, address: int) -> int:
        """The halfword of flash in front of an address; 0 outside of the flash."""
        view = self._flash_view
        return view[address - 2] | view[address - 1] << 8 if 2 <= address <= FLASH_SIZE else 0

    def flash_word(self, address: int) -> int:
        """A word of the flash."""
        return int.from_bytes(self._flash_view[address : address + 4], "little")

    def read_frame(self, address: int) -> tuple[int, ...]:
        """Eight words of a stacked exception frame; raises EmulationError when the stack is not in
        memory.
        """
        self._check_stack(
            self._library.uc_mem_read(
                self._handle, ctypes.c_uint64(address), self._buffer, ctypes.c_uint64(32)
            ),
            address,
        )
        return _FRAME.unpack_from(self._buffer)

    def write_frame(self, address: int, words: list[int]) -> None:
        """Stack an exception frame; raises EmulationError when the stack is not in memory."""
        self._check_stack(
            self._library.uc_mem_write(
                self._handle, ctypes.c_uint64(address), _FRAME.pack(*words), ctypes.c_uint64(32)
            ),
            address,
        )

    @staticmethod
    def _check_stack(code: int, address: int) -> None:
        if code:
            raise EmulationError(
                f"image: stack pointer {address:#010x} is outside of the memory: stack overflow?"
            )

    @staticmethod
    def _check(code: int) -> None:
        if code:
            raise EmulationError(f"the Unicorn engine refuses its set-up with error {code}")


class _Registers:
    """Arrays for the engine's batch calls."""

    def __init__(self, ids: list[int]) -> None:
        n = len(ids)
        self.ids = (ctypes.c_int * n)(*ids)
        self.values = (ctypes.c_uint32 * n)()
        self.pointers = (ctypes.c_void_p * n)(
            *[ctypes.addressof(self.values) + 4 * i for i in range(n)]
        )
