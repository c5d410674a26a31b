"""Frames per second of the live path: wire bytes to events, payloads not yet decoded.  Prints one
line of JSON.

The stream is ACC12 with one frame in a hundred damaged, read 4096 bytes at a time, one thread.  The
baseline is the deframer one would write first: a loop over bytes in Python, with the same CRC from
zlib.

    python tests/bench/bench_deframe.py [seconds per figure]
"""

import json
import random
import sys
import time
from collections.abc import Callable
from zlib import crc32

from firmware_protocol.codec import RESIDUE, Deframer, Frame, encode
from firmware_protocol.frames import Acc12
from firmware_protocol.ledger import Ledger

READ = 4096  # bytes
N_FRAMES = 5000


def stream(n: int) -> bytes:
    """Frames of n samples, one in a hundred with a wrong byte."""
    chance, wires = random.Random(n), []
    for seq in range(N_FRAMES):
        rows = tuple(tuple(chance.randint(-512, 511) for _ in range(12)) for _ in range(n))
        wire = bytearray(
            encode(Acc12(seq * n, 1_000_000, 15, 0, rows), epoch=1, seq=seq, t_us=seq * n * 1000)
        )
        if seq % 100 == 50:
            wire[chance.randrange(1, len(wire) - 1)] ^= 0x41
        wires.append(bytes(wire))
    return b"".join(wires)


class ByteLoop:
    """The baseline: unstuffs byte by byte, and leaves out all accounting."""

    def __init__(self) -> None:
        self._body = bytearray()
        self._left = 0
        self._zero = False

    def feed(self, data: bytes) -> list[bytes]:
        frames = []
        for byte in data:
            if byte == 0:
                if len(self._body) >= 20 and crc32(self._body) == RESIDUE:
                    frames.append(bytes(self._body))
                self._body.clear()
                self._left, self._zero = 0, False
            elif self._left:
                self._body.append(byte)
                self._left -= 1
            else:
                if self._zero:
                    self._body.append(0)
                self._left, self._zero = byte - 1, byte < 255
        return frames


def with_ledger(wire: bytes) -> int:
    deframer, ledger = Deframer(), Ledger()
    for at in range(0, len(wire), READ):
        data = wire[at : at + READ]
        ledger.received(len(data))
        for event in deframer.feed(data):
            ledger.count(event)
    return ledger.good_frames


def decoded(wire: bytes) -> int:
    deframer = Deframer()
    return sum(
        bool(event.payload)
        for at in range(0, len(wire), READ)
        for event in deframer.feed(wire[at : at + READ])
        if isinstance(event, Frame)
    )


def feeding(make: Callable[[], Deframer | ByteLoop]) -> Callable[[bytes], int]:
    def run(wire: bytes) -> int:
        deframer = make()
        return sum(len(deframer.feed(wire[at : at + READ])) for at in range(0, len(wire), READ))

    return run


def rate(run: Callable[[bytes], int], wire: bytes, seconds: float) -> float:
    """Frames per second of one core, best pass within a time: processor time, because others share
    the machine.
    """
    best, end = 0.0, time.perf_counter() + seconds
    while time.perf_counter() < end:
        start = time.process_time()
        run(wire)
        best = max(best, N_FRAMES / (time.process_time() - start))
    return round(best)


def main(seconds: float = 1.0) -> dict:
    """The figures, by name."""
    result: dict = {"bench": "deframe", "unit": "frames/s"}
    for n in (1, 8):
        wire = stream(n)
        live, loop = rate(feeding(Deframer), wire, seconds), rate(feeding(ByteLoop), wire, seconds)
        result |= {
            f"n{n}": live,
            f"n{n}_with_ledger": rate(with_ledger, wire, seconds),
            f"n{n}_payload_decoded": rate(decoded, wire, seconds),
            f"n{n}_byte_loop": loop,
            f"n{n}_ratio": round(live / loop, 1),
        }
    return result


if __name__ == "__main__":
    print(json.dumps(main(*map(float, sys.argv[1:]))))
