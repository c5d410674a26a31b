"""What a receiver can prove (docs/protocol.md, Damage): 100,000 frames, one in a hundred damaged, five ways.

The truth is kept beside the stream: which frames were built, which the device dropped, which had a byte touched.
"""

import random
from bisect import bisect_right
from dataclasses import dataclass, field
from itertools import accumulate

import pytest
from protocol_support import receive

from firmware_protocol.codec import FLAG_DROPPED, Damaged, Deframer, Event, Frame, encode
from firmware_protocol.frames import Acc12, Gps, Status
from firmware_protocol.ledger import Ledger

N_FRAMES = 100_000
N_DAMAGES = 1_000
N_DROPS = 150
ROWS = tuple(tuple((i * 12 + k) * 7919 % 1021 - 510 for k in range(12)) for i in range(8))


@dataclass
class Truth:
    """A damaged stream and everything that is true of it."""

    wire: bytes = b""
    sent: dict[int, bytes] = field(default_factory=dict)  # seq -> wire bytes, without those the device dropped
    samples: dict[int, int] = field(default_factory=dict)  # seq -> samples inside, with those the device dropped
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


def build(chance: random.Random, truth: Truth) -> None:
    """The frames of a device that drops some of its own, and says so."""
    drops = set(chance.sample(range(1, N_FRAMES - 1), N_DROPS))
    index = dropped = 0
    flags = 0
    for seq in range(N_FRAMES):
        if seq % 100 == 99 or seq == N_FRAMES - 1:
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


@pytest.fixture(scope="module")
def truth() -> Truth:
    """About 6 MB of frames; damage from the back to the front, so that places ahead stay what they were."""
    chance, truth = random.Random(20_260), Truth()
    build(chance, truth)
    seqs = list(truth.sent)
    starts = [0, *accumulate(len(truth.sent[seq]) for seq in seqs)]
    wire = bytearray(b"".join(truth.sent.values()))
    # the first frame starts the count and the last ends it: what lies outside of them nobody can prove
    places = sorted(chance.sample(range(starts[1], starts[-2] - 300), N_DAMAGES), reverse=True)
    for i, at in enumerate(places):
        size = DAMAGES[i % len(DAMAGES)](wire, at, chance)
        first, last = bisect_right(starts, at) - 1, bisect_right(starts, at + size - 1) - 1
        truth.touched.update(seqs[first : last + 1])
    truth.wire = bytes(wire)
    return truth


@pytest.fixture(scope="module")
def received(truth) -> tuple[Deframer, Ledger, list[Event]]:
    return receive(truth.wire)


def frames_of(events: list[Event]) -> list[Frame]:
    return [event for event in events if isinstance(event, Frame)]


def test_1_every_byte_is_accounted_for(truth, received):
    deframer, ledger, events = received
    assert ledger.bytes_in == len(truth.wire) == ledger.good_bytes + ledger.bad_bytes + deframer.pending
    assert ledger.bad_chunks == sum(isinstance(event, Damaged) for event in events) >= N_DAMAGES // 2
    assert {"crc", "cobs", "short", "long", "idle"} <= set(ledger.damage)


def test_2_lost_frames_are_the_true_loss(truth, received):
    _, ledger, events = received
    true_loss = N_FRAMES - len(frames_of(events))
    assert ledger.lost_frames == true_loss > N_DROPS
    assert ledger.bad_chunks != ledger.lost_frames - N_DROPS  # they are not the same thing
    assert (ledger.reboots, ledger.repeated_frames, ledger.unknown_frames) == (0, 0, 0)


def test_2_only_touched_frames_are_lost(truth, received):
    """No amplification: two delimiters and COBS never lose a frame that nobody touched."""
    arrived = {frame.seq for frame in frames_of(received[2])}
    assert set(truth.sent) - arrived <= truth.touched


def test_3_no_frame_is_accepted_that_differs(truth, received):
    wrong = [frame.seq for frame in frames_of(received[2])
             if frame[:6] != Deframer().feed(truth.sent[frame.seq])[0][:6]]
    assert wrong == []


def test_4_lost_minus_dropped_is_the_loss_of_the_link(truth, received):
    _, ledger, events = received
    arrived = {frame.seq for frame in frames_of(events)}
    assert ledger.device_dropped == len(truth.dropped) == N_DROPS
    assert ledger.link_lost == len(set(truth.sent) - arrived) == ledger.lost_frames - ledger.device_dropped


def test_4_gaps_in_first_index_are_the_lost_samples(truth, received):
    _, ledger, events = received
    arrived = [frame.seq for frame in frames_of(events) if frame.type == Acc12.TYPE]
    span = range(arrived[0], arrived[-1] + 1)
    total = sum(truth.samples.get(seq, 0) for seq in span)
    assert ledger.lost_samples == total - sum(truth.samples[seq] for seq in arrived) > 0


@pytest.mark.parametrize("longest", [3, 20, 5000])
def test_5_any_cutting_gives_the_same_events(truth, received, longest):
    chance, deframer, events, at = random.Random(longest), Deframer(), [], 0
    wire = truth.wire[: 100_000 * longest]  # small pieces take long
    while at < len(wire):
        size = chance.randint(0, longest)
        events += deframer.feed(wire[at : at + size])
        at += size
    assert events == received[2][: len(events)]
    if len(wire) == len(truth.wire):
        assert len(events) == len(received[2]) and deframer.pending == received[0].pending
