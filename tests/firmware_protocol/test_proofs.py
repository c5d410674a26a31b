"""What a receiver can prove (docs/protocol.md, Damage): 100,000 frames, one in a hundred damaged,
five ways.

The truth is kept beside the stream: which frames were built, which the device dropped, which had a
byte touched.
"""

import random

import pytest
from support.protocol_damage import Truth, damaged_truth
from support.protocol_support import receive

from firmware_protocol.codec import Damaged, Deframer, Event, Frame
from firmware_protocol.frames import Acc12
from firmware_protocol.ledger import Ledger

N_FRAMES = 100_000
N_DAMAGES = 1_000
N_DROPS = 150


@pytest.fixture(scope="module")
def truth() -> Truth:
    """About 6 MB of frames."""
    return damaged_truth(20_260, N_FRAMES, N_DAMAGES, N_DROPS)


@pytest.fixture(scope="module")
def received(truth) -> tuple[Deframer, Ledger, list[Event]]:
    return receive(truth.wire)


def frames_of(events: list[Event]) -> list[Frame]:
    return [event for event in events if isinstance(event, Frame)]


def test_1_every_byte_is_accounted_for(truth, received):
    deframer, ledger, events = received
    assert (
        ledger.bytes_in
        == len(truth.wire)
        == ledger.good_bytes + ledger.bad_bytes + deframer.pending
    )
    assert (
        ledger.bad_chunks == sum(isinstance(event, Damaged) for event in events) >= N_DAMAGES // 2
    )
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
    wrong = [
        frame.seq
        for frame in frames_of(received[2])
        if frame[:6] != Deframer().feed(truth.sent[frame.seq])[0][:6]
    ]
    assert wrong == []


def test_4_lost_minus_dropped_is_the_loss_of_the_link(truth, received):
    _, ledger, events = received
    arrived = {frame.seq for frame in frames_of(events)}
    assert ledger.device_dropped == len(truth.dropped) == N_DROPS
    assert (
        ledger.link_lost
        == len(set(truth.sent) - arrived)
        == ledger.lost_frames - ledger.device_dropped
    )


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
