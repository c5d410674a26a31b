"""What must never change: vectors.toml against the Python side.  test_protocol_core.py runs the
same against C.
"""

import dataclasses
from collections import Counter

import pytest
from support.protocol_support import payload_of, receive, stream_bytes, vectors

from firmware_protocol.codec import REASONS, Event, Frame, encode
from firmware_protocol.ledger import Ledger
from firmware_protocol.spec import SPEC

FRAMES = vectors()["frame"]
STREAMS = vectors()["stream"]
COUNTERS = [field.name for field in dataclasses.fields(Ledger) if field.type is int]


def by_name(vector: dict) -> str:
    return vector["name"]


def test_vectors_are_counted():
    assert vectors()["count"] == {"frames": len(FRAMES), "streams": len(STREAMS)}
    names = [vector["name"] for vector in FRAMES + STREAMS]
    assert len(set(names)) == len(names)


def test_every_frame_type_has_a_vector():
    found = {vector["type"] for vector in FRAMES}
    missing = [layout.name for type_, layout in SPEC.layouts.items() if type_ not in found]
    assert not missing, f"vectors.toml has no [[frame]] for {missing}: add fields and bytes"
    assert found - set(SPEC.layouts), "vectors.toml has no frame of an unknown type"


def test_every_reason_has_a_stream():
    found = {word for vector in STREAMS for word in vector["ledger"].get("damage", {})}
    assert found == set(REASONS) - {"unfinished"}, (
        "unfinished needs the end of a stream, see test_protocol_codec"
    )


@pytest.mark.parametrize("vector", FRAMES, ids=by_name)
def test_fields_become_these_bytes_and_come_back(vector):
    payload = payload_of(vector)
    header = {name: int(vector[name]) for name in ("epoch", "flags", "seq", "t_us")}
    wire = bytes.fromhex(vector["wire"])
    assert encode(payload, **header).hex() == wire.hex()
    _, _, [frame] = receive(wire)
    assert (frame.payload, frame.wire_size) == (payload, len(wire))
    assert {name: getattr(frame, name) for name in header} == header


def said(event: Event) -> str:
    if isinstance(event, Frame):
        return f"F {event.type:02x} {event.epoch} {event.seq} {event.wire_size}"
    return f"D {event.reason} {event.wire_size}"


@pytest.mark.parametrize("read", [1, 7, 4096])
@pytest.mark.parametrize("vector", STREAMS, ids=by_name)
def test_streams_give_these_events_and_this_ledger(vector, read):
    deframer, ledger, events = receive(stream_bytes(vector), read)
    assert [said(event) for event in events] == vector["events"]
    assert deframer.pending == vector["pending"]
    assert ledger.unaccounted(deframer.pending) == 0
    expected = dict(vector["ledger"])
    assert ledger.damage == Counter(expected.pop("damage", {}))
    assert {name: getattr(ledger, name) for name in COUNTERS} == {
        name: expected.get(name, 0) for name in COUNTERS
    }
    assert expected.keys() <= set(COUNTERS)
