"""The checks made from the contract: what may come in, and that the quick way and the long way say
the same.
"""

import logging
import math

import pytest
from google.protobuf.descriptor import FieldDescriptor as F
from hypothesis import given
from hypothesis import strategies as st

from messages.contract import checks, topics
from messages.contract import gyrofree_pb2 as pb
from messages.contract.door import Door, read

OURS = sorted({t.type for t in topics.TOPICS}, key=lambda type_: type_.DESCRIPTOR.name)
ORDERS = (pb.BoardCommand, pb.RecorderCommand, pb.EstimatorCommand, pb.HistoryQuery)
floats = st.floats() | st.sampled_from([0.0, -1.0, 1e-9, 1e5, 1.1e5, -1e9, 1e300])
WHOLE = {
    F.CPPTYPE_INT32: st.integers(-(2**31), 2**31 - 1),
    F.CPPTYPE_INT64: st.integers(-(2**63), 2**63 - 1),
    F.CPPTYPE_UINT32: st.integers(0, 2**32 - 1) | st.integers(0, 70),
    F.CPPTYPE_UINT64: st.integers(0, 2**64 - 1),
    F.CPPTYPE_BOOL: st.booleans(),
    F.CPPTYPE_ENUM: st.integers(-2, 12),
    F.CPPTYPE_DOUBLE: floats,
    F.CPPTYPE_FLOAT: floats,
    F.CPPTYPE_STRING: st.sampled_from(["", "cube", "Cube", "a b", "x" * 33, "y" * 5000]),
}


def value_of(draw, field):
    if field.type == F.TYPE_BYTES:
        return draw(st.binary(max_size=8))
    return draw(WHOLE[field.cpp_type])


def fill(draw, message, depth=0):
    """Some fields of a message with values that fit their types, extremes among them."""
    for field in message.DESCRIPTOR.fields:
        if not draw(st.booleans()) or field.message_type is not None and depth > 2:
            continue
        target = getattr(message, field.name)
        if field.message_type is not None and field.message_type.GetOptions().map_entry:
            for k in range(draw(st.integers(0, 3))):
                target[f"k{k}"] = k
        elif field.is_repeated and field.message_type is not None:
            for _ in range(draw(st.integers(0, 2))):
                fill(draw, target.add(), depth + 1)
        elif field.is_repeated:
            one = value_of(draw, field)
            target.extend([one] * draw(st.sampled_from([0, 1, 3, 12, 36, 5000])))
            if target and draw(st.booleans()):
                target[-1] = value_of(draw, field)
        elif field.message_type is not None:
            target.SetInParent()
            fill(draw, target, depth + 1)
        else:
            setattr(message, field.name, value_of(draw, field))
    return message


@given(st.data())
def test_the_quick_way_lets_nothing_in_that_the_long_way_refuses(data):
    message = fill(data.draw, data.draw(st.sampled_from([*OURS, *ORDERS]))())
    found = list(checks._explain(message, ""))
    assert bool(checks.check(message)) == bool(found)
    if checks._compiled(message.DESCRIPTOR)(message):
        assert not found
    assert all(one.kind in checks.KINDS for one in found)


def batch(**fields):
    header = pb.Header(device="cube", sequence=5, device_us=1000, utc_ns=1_700_000_000 * 10**9)
    sound = dict(header=header, first_index=3, period_s=0.01, axes=12, f_mps2=[9.8] * 24)
    return pb.AccelBatch(**(sound | fields))


def test_an_ordinary_batch_is_sound():
    assert checks.check(batch()) == []
    assert checks.check(batch(f_mps2=[9e4] * 12 * 200)) == []  # many large ones, none too large


@pytest.mark.parametrize(
    ("fields", "kind", "field"),
    [
        ({"axes": 1000, "f_mps2": [1.0] * 1000}, "range", "axes"),
        ({"axes": 0}, "length", "f_mps2"),
        ({"f_mps2": [1.0] * 25}, "length", "f_mps2"),
        ({"f_mps2": [1.0] * 12 * (checks.ROWS + 1)}, "length", "f_mps2"),
        ({"f_mps2": [1.0] * 23 + [math.nan]}, "number", "f_mps2[23]"),
        ({"f_mps2": [1.0] * 23 + [-math.inf]}, "number", "f_mps2[23]"),
        ({"f_mps2": [1.0] * 23 + [1e6]}, "range", "f_mps2[23]"),
        ({"period_s": math.nan}, "number", "period_s"),
        ({"period_s": -1.0}, "range", "period_s"),
        ({"header": pb.Header(utc_ns=-1)}, "range", "header.utc_ns"),
        ({"header": pb.Header(device_us=1 << 55)}, "range", "header.device_us"),
        ({"header": pb.Header(device="Cube")}, "name", "header.device"),
        ({"header": pb.Header(source=77)}, "value", "header.source"),
    ],
)
def test_what_is_wrong_is_named(fields, kind, field):
    (wrong,) = checks.check(batch(**fields))
    assert (wrong.kind, wrong.field) == (kind, field)
    assert "want" in str(wrong)


def test_estimates_may_say_that_nothing_is_known():
    assert checks.check(pb.RateBatch(omega_ib_b_radps=[math.nan] * 3, nis=[math.inf])) == []
    assert checks.check(pb.NavSolution(sigma=[math.inf] * 15)) == []
    assert checks.check(pb.NavSolution(p_ned_m=[1.0, 2.0, math.nan], height_m=math.nan)) == []
    assert checks.check(pb.GnssFix(height_m=math.nan, v_n_mps=[1.0, 2.0, math.nan])) == []
    assert checks.check(pb.GnssFix(v_n_mps=[1.0, 2e5, math.nan])) != []
    assert checks.check(pb.NavSolution(latitude_deg=math.nan, longitude_deg=math.nan)) == []
    (wrong,) = checks.check(pb.NavSolution(p_ned_m=[math.inf] * 3))
    assert wrong.field == "p_ned_m[0]"


@given(payload=st.binary(max_size=200), topic=st.sampled_from(topics.TOPICS))
def test_any_bytes_give_a_message_or_a_reason(payload, topic):
    message, refusal = read(topic, payload, "cube")
    assert (message is None) != (refusal is None)
    assert message is None or checks.check(message) == []


def test_a_door_counts_by_kind_and_device_and_says_it_ever_more_rarely(caplog):
    door = Door("room")
    address = door.address("t/cube/accel")
    with caplog.at_level(logging.WARNING):
        for _ in range(100):
            assert door.message(address, batch(axes=0).SerializeToString()) is None
    assert door.counts() == {"length": 100} and door.of("cube") == {"length": 100}
    lines = [record.getMessage() for record in caplog.records]
    assert len(lines) == 7 and "f_mps2 is" in lines[0]
    assert door.message(address, batch().SerializeToString()) == batch()
    stranger = batch(header=pb.Header(device="other"))
    assert door.message(address, stranger.SerializeToString()) is None
    assert door.message(address, b"\xff") is None
    assert door.of("cube") == {"length": 100, "device": 1, "bytes": 1}


def test_a_flood_of_names_keys_and_devices_is_bounded():
    door = Door("room", most_devices=4, most_streams=6)
    for k in range(5000):
        assert door.address(f"t/Cube{k}/accel") is None
        address = door.address(f"t/cube{k}/accel")
        assert door.admit("key", address, 100) == (k < 4)
    assert door.counts() == {"key": 5000, "many": 4996}
    for k in range(9):
        assert door.admit("key", door.address(f"t/cube0/rate/e{k}"), 9) == (k < 2)
    assert not door.admit("key", door.address("t/cube0/accel"), checks.MESSAGE_BYTES + 1)
    assert len(door._addresses) <= 4096 + 1


def test_a_device_that_is_silent_for_long_makes_room(monkeypatch):
    now = [0.0]
    monkeypatch.setattr("messages.contract.door.time.monotonic", lambda: now[0])
    door = Door("room", most_devices=2, gone_s=60.0)
    for k, admitted in ((0, True), (1, True), (2, False)):
        now[0] += 1.0
        assert door.admit("key", door.address(f"t/d{k}/accel"), 9) == admitted
    now[0] = 61.5
    assert door.admit("key", door.address("t/d1/accel"), 9)  # still there
    assert door.admit("key", door.address("t/d2/accel"), 9) and door.gone() == ["d0"]
    assert not door.admit("key", door.address("t/d0/accel"), 9) and door.gone() == []


@pytest.mark.parametrize("key", ["t/Cube/accel", "T/cube/accel", "t//accel", "t/cube/rate/<b>"])
def test_a_key_with_a_name_that_is_none_is_refused(key):
    with pytest.raises(topics.TopicError, match="want"):
        topics.parse(key)
