"""What an instruction costs, and the hook in C (cycles.c) that counts it before each block runs.

Costs are those of the Cortex-M3 Technical Reference Manual (r2p0, table 18-1), taken high where it
gives a span: loads and stores 2, load and store multiple 1 + N, a taken branch 1 + 2 for the
refilled pipeline, divisions 8 (2 to 12), 64-bit products 5 (3 to 7), anything else 1. Flash: at 96
MHz a line of 16 bytes takes 5 clocks; lines that follow each other are fetched ahead, so straight
code does not wait, and a taken branch out of the current line waits FLASH_WAIT clocks. The real
accelerator also remembers branch targets, so this is on the safe side.
"""

import ctypes
from pathlib import Path

CYCLES, DEADLINE, INSTRUCTIONS, LAST_END, STOP, STOPPED, CODE, CODE_SIZE, FLASH_WAIT_AT = range(9)
STATE_SIZE = 9
FLASH_WAIT = 4  # clocks beyond the first, FLASHCFG of 96 MHz


def _library() -> ctypes.CDLL:
    """The compiled hook, which is built with the core."""
    found = sorted(Path(__file__).parent.glob("_cycles.*"))
    if not found:
        raise ImportError("emulator/_cycles is not built: run `make setup`")
    return ctypes.CDLL(str(found[0]))


_hook = _library()
on_block = ctypes.cast(_hook.gf_on_block, ctypes.c_void_p)
"""Unicorn's UC_HOOK_BLOCK: stops at the deadline, else counts the block. Address: `.value`."""


def narrow_cost(op: int) -> int:
    """Clocks of a 16-bit instruction, without the refill of a branch."""
    return _hook.gf_narrow_cost(ctypes.c_uint32(op))


def wide_cost(first: int, second: int) -> int:
    """Clocks of a 32-bit instruction, without the refill of a branch."""
    return _hook.gf_wide_cost(ctypes.c_uint32(first), ctypes.c_uint32(second))
