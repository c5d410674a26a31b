"""The firmware: sizes, and the load of 12 axes at 3.2 kHz over 3 Mbaud, counted in clocks of the
emulated image.

The emulator counts each instruction at the price in the Cortex-M3's manual, a flash wait at every
taken branch out of the line that is open, and the SSP and UART at the rates of their dividers
(emulator/cycles.py). cpu_permille is the image's own figure: all time not asleep, also that spent
waiting for the sensors' bus.
"""

import json
import struct
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]

from firmware_protocol.codec import Deframer, Frame, encode  # noqa: E402
from firmware_protocol.frames import Acc12, Command, Status  # noqa: E402
from firmware_protocol.spec import SPEC  # noqa: E402

SETTINGS = {entry["name"]: entry["id"] for entry in SPEC.raw["setting"]}
IMAGE = ROOT / "build" / "firmware" / "gyrofree.bin"
RAM_OF_STACK = 32 * 1024 - 32


def report(**figures: object) -> None:
    print(json.dumps(figures))


def sizes() -> tuple[int, int]:
    """Bytes of flash, and of RAM without the stack."""
    text = subprocess.run(
        ["arm-none-eabi-size", str(IMAGE.with_suffix(".elf"))],
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    code, data, bss = map(int, text.splitlines()[1].split()[:3])
    return code + data, data + bss


def load(rate_hz: int, baud: int) -> tuple[Status, int, int]:
    """The last STATUS of a board that has run at this rate for two seconds; bytes it sent; overruns
    of its line.
    """
    from emulator.board import Board

    board, deframer, frames, sent = Board(IMAGE), Deframer(), [], 0

    def live(until_s: float) -> None:
        nonlocal sent
        data = board.run(until_s)
        sent += len(data)
        frames.extend(event for event in deframer.feed(data) if isinstance(event, Frame))

    live(0.1)
    for i, (name, value) in enumerate((("baud", baud), ("rate_hz", rate_hz))):
        board.feed(
            encode(Command(SETTINGS[name], i, struct.pack("<I", value)), epoch=0, seq=i, t_us=0)
        )
        live(0.2 + 0.1 * i)
    before, sent = len(frames), 0
    live(3.2)
    rows = sum(len(f.payload.counts) for f in frames[before:] if f.type == Acc12.TYPE)
    return [f.payload for f in frames if f.type == Status.TYPE][-1], rows, sent


def main() -> None:
    subprocess.run(
        ["make", "-s", "-C", str(ROOT), "firmware"], check=True, stdout=subprocess.DEVNULL
    )
    flash, ram = sizes()
    for rate_hz, baud in ((100, 921_600), (1000, 921_600), (3200, 3_000_000)):
        status, rows, sent = load(rate_hz, baud)
        report(
            bench="firmware_load",
            rate_hz=rate_hz,
            baud=baud,
            cpu_percent=status.cpu_permille / 10,
            line_percent=round(1000 * sent / 2.9 / baud, 1),
            samples_per_s=round(rows / 2.9),
            missed=status.missed_ticks,
            dropped=status.dropped,
            goal="<= 60 % at 3200 Hz",
        )
    stack = RAM_OF_STACK - ram - status.free_stack
    report(
        bench="firmware_size",
        flash_bytes=flash,
        ram_bytes=ram,
        stack_bytes=stack,
        ram_with_stack=ram + stack,
        goal="flash <= 24576, RAM <= 24576",
    )


if __name__ == "__main__":
    main()
