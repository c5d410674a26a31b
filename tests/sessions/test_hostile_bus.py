"""The recorder and what others put on its bus: it goes on, keeps what is good, counts and names
what it refuses, and the file stays readable.
"""

import logging
import time

import pytest
import zenoh
from foxglove_schemas_protobuf.LocationFix_pb2 import LocationFix
from mcap.reader import make_reader
from support.waiting import until

from messages.bus.session import BusSettings
from messages.contract import gyrofree_pb2 as pb
from messages.contract.checks import MESSAGE_BYTES
from messages.contract.topics import TOPICS
from messages.history.mending import Mender
from messages.history.mending_state import FARTHEST, MOST_IDLE, Arrival
from sessions.library.catalogue import Catalogue
from sessions.recording import mcap_append
from sessions.recording.keys import largest
from sessions.recording.mcap_append import descriptor_set
from sessions.recording.mcap_log import Damage, read
from sessions.recording.recorder import Recorder
from sessions.recording.settings import RecorderSettings
from tests.sessions.test_bus import START, STOP, bus, client, order, recording  # noqa: F401
from tests.sessions.test_store import T0, accel
from tests.support import hostile_bus


@pytest.fixture
def recorder(tmp_path):
    """Messages go into its inbox by `give`; `end` ends it and reads its file."""
    recorder = Recorder(
        RecorderSettings(root=tmp_path / "root", max_devices=20, auto_start=True),
        BusSettings(prefix="t"),
    )
    recorder.step()

    def give(key: str, payload: bytes) -> None:
        recorder._inbox.append((time.time_ns(), key, payload))
        recorder.step()

    def end():
        recorder.close()
        (info,) = Catalogue(tmp_path / "root").list()
        path = tmp_path / "root" / info.id / "recording.mcap"
        damage = Damage()
        rows = list(read(path, damage))
        assert str(damage) == "no damage"
        with path.open("rb") as stream:
            assert len(list(make_reader(stream).iter_messages())) == len(rows)
        return Catalogue(tmp_path / "root").manifest(info.id), rows

    return give, end


def header_of(**fields) -> bytes:
    sound = dict(device="cube", sequence=3, utc_ns=T0, run=7)
    return pb.AccelBatch(header=pb.Header(**(sound | fields)), axes=12).SerializeToString()


LONG_AGO = LocationFix()
LONG_AGO.timestamp.seconds = -(10**12)
FAR = LocationFix()
FAR.timestamp.seconds = 2**62


@pytest.mark.parametrize(
    ("key", "payload", "kind", "device"),
    [
        ("t/Cube/accel", header_of(), "key", "others"),
        ("t/cube/rate/<b>", header_of(), "key", "others"),
        ("t/cube/accel", header_of(utc_ns=-1), "range", "cube"),
        ("t/cube/accel", header_of(utc_ns=2**63 - 1), "range", "cube"),
        ("t/cube/accel", header_of(device_us=2**64 - 1), "range", "cube"),
        ("t/cube/accel", header_of(sequence=2**64 - 1), "range", "cube"),
        ("t/cube/accel", header_of(run=2**64 - 1), "range", "cube"),
        ("t/cube/accel", header_of(device="car"), "device", "cube"),
        ("t/cube/accel", header_of() + bytes(MESSAGE_BYTES), "size", "cube"),
    ],
)
def test_what_would_break_the_file_is_refused_named_and_stands_in_the_certificate(
    recorder, caplog, key, payload, kind, device
):
    give, end = recorder
    give("t/cube/accel", accel(1))
    with caplog.at_level(logging.WARNING):
        give(key, payload)
    assert "refused" in caplog.text and "want" in caplog.text
    give("t/cube/accel", accel(2))
    manifest, rows = end()
    assert manifest.refused == {device: {kind: 1}}
    assert [row.payload for row in rows] == [accel(1), accel(2)]
    certificate = manifest.certificate["cube"]
    assert certificate["complete"] == (device == "others")
    assert certificate["topics"]["accel"]["lost"] == 0


@pytest.mark.parametrize("fix", [LONG_AGO, FAR])
def test_the_time_of_another_type_that_is_none_is_the_time_of_receipt(recorder, fix):
    give, end = recorder
    give("t/cube/location", fix.SerializeToString())
    _, (row,) = end()
    assert row.publish_ns == row.log_ns > T0 and row.payload == fix.SerializeToString()


def test_more_devices_than_there_is_room_for(recorder):
    give, end = recorder
    for k in range(3000):
        give(f"t/d{k}/accel", header_of(device=f"d{k}", sequence=1))
    give("t/d3/accel", header_of(device="d3", sequence=2))
    manifest, rows = end()
    assert manifest.refused == {"others": {"many": 2980}} and len(rows) == 21
    assert manifest.certificate["d3"]["complete"]


def test_a_sequence_that_jumps_to_the_moon_is_no_loss_of_so_many(recorder):
    give, end = recorder
    for sequence in (1, 2, 2 + FARTHEST + 1, 3, 4, 6):
        give("t/cube/accel", accel(sequence))
    manifest, rows = end()
    assert len(rows) == 6 and manifest.keys["t/cube/accel"].lost == 1


@pytest.mark.parametrize("seed", range(4))
def test_anything_on_any_key(recorder, seed):
    give, end = recorder
    for n, (key, payload) in enumerate(hostile_bus.messages(seed, 1500)):
        give(key, payload)
        if n % 10 == 0:
            give("t/table/accel", accel(n // 10 + 1).replace(b"cube", b"cute"))
    manifest, rows = end()
    assert [row.key for row in rows].count("t/table/accel") == 0  # it speaks as another: refused
    assert manifest.refused["table"] == {"device": 150}
    assert len(manifest.refused) <= 258 and {"key", "many"} <= manifest.refused["others"].keys()
    assert not any("failure" in counts for counts in manifest.refused.values())


def test_a_real_bus_full_of_nonsense_and_a_good_board_on_it(client, recording):  # noqa: F811
    settings, _, thread = recording(auto_start=False)
    until(lambda: order(client), "the recorder's answer")
    session = order(client, START).session
    good = client.declare_publisher(
        "t/cube/accel", congestion_control=zenoh.CongestionControl.BLOCK
    )
    sent, foreign = 0, 0
    for key, payload in hostile_bus.messages(99, 3000):
        if "/cube/" in key or "//" in key or " " in key:
            continue
        client.put(key, payload, congestion_control=zenoh.CongestionControl.BLOCK)
        foreign += 1
        if foreign % 10 == 0:
            sent += 1
            good.put(accel(sent))
    until(lambda: order(client).messages >= sent, "the good board's messages")
    status = order(client)
    assert thread.is_alive() and status.recording and sum(status.refused.values()) > foreign // 4
    order(client, STOP)
    manifest = Catalogue(settings.root).manifest(session)
    path = settings.root / session / "recording.mcap"
    rows = [row for row in read(path) if row.key == "t/cube/accel"]
    assert [row.payload for row in rows] == [accel(k + 1) for k in range(sent)]
    assert manifest.certificate["cube"]["complete"]


def test_a_status_stays_short_however_many_keys_have_lost_some():
    counts = {f"t/d{k}/accel": k for k in range(4000)}
    found = largest(counts)
    assert len(found) == 201 and sum(found.values()) == sum(counts.values())
    assert largest({"a": 1, "b": 0}) == {"a": 1}


# --- answers to questions about the past


def item(number: int, **fields) -> pb.HistoryItem:
    sound = dict(topic="accel", run=7, sequence=number, payload=accel(number), utc_ns=T0)
    return pb.HistoryItem(**(sound | fields))


def gap(sequences=(1, 5)):
    """A mender that asks for what is between two messages, its questions and its refusals."""
    asked, refused = [], []
    mender = Mender(asked.append, refuse=lambda key, why, device: refused.append((why, device)))
    address = orders_address()
    for sequence in sequences:
        mender.take(Arrival(address, "cube", "", accel(sequence), T0))
    return mender, asked, refused


def orders_address():
    return next(topic for topic in TOPICS if topic.name == "accel")


def test_an_answer_that_never_ends_is_left():
    mender, asked, refused = gap()
    for n in range(1, 100_000):
        reply = pb.HistoryReply(items=[item(2)], next=n)
        mender.answer(asked.pop(), reply)
        if not asked:
            break
    assert n == MOST_IDLE + 2 and refused[0][0].kind == "answer" and mender.held == 0


@pytest.mark.parametrize(
    "reply",
    [
        pb.HistoryReply(next=5),
        pb.HistoryReply(items=[item(2)], next=5),
        pb.HistoryReply(items=[item(2)], next=4),
    ],
)
def test_an_answer_that_does_not_get_ahead_is_left(reply):
    mender, asked, refused = gap()
    mender.answer(asked.pop(), pb.HistoryReply(items=[item(2)], next=5))
    mender.answer(asked.pop(), reply)
    assert not asked and refused[0][0].field == "next" and mender.counts()["cube/accel"] == (1, 2)


@pytest.mark.parametrize(
    "wrong",
    [
        item(3, payload=accel(3).replace(b"cube", b"cute")),
        item(3, payload=accel(4)),
        item(3, topic="Accel"),
        item(3, topic="rate/<b>"),
        item(3, topic="accel/x"),
        item(3, sequence=2**64 - 1),
        item(3, published_ns=-1),
        item(3, payload=bytes(MESSAGE_BYTES + 1)),
        item(3, payload=header_of(utc_ns=-1)),
    ],
)
def test_what_is_wrong_in_an_answer_is_left_out_and_the_rest_is_taken(wrong):
    mender, asked, refused = gap()
    ready = mender.answer(asked.pop(), pb.HistoryReply(items=[item(2), wrong, item(4)]))
    assert [pb.AccelBatch.FromString(a.payload).header.sequence for a in ready] == [2, 4, 5]
    assert len(refused) == 1 and refused[0][1] == "cube"
    assert mender.counts() == {"cube/accel": (2, 1)}


def test_a_publisher_that_jumps_all_the_time_is_not_remembered_for_ever():
    asked = []
    mender = Mender(asked.append, hold=False)
    for k in range(5000):
        mender.take(Arrival(orders_address(), "cube", "", accel(1 + 2 * k), T0))
    assert len(asked) == 1 and len(mender._streams["cube", "gateway"].waiting) <= 1000
    assert len(mender._keys["cube", "accel"].missing) <= 1000


def test_what_is_held_back_is_bounded_in_bytes(monkeypatch):
    monkeypatch.setattr("messages.history.mending.MAX_HELD_BYTES", 3000)
    mender, _, _ = gap()
    for k in range(6, 100):
        mender.take(Arrival(orders_address(), "cube", "", accel(k), T0))
    stream = mender._streams["cube", "gateway"]
    assert stream.full and sum(len(a.payload) for a in stream.held) == stream.held_bytes < 3500


def test_other_viewers_are_not_given_our_rules():
    for topic in TOPICS:
        data = descriptor_set(topic)
        assert (
            b"descriptor.proto" not in data
            and b"RateBatch" in data
            or topic.type is not pb.RateBatch
        )
        assert mcap_append.RULES.encode() not in data
