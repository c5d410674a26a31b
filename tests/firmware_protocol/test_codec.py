"""Properties of the wire: what goes in comes out, cuts do not matter, damage is found, counted and
over at once.
"""

import logging
from zlib import crc32

import pytest
from cobs import cobs
from hypothesis import given, settings
from hypothesis import strategies as st
from support.protocol_support import headers, payloads, receive

from firmware_protocol.codec import MAX_BODY, REASONS, Damaged, Deframer, Frame, FrameError, encode
from firmware_protocol.frames import Acc12, Adc, Gps, Hello, Tacho, Unknown
from firmware_protocol.payloads import length_rules, shortage
from firmware_protocol.spec import SPEC

unhurried = settings(deadline=None)  # a busy machine is no reason to fail

frames = st.builds(lambda payload, header: encode(payload, **header), payloads, headers)
# Noise reaches past every limit: the longest chunk is 510 bytes, the longest idle line 511.
noise = st.one_of(
    st.binary(max_size=40),
    st.binary(max_size=1200),
    st.builds(lambda byte, n: bytes([byte]) * n, st.integers(0, 255), st.integers(505, 1540)),
    st.builds(lambda n: b"\0" * n, st.integers(1, 3)),
)


@st.composite
def damaged_frames(draw: st.DrawFn) -> bytes:
    """A frame with a byte changed, cut out, or put in; delimiters too."""
    wire = draw(frames)
    at, size = draw(st.integers(0, len(wire) - 1)), draw(st.integers(0, 19))
    return wire[:at] + draw(st.binary(max_size=3)) + wire[at + size :]


streams = st.lists(st.one_of(frames, noise, damaged_frames()), max_size=8).map(b"".join)


@unhurried
@given(payload=payloads, header=headers)
def test_what_goes_in_comes_out(payload, header):
    wire = encode(payload, **header)
    assert wire[0] == wire[-1] == 0 and 0 not in wire[1:-1] and len(wire) <= SPEC.max_wire
    _, _, [frame] = receive(wire)
    assert (frame.payload, frame.epoch, frame.flags, frame.seq, frame.t_us, frame.wire_size) == (
        payload,
        header["epoch"],
        header["flags"],
        header["seq"],
        header["t_us"],
        len(wire),
    )


@unhurried
@given(wire=streams, data=st.data())
def test_chunking_does_not_matter(wire, data):
    cuts = sorted(data.draw(st.lists(st.integers(0, len(wire)), max_size=8)))
    whole, by_byte, cut = Deframer(), Deframer(), Deframer()
    events = whole.feed(wire)
    assert [event for byte in wire for event in by_byte.feed(bytes([byte]))] == events
    pieces = [wire[a:b] for a, b in zip([0, *cuts], [*cuts, len(wire)], strict=True)]
    assert [event for piece in pieces for event in cut.feed(piece)] == events
    assert whole.pending == by_byte.pending == cut.pending <= MAX_BODY + 1
    assert whole.close() == by_byte.close() == cut.close()


@unhurried
@given(wire=streams, read=st.integers(1, 2000))
def test_every_byte_has_an_event_or_is_pending(wire, read):
    deframer, ledger, events = receive(wire, read)
    assert ledger.bytes_in == len(wire) and ledger.unaccounted(deframer.pending) == 0
    assert all(event.reason in REASONS for event in events if isinstance(event, Damaged))
    assert max((event.wire_size for event in events), default=0) <= SPEC.max_wire
    events += deframer.close()
    assert deframer.pending == 0 and sum(event.wire_size for event in events) == len(wire)
    if all(isinstance(event, Damaged) for event in events):
        assert b"".join(event.data for event in events) == wire


@unhurried
@given(before=noise, wire=frames)
def test_noise_before_a_frame_costs_no_frame(before, wire):
    _, _, events = receive(before + wire)
    assert isinstance(events[-1], Frame)
    assert events[-1][:6] == Deframer().feed(wire)[0][:6]


@unhurried
@given(damaged=damaged_frames(), after=frames)
def test_the_frame_after_a_damaged_one_arrives(damaged, after):
    _, _, events = receive(damaged + after)
    assert events[-1][:6] == Deframer().feed(after)[0][:6]


@unhurried
@given(payload=payloads, header=headers, more=st.binary(min_size=1, max_size=8))
def test_longer_payloads_are_whole_and_shorter_are_not(payload, header, more):
    _, _, [frame] = receive(encode(payload, **header))
    longer = encode(Unknown(frame.type, frame.raw[: SPEC.max_payload - len(more)] + more), **header)
    if len(frame.raw) + len(more) <= SPEC.max_payload:
        _, _, [event] = receive(longer)
        layout = SPEC.layouts.get(frame.type)
        if layout and not (layout.tail and layout.tail.raw):
            assert event.payload == payload
    for cut in range(0, len(frame.raw), 7):
        shorter = frame.raw[:cut]
        _, _, [event] = receive(encode(Unknown(frame.type, shorter), **header))
        if shortage(frame.type, shorter):
            assert event.reason == "payload" and "wants" in event.detail
        else:
            assert event.raw == shorter


@unhurried
@given(type_=st.integers(0, 255), payload=st.binary(max_size=SPEC.max_payload))
def test_the_quick_length_check_is_the_slow_one(type_, payload):
    _, _, [event] = receive(encode(Unknown(type_, payload), epoch=0, seq=0, t_us=0))
    assert isinstance(event, Damaged) == bool(shortage(type_, payload))
    assert (length_rules()[type_] is None) == (type_ not in SPEC.layouts)


@pytest.mark.parametrize(
    ("payload", "words"),
    [
        (
            Acc12(0, 1, 15, 0, ((0,) * 12,) * 20),
            "492 bytes, the wire carries 488: put fewer samples",
        ),
        (Acc12(0, 1, 15, 0, ((0,) * 11,)), "a row of counts has 11 values, wants 12"),
        (Acc12(0, 1, 15, 0, ((32768,) + (0,) * 11,)), "ACC12 does not fit its fields"),
        (Adc(0, 1, 0b111, 3300, ((1, 2),)), "wants 3"),
        (Tacho(0, 0, (0,) * 256), "TACHO does not fit its fields"),
        (Gps(bytes(489)), "489 bytes"),
        (Hello(0, 0, 0, 0, 0, 0, 0, version=(1, 2)), "version has 2 values, the wire carries 3"),
    ],
)
def test_what_does_not_fit_the_wire_is_refused(payload, words):
    with pytest.raises(FrameError, match=words):
        encode(payload, epoch=0, seq=0, t_us=0)


def test_a_time_that_does_not_fit_the_header_is_refused():
    with pytest.raises(FrameError, match="t_us -1"):
        encode(Gps(b""), epoch=0, seq=0, t_us=-1)


def test_a_firmware_name_is_kept_and_too_long_a_one_refused():
    hello = Hello(1, 1, 15, 12, 1, 1, 1, uid=b"\1", firmware="sim 0.1")
    assert hello.firmware_text == "sim 0.1" and len(hello.uid) == 16
    assert Hello(1, 1, 15, 12, 1, 1, 1, firmware="ff" * 20).firmware_text == "ff" * 20
    with pytest.raises(ValueError, match="21 bytes, the wire carries 20"):
        Hello(1, 1, 15, 12, 1, 1, 1, firmware="x" * 21)


def test_another_major_version_is_said_once(caplog):
    body = bytes([0xA2]) + bytes(15)
    foreign = b"\0" + cobs.encode(body + crc32(body).to_bytes(4, "little")) + b"\0"
    with caplog.at_level(logging.WARNING, "firmware_protocol"):
        _, ledger, events = receive(foreign * 3 + encode(Gps(b"ours"), epoch=0, seq=0, t_us=0))
    assert ledger.damage == {"version": 3} and isinstance(events[-1], Frame)
    assert len(caplog.records) == 1 and "proto 0xa2" in caplog.records[0].message


def test_the_end_of_a_stream_inside_a_frame_is_an_event():
    deframer = Deframer()
    wire = encode(Gps(b"half"), epoch=0, seq=0, t_us=0)
    assert deframer.feed(wire[:9]) == [] and deframer.pending == 9
    assert deframer.close() == [Damaged(wire[:9], "unfinished", "9 bytes at the end of the stream")]
    assert deframer.pending == 0 and deframer.close() == []
    [frame] = deframer.feed(wire)
    assert frame.payload == Gps(b"half") and frame.payload is frame.payload
