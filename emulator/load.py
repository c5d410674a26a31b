"""How busy the image keeps the processor, by instruction count.

Busy is every clock outside WFI: instructions at the cost that cycles.py states (Cortex-M3 manual,
taken high; a taken branch out of its 16-byte flash line waits 4 clocks), 12 clocks for each entry
to and return from an exception, and the whole time of every SPI transfer, which the image waits for
by polling. Not in it: wait states of the peripheral buses (1 to 2 clocks per access) and the flash
accelerator's branch buffer, which work against each other.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from emulator.board import Board
from emulator.world import World


@dataclass(frozen=True)
class Load:
    """Of one stretch of time."""

    seconds: float
    busy: float  # fraction of clocks outside WFI
    spi_wait: float  # fraction of clocks spent waiting for transfers, part of busy
    instructions_per_s: float
    clocks_per_instruction: float  # waiting left out
    exceptions_per_s: float
    host_bytes_per_s: float
    stack_bytes: int  # deepest use since power came, by the image's paint


def load(
    image: bytes | Path,
    world: World | None = None,
    commands: bytes = b"",
    settle_s: float = 0.5,
    seconds: float = 1.0,
    follow_up: Callable[[Board], None] | None = None,
) -> Load:
    """Boot the image, send the bytes of `commands` after 0.1 s, let it settle, and measure for
    `seconds`.

    follow_up(board) is called before settling ends the wait, for what bytes at one baud rate cannot
    say.
    """
    board = Board(image, world)
    board.run(0.1)
    if commands:
        board.feed(commands)
    if follow_up is not None:
        follow_up(board)
    board.run(board.now_s + settle_s)
    core, start = board.core, board.now_s
    before = (core.now, core.idle, core.warped, core.instructions, core.exceptions)
    sent = len(board.run(start + seconds))
    clocks, idle, warped, instructions, exceptions = (
        now - then
        for now, then in zip(
            (core.now, core.idle, core.warped, core.instructions, core.exceptions),
            before,
            strict=True,
        )
    )
    passed = clocks / board.clocks_per_s
    working = clocks - idle - warped
    return Load(
        seconds=passed,
        busy=1.0 - idle / clocks,
        spi_wait=warped / clocks,
        instructions_per_s=instructions / passed,
        clocks_per_instruction=working / max(instructions, 1),
        exceptions_per_s=exceptions / passed,
        host_bytes_per_s=sent / passed,
        stack_bytes=board.stack_used(),
    )
