"""Frames with a good CRC and any values, from a seed; and a good board among them."""

import random
import struct
from collections.abc import Iterator
from zlib import crc32

from cobs import cobs

from firmware_protocol.codec import CRC_SIZE, HEADER, PROTO, encode
from firmware_protocol.frames import Acc12
from firmware_protocol.spec import SPEC

EXTREMES = (0, 1, 2, 2**31 - 1, 2**31, 2**32 - 1)
PERIOD_NS = 10_000_000


def wire(type_: int, epoch: int, flags: int, seq: int, t_us: int, payload: bytes) -> bytes:
    """Any frame at all, with its CRC."""
    body = HEADER.pack(PROTO, type_, epoch, flags, seq, t_us) + payload
    return b"\0" + cobs.encode(body + crc32(body).to_bytes(CRC_SIZE, "little")) + b"\0"


def payload(rng: random.Random, type_: int) -> bytes:
    """Random bytes, long enough for the type, with many zeros and ones among them."""
    layout = SPEC.layouts.get(type_)
    least = 0 if layout is None else layout.size
    data = bytearray(rng.randbytes(rng.randrange(least, SPEC.max_payload + 1)))
    for _ in range(rng.randrange(12)):
        if len(data) >= 4:
            at = rng.randrange(len(data) - 3)
            data[at : at + 4] = struct.pack("<I", rng.choice(EXTREMES))
    if layout is not None and layout.tail and not layout.tail.raw and rng.random() < 0.9:
        data[layout.offsets[layout.tail.count]] = rng.randrange(20)
    return bytes(data)


def anything(rng: random.Random) -> bytes:
    """A frame of any boot, place and time."""
    type_ = rng.choice([*SPEC.layouts, rng.randrange(256)])
    t_us = rng.choice((0, rng.getrandbits(64), rng.getrandbits(40), 2**55, rng.getrandbits(24)))
    seq = rng.choice((*EXTREMES, rng.getrandbits(32), rng.randrange(1000)))
    return wire(type_, rng.randrange(256), rng.randrange(16), seq, t_us, payload(rng, type_))


def good(k: int, seq: int, epoch: int = 5) -> bytes:
    """The k-th frame of a good board: two samples every 20 ms."""
    counts = tuple(tuple((k * 7 + row + axis) % 400 - 200 for axis in range(12)) for row in (0, 1))
    frame = Acc12(2 * k, PERIOD_NS, 0xF, 0, counts)
    return encode(frame, epoch=epoch, seq=seq, t_us=1_000_000_000 + 20_000 * k)


def mixed(seed: int, count: int) -> Iterator[tuple[bytes, bool]]:
    """`count` frames, and whether each is the good board's: strays, and frames in the very place
    of the good board's story whose payload is nonsense.
    """
    rng, k, seq = random.Random(seed), 0, 0
    for _ in range(count):
        dice = rng.random()
        if dice < 0.5:
            yield good(k, seq), True
            k, seq = k + 1, seq + 1
        elif dice < 0.75:
            yield anything(rng), False
        else:
            type_ = rng.choice([t for t in SPEC.layouts if t != 0x10])
            t_us = 1_000_000_000 + 20_000 * k + rng.randrange(20_000)
            yield wire(type_, 5, rng.randrange(16), seq, t_us, payload(rng, type_)), False
            seq += 1


def story(seed: int, count: int) -> Iterator[bytes]:
    """`count` frames of one board, boot after boot, that go on from each other; their payloads are
    nonsense.
    """
    rng, seq, t_us, epoch = random.Random(seed), 0, 0, 1
    for _ in range(count):
        type_ = rng.choice([*SPEC.layouts])
        if rng.random() < 0.01:
            epoch, seq, t_us = rng.randrange(256), 0, 0
        seq += rng.choice((1, 1, 1, 2, 0))
        t_us += rng.choice((0, 1, 10_000, 10_000, 1_000_000))
        yield wire(type_, epoch, rng.randrange(16), seq, t_us, payload(rng, type_))
