"""A session's file: readable by anybody, whole after a cut, honest about the disk."""

import hashlib
import io
import json
import os
import random
import shutil
import subprocess
import sys
import threading
import time

import pytest
from google.protobuf import descriptor_pool, message_factory
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType, Writer

from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import ACCEL, LOCATION, STATUS
from sessions.library.catalogue import Catalogue
from sessions.recording import store as store_module
from sessions.recording.manifest import RECORDING, SessionError, read_manifest
from sessions.recording.mcap_append import McapLog, Sink
from sessions.recording.mcap_log import Damage, read
from sessions.recording.mcap_writer import LIBRARY, McapWriter
from sessions.recording.recover import recover_all, recover_session, salvage
from sessions.recording.settings import RecorderSettings
from sessions.recording.store import AnotherDisk

KEY = ACCEL.key("p", "cube")
T0 = 1_700_000_000_000_000_000


def accel(sequence: int, run: int = 7) -> bytes:
    header = pb.Header(device="cube", sequence=sequence, utc_ns=T0 + sequence * 10_000_000, run=run)
    header.source = pb.SOURCE_SIMULATED
    counts = [(sequence * 37 + k * 11) % 512 - 256 for k in range(12)]
    return pb.AccelBatch(
        header=header, axes=12, counts=counts, f_mps2=[c * 0.0383 for c in counts]
    ).SerializeToString()


def record(settings: RecorderSettings, sequences, close: bool = True):
    store = store_module.start(settings, note="table test", configuration={"bus": {"prefix": "p"}})
    for sequence in sequences:
        store.add(T0 + sequence * 10_000_000 + 500, KEY, accel(sequence))
        if sequence % 40 == 0:
            store.flush()
    if close:
        assert store.close()
    return store


@pytest.fixture
def settings(tmp_path):
    return RecorderSettings(root=tmp_path / "root", chunk_bytes=8192)


def test_any_mcap_reader_opens_a_recording_with_nothing_but_the_file(settings):
    store = record(settings, range(1, 301))
    with (store.folder / "recording.mcap").open("rb") as stream:
        rows = list(make_reader(stream, validate_crcs=True).iter_messages())
    assert len(rows) == 300
    schema, channel, message = rows[9]
    assert (schema.encoding, channel.message_encoding, channel.topic) == (
        "protobuf",
        "protobuf",
        KEY,
    )
    assert message.log_time == T0 + 100_000_500 and message.publish_time == T0 + 100_000_000
    assert message.data == accel(10)
    pool = descriptor_pool.DescriptorPool()  # not ours: only what the file says
    for file in FileDescriptorSet.FromString(schema.data).file:
        pool.Add(file)
    decoded = message_factory.GetMessageClass(pool.FindMessageTypeByName(schema.name)).FromString(
        message.data
    )
    assert decoded.header.device == "cube" and decoded.header.sequence == 10


def test_foxglove_types_bring_their_imports_and_their_time(settings):
    fix = LOCATION.type(latitude=48.0, longitude=9.0)
    fix.timestamp.FromNanoseconds(T0 + 5)
    store = store_module.start(settings)
    store.add(T0 + 9, LOCATION.key("p", "car"), fix.SerializeToString())
    assert store.close()
    with (store.folder / "recording.mcap").open("rb") as stream:
        ((schema, _, message),) = make_reader(stream).iter_messages()
    assert message.publish_time == T0 + 5
    assert "google/protobuf/timestamp.proto" in [
        f.name for f in FileDescriptorSet.FromString(schema.data).file
    ]


def test_session_json_counts_jumps_restarts_and_hashes_the_file(settings):
    store = record(settings, [1, 2, 3, 7, 8], close=False)
    store.add(T0 + 10**9, KEY, accel(1, run=8))
    store.add(T0 + 10**9 + 1, KEY, accel(1, run=8))
    store.add(T0 + 10**9 + 2, KEY, b"\xff\xfe no message")
    store.add(T0 + 10**9 + 3, "p/cube/nonsense", b"?")
    store.add(T0 + 10**9 + 4, STATUS.key("p", "recorder"), b"")
    assert store.close()
    written = json.loads((store.folder / "session.json").read_text())
    assert (
        written["state"] == "closed"
        and written["devices"] == ["cube"]
        and written["sources"] == ["SIMULATED"]
    )
    counts = {
        "messages": 8,
        "lost": 3,
        "restarts": 1,
        "repeated": 1,
        "unreadable": 1,
        "repaired": 0,
    }
    assert list(written["keys"]) == [KEY] and counts.items() <= written["keys"][KEY].items()
    topic = written["certificate"]["cube"]["topics"]["accel"]
    assert topic == {"expected": 10, "received": 7, "repaired": 0, "lost": 3, "damaged": 1}
    assert written["certificate"]["cube"]["complete"] is False
    assert written["unknown"] == 1 and written["configuration"] == {"bus": {"prefix": "p"}}
    assert (
        written["sha256"]
        == hashlib.sha256((store.folder / "recording.mcap").read_bytes()).hexdigest()
    )
    assert [m.payload for m in read(store.folder / "recording.mcap")][-1] == b"\xff\xfe no message"


def test_the_index_of_a_long_recording_waits_on_the_disk_and_the_file_is_the_same(
    tmp_path, monkeypatch
):
    files = []
    for name, held in (("memory", 1 << 30), ("disk", 500)):
        monkeypatch.setattr("sessions.recording.spill.HELD_BYTES", held)
        fd = os.open(tmp_path / name, os.O_RDWR | os.O_CREAT)
        log = McapLog(fd, 4096, tmp_path)
        channel = log.open_channel(KEY, ACCEL)
        for k in range(200):
            log.add(channel, k, k, bytes([k]) * 100)
            if k % 5 == 4:
                log.close_chunk()
        assert log.spilt == (name == "disk")
        log.finish()
        log.push()
        os.close(fd)
        files.append((tmp_path / name).read_bytes())
    assert files[0] == files[1]
    with (tmp_path / "disk").open("rb") as stream:
        reader = make_reader(stream)
        assert len(reader.get_summary().chunk_indexes) >= 40
        assert [m.log_time for _, _, m in reader.iter_messages(start_time=50, end_time=60)] == list(
            range(50, 60)
        )
    assert sorted(p.name for p in tmp_path.iterdir()) == ["disk", "memory"]


def test_what_is_written_is_what_the_library_writes(tmp_path):
    """Byte for byte, with several channels, messages out of order and chunks of all sizes."""
    kinds = IndexType.CHUNK | IndexType.MESSAGE
    ours, theirs = io.BytesIO(), io.BytesIO()
    mine = McapWriter(ours, 2000)
    other = Writer(theirs, 2000, CompressionType.ZSTD, index_types=kinds)
    mine.start("p")
    other.start("p", LIBRARY)
    rng = random.Random(7)
    for k in range(500):
        if k in (0, 1, 100):
            a = mine.schema(f"s{k}", "protobuf", bytes([k]) * 50)
            assert a == other.register_schema(f"s{k}", "protobuf", bytes([k]) * 50)
            assert mine.channel(f"t{k}", "protobuf", a) == a
            assert other.register_channel(f"t{k}", "protobuf", a) == a
        channel, log_ns = rng.randint(1, a), 10**9 + rng.randrange(10**6)
        payload = rng.randbytes(rng.choice((0, 10, 3000)))
        mine.message(channel, log_ns, log_ns - 5, payload, k)
        other.add_message(channel, log_ns, payload, log_ns - 5, k)
        if k % 37 == 36:
            mine.end_chunk()
            other.flush()
    mine.finish()
    other.finish()
    assert ours.getvalue() == theirs.getvalue()


def test_a_file_without_a_message_is_one_the_library_reads(tmp_path):
    out = io.BytesIO()
    writer = McapWriter(out, 2000)
    writer.start("p")
    writer.channel("t", "protobuf", writer.schema("s", "protobuf", b""))
    writer.finish()
    summary = make_reader(io.BytesIO(out.getvalue())).get_summary()
    assert summary.statistics.message_count == 0 and summary.channels[1].topic == "t"


def test_chunks_stay_below_the_limit_and_reach_the_file_at_each_flush(settings):
    store = record(settings, range(1, 201), close=False)
    store.flush()
    damage = Damage()
    assert len(list(read(store.folder / "recording.mcap", damage))) == 200
    assert "without a close" in damage.tail
    assert damage.said() == ["still being recorded: the 200 messages so far were read"]
    assert store.close()
    with (store.folder / "recording.mcap").open("rb") as stream:
        chunks = make_reader(stream).get_summary().chunk_indexes
    assert len(chunks) > 5
    assert (
        max(chunk.uncompressed_size for chunk in chunks[1:]) < 8192 + 1024
    )  # the first one has the schema


def test_truncated_anywhere_a_file_is_recovered_to_its_last_complete_chunk(settings, tmp_path):
    store = record(settings, range(1, 401))
    whole = (store.folder / "recording.mcap").read_bytes()
    with (store.folder / "recording.mcap").open("rb") as stream:
        chunks = make_reader(stream).get_summary().chunk_indexes
    ends = sorted((c.chunk_start_offset + c.chunk_length, c.message_end_time) for c in chunks)
    rng = random.Random(5)
    for cut in [0, 1, 8, len(whole) - 1] + [rng.randrange(len(whole)) for _ in range(100)]:
        torn = tmp_path / "torn.mcap"
        torn.write_bytes(whole[:cut])
        found = salvage(torn, tmp_path / "new.mcap")
        reachable = [last for end, last in ends if end <= cut]
        assert found.end_utc_ns == (reachable[-1] if reachable else 0), (
            f"cut at {cut} of {len(whole)}"
        )
        assert torn.read_bytes() == whole[:cut]
        with (tmp_path / "new.mcap").open("rb") as stream:
            assert (
                len(list(make_reader(stream, validate_crcs=True).iter_messages())) == found.messages
            )


def test_a_flipped_bit_costs_one_chunk_even_when_it_is_the_first(settings, tmp_path):
    store = record(settings, range(1, 401))
    whole = bytearray((store.folder / "recording.mcap").read_bytes())
    with (store.folder / "recording.mcap").open("rb") as stream:
        first = min(
            make_reader(stream).get_summary().chunk_indexes,
            key=lambda chunk: chunk.chunk_start_offset,
        )
    whole[first.chunk_start_offset + first.chunk_length - 30] ^= 0x10
    torn = tmp_path / "flipped.mcap"
    torn.write_bytes(whole)
    damage = Damage()
    kept = list(read(torn, damage, store.manifest.channels))
    assert damage.chunks == 1 and 300 < len(kept) < 400 and kept[-1].payload == accel(400)


def test_recovery_makes_a_new_file_and_leaves_the_original(settings):
    store = record(settings, range(1, 101), close=False)
    store.flush()
    assert recover_session(store.folder) is None, "this process still records it"
    store._stop.set()
    store._thread.join()
    os.close(store._fd)  # what the kernel does for a killed process
    original = (store.folder / "recording.mcap").read_bytes()
    (manifest,) = recover_all(settings.root)
    assert (
        manifest.state == "recovered"
        and manifest.messages == 100
        and "was not closed" in manifest.recovery
    )
    assert (store.folder / "recording.mcap").read_bytes() == original
    info = Catalogue(settings.root).get(store.folder.name)
    assert info.state == "recovered" and info.path.name == "recovered.mcap" and info.messages == 100
    assert manifest.sha256 == hashlib.sha256(info.path.read_bytes()).hexdigest()
    assert recover_all(settings.root) == []
    with pytest.raises(SessionError, match="is recovered"):
        recover_session(store.folder)


def test_a_full_disk_keeps_data_in_memory_until_there_is_room(tmp_path):
    """A real full file system would need a mount; a file size limit makes the kernel refuse writes
    in the same way.
    """
    script = (
        "import resource, signal, sys\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        "from pathlib import Path\n"
        "from tests.sessions.test_store import *\n"
        "from sessions.recording.settings import RecorderSettings\n"
        "hard = resource.getrlimit(resource.RLIMIT_FSIZE)[1]\n"
        "settings = RecorderSettings(root=Path(sys.argv[1]), chunk_bytes=8192)\n"
        "store = record(settings, range(1, 201), close=False)\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (10000, hard))\n"
        "for n in range(201, 601):\n"
        "    store.add(T0 + n, KEY, accel(n))\n"
        "store.flush()\n"
        "assert 'File too large' in store.error and 'make room' in store.error, store.error\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (hard, hard))\n"
        "store.flush()\n"
        "assert store.error == '' and store.close()\n"
    )
    subprocess.run([sys.executable, "-c", script, str(tmp_path / "r")], check=True, timeout=60)
    (info,) = Catalogue(tmp_path / "r").list()
    assert (info.state, info.messages, info.lost) == ("closed", 600, 0)
    assert [m.payload for m in read(info.path)] == [accel(n) for n in range(1, 601)]


def test_beyond_the_memory_given_messages_are_refused_and_counted(tmp_path):
    settings = RecorderSettings(root=tmp_path, max_pending_bytes=1024**2)
    store = store_module.start(settings)
    real, store._log._sink._fd = store._log._sink._fd, os.open("/dev/full", os.O_WRONLY)
    noise = random.Random(1)
    sent = 0
    while not store.manifest.overflow:
        sent += 1
        store.add(T0 + sent, KEY, accel(sent) + noise.randbytes(60_000))
        store.flush()
    assert "No space left on device" in store.error
    os.close(store._log._sink._fd)
    store._log._sink._fd = real
    store.flush()
    assert store.close() and store.messages == sent - 1
    assert Catalogue(tmp_path).list()[0].lost == 1


def test_short_writes_are_continued():
    reader, writer = os.pipe()
    sink = Sink(writer)
    sink.write(b"x" * 300_000)
    got = bytearray()

    def drain():
        while len(got) < 300_000:
            got.extend(os.read(reader, 4096))

    thread = threading.Thread(target=drain)
    thread.start()
    sink.push()
    thread.join(30)
    os.close(reader), os.close(writer)
    assert len(got) == 300_000 and sink.tell() == 300_000


def test_a_root_that_cannot_be_written_leaves_nothing_behind(tmp_path):
    (tmp_path / "file").write_text("no folder")
    with pytest.raises(OSError):
        store_module.start(RecorderSettings(root=tmp_path / "file"))


def test_catalogue_lists_newest_first_and_what_is_unreadable_with_the_reason(settings):
    a = record(settings, range(1, 11))
    time.sleep(0)
    b = record(settings, range(1, 21))
    assert a.folder.name != b.folder.name
    broken = settings.root / "20200101-000000-broken"
    broken.mkdir()
    (broken / "session.json").write_text("{ half")
    (settings.root / "20200101-000001").mkdir()
    (settings.root / "notes").mkdir()
    listed = Catalogue(settings.root).list()
    assert [info.state for info in listed] == ["closed", "closed", "unreadable", "unreadable"]
    assert {info.messages for info in listed[:2]} == {10, 20}
    assert "No such file" in listed[2].problem and "JSON" in listed[3].problem
    assert Catalogue(settings.root / "none").list() == []


@pytest.mark.parametrize(
    "name", ["..", "../../etc", "20200101-000000/../x", "", "20200101-000000-" + "x" * 99, "a\0b"]
)
def test_catalogue_refuses_names_that_are_no_ids(settings, name):
    for ask in (
        Catalogue(settings.root).get,
        Catalogue(settings.root).path,
        Catalogue(settings.root).manifest,
    ):
        with pytest.raises(SessionError, match="want an id"):
            ask(name)


def test_a_changed_file_is_named(settings):
    store = record(settings, range(1, 11))
    with (store.folder / "recording.mcap").open("ab") as stream:
        stream.write(b"x")
    assert "changed or cut since" in Catalogue(settings.root).get(store.folder.name).problem


def test_a_manifest_in_a_foreign_folder_is_refused(settings):
    store = record(settings, range(1, 11))
    moved = store.folder.rename(settings.root / "20200101-000000")
    with pytest.raises(SessionError, match="stands in the folder"):
        read_manifest(moved)


def test_the_log_repeats_schemas_per_type_not_per_key(tmp_path):
    fd = os.open(tmp_path / "x.mcap", os.O_WRONLY | os.O_CREAT)
    out = McapLog(fd, 8192)
    channels = {out.open_channel(ACCEL.key("p", name), ACCEL) for name in ("a1", "b1", "a1")}
    assert len(channels) == 2 and len(out._schemas) == 1
    os.close(fd)


def test_a_recording_that_was_deleted_is_said_and_not_called_closed(settings):
    store = record(settings, range(1, 50), close=False)
    store.flush()
    assert store.astray == ""
    # moved first: its thread may write there while it is taken apart
    shutil.rmtree(store.folder.rename(store.folder.with_name("away")))
    store.add(T0 + 10**9, KEY, accel(50))
    store.flush()
    assert "was deleted or moved" in store.astray
    assert not store.close()


def test_who_writes_on_a_dead_disk_begins_anew_once_another_stands_there(settings):
    store = record(settings, range(1, 50), close=False)
    full = os.open("/dev/full", os.O_WRONLY)  # takes nothing, as a file system that failed
    os.dup2(full, store._fd)
    os.close(full)
    path = store.folder / RECORDING
    away = path.rename(path.with_name("away"))  # not mounted again yet: it is waited for
    store.flush()
    assert "wait in memory" in store.error
    away.rename(path)
    with pytest.raises(AnotherDisk, match="mounted anew"):
        store.flush()
    assert not store.close()
