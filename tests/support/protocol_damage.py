"""Streams of frames damaged in five ways, and everything that is true of them."""

import random
from bisect import bisect_right
from dataclasses import dataclass, field
from itertools import accumulate

from firmware_protocol.codec import FLAG_DROPPED, encode
from firmware_protocol.frames import Acc12, Gps, Status

ROWS = tuple(tuple((i * 12 + k) * 7919 % 1021 - 510 for k in range(12)) for i in range(8))


@dataclass
class Truth:
    """A damaged stream and everything that is true of it."""

    wire: bytes = b""
    sent: dict[int, bytes] = field(
        default_factory=dict
    )  # seq -> wire bytes, without those the device dropped
    samples: dict[int, int] = field(
        default_factory=dict
    )  # seq -> samples inside, with those the device dropped
    touched: set[int] = field(default_factory=set)  # seq of frames of which damage changed a byte
    dropped: list[int] = field(default_factory=list)


def flip_bit(wire: bytearray, at: int, chance: random.Random) -> int:
    wire[at] ^= 1 << chance.randrange(8)
    return 1


def replace_byte(wire: bytearray, at: int, chance: random.Random) -> int:
    wire[at] = chance.choice((0, chance.randrange(256)))
    return 1


def cut_out(wire: bytearray, at: int, chance: random.Random) -> int:
    size = chance.randrange(1, 20)
    del wire[at : at + size]
    return size


def put_in(wire: bytearray, at: int, chance: random.Random) -> int:
    wire[at:at] = chance.choice((chance.randbytes(chance.randrange(1, 20)), chance.randbytes(600)))
    return 1


def burst(wire: bytearray, at: int, chance: random.Random) -> int:
    size = min(chance.randrange(1, 300), len(wire) - at)
    wire[at : at + size] = chance.randbytes(size)
    return size


DAMAGES = (flip_bit, replace_byte, cut_out, put_in, burst)


def build(chance: random.Random, truth: Truth, n_frames: int, n_drops: int) -> None:
    """The frames of a device that drops some of its own, and says so."""
    drops = set(chance.sample(range(1, n_frames - 1), n_drops))
    index = dropped = 0
    flags = 0
    for seq in range(n_frames):
        if seq % 100 == 99 or seq == n_frames - 1:
            payload = Status(built=seq, sent=seq - dropped, dropped=dropped, last_seq=seq - 1)
        elif seq % 50 == 25:
            payload = Gps(chance.randbytes(chance.randrange(200)))
        else:
            n = chance.choice((1, 1, 1, 1, 2, 8))
            payload = Acc12(index, 10_000_000, 15, 0, ROWS[:n])
            truth.samples[seq] = n
            index += n
        if seq in drops:
            dropped, flags = dropped + 1, FLAG_DROPPED
            truth.dropped.append(seq)
            continue
        truth.sent[seq] = encode(payload, epoch=1, seq=seq, t_us=10_000 * seq, flags=flags)
        flags = 0


def damaged_truth(seed: int, n_frames: int, n_damages: int, n_drops: int) -> Truth:
    """Frames of a device, damaged from the back to the front, so that places ahead stay what they
    were.
    """
    chance, truth = random.Random(seed), Truth()
    build(chance, truth, n_frames, n_drops)
    seqs = list(truth.sent)
    starts = [0, *accumulate(len(truth.sent[seq]) for seq in seqs)]
    wire = bytearray(b"".join(truth.sent.values()))
    # the first frame starts the count and the last ends it: what lies outside of them nobody can
    # prove
    places = sorted(chance.sample(range(starts[1], starts[-2] - 300), n_damages), reverse=True)
    for i, at in enumerate(places):
        size = DAMAGES[i % len(DAMAGES)](wire, at, chance)
        first, last = bisect_right(starts, at) - 1, bisect_right(starts, at + size - 1) - 1
        truth.touched.update(seqs[first : last + 1])
    truth.wire = bytes(wire)
    return truth
