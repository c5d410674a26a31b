"""Recordings of other writers, cut anywhere, with wrong bytes: what is read, what is not."""

import io
import random
import struct
import zlib

import pytest
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, IndexType, Writer
from support.table_session import table_recording
from typer.testing import CliRunner

from estimator.pipeline import Pipeline
from estimator.settings import EstimatorSettings
from gyrofree.commands.main import app
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import ACCEL, BY_NAME
from sessions.export.export import FORMATS
from sessions.export.table import survey
from sessions.library.curves_build import build
from sessions.library.scan import scan
from sessions.recording.manifest import SessionError
from sessions.recording.mcap_append import descriptor_set
from sessions.recording.mcap_index import summary_of
from sessions.recording.mcap_log import Damage, _say, read
from sessions.replay.rerun import estimates_again
from sessions.replay.source import Source

KEY = "gyrofree/cube/accel"
FOREIGN = [
    ("/camera/info", "json", "jsonschema", "cam"),
    (KEY, "json", "jsonschema", "cam"),
    (KEY, "protobuf", "protobuf", "other.Message"),
    ("gyrofree/Cube 1/accel", "protobuf", "protobuf", "gyrofree.v1.AccelBatch"),
]
PLAIN = {"use_statistics": False, "use_summary_offsets": False, "index_types": IndexType.NONE}
WRITERS = {
    "unchunked": {"use_chunking": False, "enable_data_crcs": True},
    "unchunked, no checksum": {"use_chunking": False, "enable_crcs": False},
    "no compression": {"compression": CompressionType.NONE},
    "lz4": {"compression": CompressionType.LZ4},
    "zstd": {"compression": CompressionType.ZSTD},
    "no index": PLAIN,
    "no checksum": {"enable_crcs": False},
    "repeats nothing": {"repeat_schemas": False, "repeat_channels": False},
}


def payload(sequence):
    message = pb.AccelBatch(period_s=0.01, axes=3, first_index=sequence, counts=[sequence, 0, 256])
    message.header.CopyFrom(
        pb.Header(device="cube", sequence=sequence, epoch=1, run=1, utc_ns=10**18 + sequence)
    )
    return message.SerializeToString()


def written(n=60, foreign=(), **options):
    """Bytes of a recording of n messages by the library's writer."""
    out = io.BytesIO()
    writer = Writer(out, chunk_size=1024, **options)
    writer.start(library="another")
    schema = writer.register_schema(
        ACCEL.type.DESCRIPTOR.full_name, "protobuf", descriptor_set(ACCEL)
    )
    ours = writer.register_channel(KEY, "protobuf", schema)
    others = [
        writer.register_channel(topic, encoding, writer.register_schema(name, form, b"{}"))
        for topic, encoding, form, name in foreign
    ]
    writer.add_attachment(0, 0, "photo.jpg", "image/jpeg", bytes(200))
    for k in range(n):
        writer.add_message(ours, 10**18 + k, payload(k + 1), 10**18 + k, k)
        for channel in others:
            writer.add_message(channel, 10**18 + k, b"\xff\xff", 10**18 + k, k)
    writer.add_metadata("about", {"by": "hand"})
    writer.finish()
    return out.getvalue()


def all_of(tmp_path, data, name="recording.mcap"):
    path = tmp_path / name
    path.write_bytes(data)
    damage = Damage()
    return [row.payload for row in read(path, damage)], damage, path


@pytest.mark.parametrize("options", WRITERS.values(), ids=WRITERS.keys())
def test_files_of_other_writers_are_read_by_every_way(tmp_path, options):
    rows, damage, path = all_of(tmp_path, written(foreign=FOREIGN, **options))
    wanted = [payload(k + 1) for k in range(60)]
    assert rows == wanted and damage.whole and sum(damage.foreign.values()) == 240
    assert [p for block in scan(path, (ACCEL,)) for p in block.payloads] == wanted
    needed = ("use_chunking", "use_statistics", "repeat_channels")
    indexed = all(options.get(name, True) for name in needed)
    assert (summary_of(path) is not None) == indexed
    source = Source(path, tuple(BY_NAME.values()))
    assert [i.message.first_index for i in source.items()] == list(range(1, 61))
    assert [i.message.first_index for i in source.items(10**18 + 50)] == list(range(51, 61))
    assert survey(path).counts == {KEY: 60}
    for text in ("/camera/info", "Cube 1", "other.Message", "240 messages"):
        assert text in damage.others
    covered = "no checksum" not in [k for k, v in WRITERS.items() if v is options][0]
    assert (damage.unchecked == 0) == covered, damage


def test_what_is_no_recording_is_named(tmp_path):
    for data, words in (
        (b"", "empty"),
        (b"\x89MCAP", "does not begin"),
        (b"t_s,a\n1,2\n" * 9, "does not begin"),
        (b"\x89MCAP0\r\n", "ends at byte 8"),
        (b"\x89MCAP0\r\n" + bytes(100), "cut off"),
        (written() + b"xx", "2 bytes behind its end"),
        (written() + written(), "bytes behind its end"),
        (b"\x89MCAP9\r\n" + written()[8:], "does not begin"),
    ):
        _, damage, _ = all_of(tmp_path, data)
        assert words in str(damage) and not damage.whole, (data[:20], damage)


def test_a_recording_without_messages_is_not_estimated_again(tmp_path):
    path = tmp_path / "recording.mcap"
    for data, words in ((b"", "it is empty"), (b"\x89MCAP0\r\n", "ends at byte 8")):
        path.write_bytes(data)
        with pytest.raises(SessionError, match=words):
            list(estimates_again(path, Pipeline(EstimatorSettings())))


def record_at(data, kind):
    """Byte at which the first record of this kind begins."""
    at = 8
    while data[at] != kind:
        at += 9 + struct.unpack_from("<Q", data, at + 1)[0]
    return at


def test_chunks_that_lie_are_left_out_and_counted(tmp_path):
    data = bytearray(written(compression=CompressionType.NONE))
    at = record_at(data, 6)
    size_at, crc_at, name_at = at + 9 + 16, at + 9 + 24, at + 9 + 28
    for place, value in (
        (crc_at, struct.pack("<I", zlib.crc32(b"other"))),
        (size_at, struct.pack("<Q", 1 << 50)),
        (size_at, struct.pack("<Q", 3)),
        (name_at, struct.pack("<I", 1 << 31)),
    ):
        wrong = bytearray(data)
        wrong[place : place + len(value)] = value
        rows, damage, path = all_of(tmp_path, wrong)
        assert damage.chunks == 1 and 0 < len(rows) < 60 and not damage.index
        assert damage.missing + damage.messages == 60
        again = Damage()
        kept = [p for block in scan(path, (ACCEL,), damage=again) for p in block.payloads]
        assert kept == rows and again.chunks == 1


def test_a_small_chunk_that_becomes_huge_is_not_unpacked(tmp_path):
    import zstandard

    bomb = zstandard.compress(bytes(300 * 1024**2))
    head = struct.pack("<QQQI", 0, 0, 1 << 20, 0) + struct.pack("<I", 4) + b"zstd"
    chunk = head + struct.pack("<Q", len(bomb)) + bomb
    whole = written()
    at = record_at(whole, 6)
    data = whole[:at] + struct.pack("<BQ", 6, len(chunk)) + chunk + whole[at:]
    rows, damage, _ = all_of(tmp_path, data)
    assert damage.chunks == 1 and len(rows) == 60


def test_a_message_beyond_the_limit_costs_itself_alone(tmp_path):
    data = written(use_chunking=False)
    at = record_at(data, 5)
    huge = struct.pack("<BQHIQQ", 5, 22 + (70 << 20), 1, 0, 10**18, 10**18) + bytes(70 << 20)
    rows, damage, _ = all_of(tmp_path, data[:at] + huge + data[at:])
    assert len(rows) == 60 and damage.oversized == 1 and not damage.whole


@pytest.mark.parametrize("options", WRITERS.values(), ids=WRITERS.keys())
def test_cut_anywhere_the_rest_is_read_and_the_cut_said(tmp_path, options):
    data = written(**options)
    wanted = [payload(k + 1) for k in range(60)]
    for cut in range(0, len(data), 61):
        rows, damage, _ = all_of(tmp_path, data[:cut])
        assert rows == wanted[: len(rows)] and not damage.whole, cut


@pytest.mark.parametrize(
    "options", [v for k, v in WRITERS.items() if "no checksum" not in k and k != "no index"]
)
def test_a_wrong_byte_anywhere_is_said_or_changes_nothing(tmp_path, options):
    data = written(**options)
    wanted = [payload(k + 1) for k in range(60)]
    rng = random.Random(7)
    for _ in range(150):
        wrong = bytearray(data)
        place = rng.randrange(8, len(data))
        wrong[place] ^= 1 << rng.randrange(8)
        rows, damage, path = all_of(tmp_path, wrong)
        assert rows == wanted or not damage.whole, place
        assert "use_chunking" in options or set(rows) <= set(wanted), place
        again = Damage()
        kept = [p for block in scan(path, (ACCEL,), damage=again) for p in block.payloads]
        assert kept == wanted or not again.whole, place


@pytest.fixture(scope="module")
def spoilt(tmp_path_factory):
    """A real recording with a wrong byte in its middle chunk, and one cut off in its middle."""
    folder, data = tmp_path_factory.mktemp("spoilt"), bytearray(table_recording().read_bytes())
    with table_recording().open("rb") as stream:
        chunks = make_reader(stream).get_summary().chunk_indexes
    middle = chunks[len(chunks) // 2]
    data[middle.chunk_start_offset + middle.chunk_length // 2] ^= 4
    (folder / "flipped.mcap").write_bytes(data)
    (folder / "cut.mcap").write_bytes(data[: middle.chunk_start_offset + 50])
    return folder


@pytest.mark.parametrize("name", ["flipped", "cut"])
def test_every_command_says_the_damage(spoilt, tmp_path, name, caplog):
    path = str(spoilt / f"{name}.mcap")
    config = tmp_path / "gyrofree.toml"
    config.write_text(f'[recorder]\nroot = "{tmp_path}/sessions"\n')
    words = "1 damaged chunks" if name == "flipped" else "damaged from byte"
    commands = [["export", path, "--format", form, "--out", str(tmp_path)] for form in FORMATS]
    commands += [
        ["report", path, "--json"],
        ["rerun", path, "--estimators", "least-squares", "--name", "again"],
        ["sessions", "compare", path, str(table_recording())],
        ["replay", path, "--check"],
    ]
    for arguments in commands:
        _say.cache_clear()
        caplog.clear()
        result = CliRunner().invoke(app, [*arguments, "--config", str(config)])
        assert result.exception is None or isinstance(result.exception, SystemExit), arguments
        assert words in result.output + caplog.text, (arguments, result.output, caplog.text)


def test_a_damaged_recording_is_never_complete(spoilt):
    from sessions.report.build import build as report
    from sessions.report.verdict import load_spec

    made = report(spoilt / "flipped.mcap", load_spec(None))
    assert made.verdict != "pass" and "1 damaged chunks" in made.html
    assert "1 damaged chunks" in build(spoilt / "flipped.mcap").said[0]


def test_the_stream_reader_of_the_library_agrees(tmp_path):
    with table_recording().open("rb") as stream:
        wanted = [r.data for r in StreamReader(stream).records if type(r).__name__ == "Message"]
    damage = Damage()
    assert [row.payload for row in read(table_recording(), damage)] == wanted and damage.whole
