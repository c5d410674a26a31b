"""What an instruction costs, and the compiled hook that counts it before each block of code runs.

Costs are those of the Cortex-M3 Technical Reference Manual (r2p0, table 18-1), taken high where it
gives a span: loads and stores 2, load and store multiple 1 + N, a taken branch 1 + 2 for the
refilled pipeline, divisions 8 (2 to 12), 64-bit products 5 (3 to 7), anything else 1. Flash: at 96
MHz a line of 16 bytes takes 5 clocks; lines that follow each other are fetched ahead, so straight
code does not wait, and a taken branch out of the current line waits FLASH_WAIT clocks. The real
accelerator also remembers branch targets, so this is on the safe side.
"""

import numpy as np
from llvmlite import ir
from numba import carray, cfunc, njit, types
from numba.extending import intrinsic

CYCLES, DEADLINE, INSTRUCTIONS, LAST_END, STOP, STOPPED, CODE, CODE_SIZE, FLASH_WAIT_AT = range(9)
STATE_SIZE = 9
REFILL = 2  # clocks, after a taken branch
FLASH_WAIT = 4  # clocks beyond the first, FLASHCFG of 96 MHz
LINE = 0xFFFFFFF0  # flash is read in lines of 16 bytes


@intrinsic
def _call(typing_context, function, argument):
    """function(argument) for the address of a C function that takes and returns one pointer-sized
    integer.
    """

    def generate(context, builder, signature, arguments):
        word = ir.IntType(64)
        pointer = builder.inttoptr(arguments[0], ir.FunctionType(word, [word]).as_pointer())
        return builder.call(pointer, [arguments[1]])

    return types.int64(types.int64, types.int64), generate


@intrinsic
def _halfword(typing_context, address):
    """Unsigned 16-bit value in memory."""

    def generate(context, builder, signature, arguments):
        pointer = builder.inttoptr(arguments[0], ir.IntType(16).as_pointer())
        return builder.zext(builder.load(pointer), ir.IntType(64))

    return types.int64(types.int64), generate


@njit
def _ones(mask: int) -> int:
    n = 0
    while mask:
        n += mask & 1
        mask >>= 1
    return n


@njit
def narrow_cost(op: int) -> int:
    """Clocks of a 16-bit instruction, without the refill of a branch."""
    top = op >> 11
    if top == 0b01001 or op >> 12 == 0b0101 or op >> 13 == 0b011 or op >> 12 in (0b1000, 0b1001):
        return 2
    if op & 0xF600 == 0xB400:  # push, pop
        return 1 + _ones(op & 0x1FF)
    if op >> 12 == 0b1100:  # stm, ldm
        return 1 + _ones(op & 0xFF)
    return 1


@njit
def wide_cost(first: int, second: int) -> int:
    """Clocks of a 32-bit instruction, without the refill of a branch."""
    if first & 0xFE40 == 0xE800:  # stm, ldm
        return 1 + _ones(second)
    if first & 0xFE40 == 0xE840:  # ldrd, strd, exclusive, tbb
        return 3
    if first & 0xFE00 == 0xF800:
        return 2
    if first & 0xFFD0 == 0xFB90:  # sdiv, udiv
        return 8
    if first & 0xFF80 == 0xFB80:  # umull, smlal ...
        return 5
    return 1


@njit
def block_cost(code: int, size: int) -> tuple[int, int]:
    """Clocks and instructions of `size` bytes of Thumb code at an address of this process."""
    clocks = count = at = 0
    while at < size:
        first = _halfword(code + at)
        if first >> 11 >= 0b11101 and at + 2 < size:
            clocks += wide_cost(first, _halfword(code + at + 2))
            at += 4
        else:
            clocks += narrow_cost(first)
            at += 2
        count += 1
    return clocks, count


@cfunc(types.void(types.int64, types.uint64, types.uint32, types.CPointer(types.int64)), cache=True)
def on_block(engine, address, size, data):
    """Unicorn's UC_HOOK_BLOCK: stop at the deadline, else count the block."""
    state = carray(data, STATE_SIZE)
    if state[CYCLES] >= state[DEADLINE]:
        if state[STOPPED] == 0:
            state[STOPPED] = 1
            _call(state[STOP], engine)
        return
    at, n = np.int64(address), np.int64(size)
    if at + n <= state[CODE_SIZE]:
        clocks, count = block_cost(state[CODE] + at, n)
        if at != state[LAST_END]:
            clocks += REFILL
            if at & LINE != state[LAST_END] & LINE:
                clocks += state[FLASH_WAIT_AT]
    else:
        clocks, count = n >> 1, n >> 1
    state[LAST_END] = at + n
    state[CYCLES] += clocks
    state[INSTRUCTIONS] += count
