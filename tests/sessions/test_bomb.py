"""Recordings that are small on the disk and large once decompressed, or not what they declare."""

import io
import struct
import tracemalloc
import zlib

import lz4.frame
import pytest
import zstandard
from mcap.records import Chunk
from mcap.writer import CompressionType, Writer

from messages.contract.topics import GNSS
from sessions.library.scan import scan
from sessions.recording import mcap_chunk, mcap_records
from sessions.recording.mcap_log import Damage, read
from sessions.replay.source import Source

MIB = 1024**2


def zstd(data: bytes) -> bytes:
    return zstandard.ZstdCompressor(level=3).compress(data)


def zstd_unsized(data: bytes) -> bytes:
    """A frame that does not say how long it is."""
    coder = zstandard.ZstdCompressor(level=3).compressobj()
    return coder.compress(data) + coder.flush()


PACKERS = {"zstd": zstd, "lz4": lz4.frame.compress, "zstd without a size": zstd_unsized}


def chunk(packed: bytes, kind: str, declared: int, crc: int = 0) -> Chunk:
    return Chunk(kind.split()[0], packed, 1, 0, crc, declared)


@pytest.mark.parametrize("kind", PACKERS)
def test_a_chunk_is_never_larger_than_it_says(kind):
    packed = PACKERS[kind](bytes(256 * MIB))
    tracemalloc.start()
    for declared in (10, 900_000, 256 * MIB, 2**63):
        with pytest.raises(mcap_chunk.ChunkError):
            mcap_chunk.content(chunk(packed, kind, declared))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 8 * MIB


@pytest.mark.parametrize("kind", PACKERS)
def test_an_honest_chunk_is_read(kind):
    data = bytes(range(256)) * 4000
    packed = PACKERS[kind](data)
    assert mcap_chunk.content(chunk(packed, kind, len(data), zlib.crc32(data))) == data
    with pytest.raises(mcap_chunk.ChunkError, match="CRC"):
        mcap_chunk.content(chunk(packed, kind, len(data), zlib.crc32(data) ^ 1))
    with pytest.raises(mcap_chunk.ChunkError):
        mcap_chunk.content(chunk(packed[: len(packed) // 2], kind, len(data)))
    with pytest.raises(mcap_chunk.ChunkError, match="another number"):
        mcap_chunk.content(chunk(packed, kind, len(data) + 1))


def test_a_million_empty_records_are_read_one_by_one():
    one = struct.pack("<BQHIQQ", 5, 22, 1, 0, 0, 0)
    data = one * 400_000
    tracemalloc.start()
    assert sum(1 for _ in mcap_records.records(data)) == 400_000
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 3 * len(data)


def bombed(path, declared: int | None) -> None:
    """A recording with one good message in each of two chunks and a bomb between them."""
    out = io.BytesIO()
    writer = Writer(out, chunk_size=1, compression=CompressionType.ZSTD)
    writer.start("gyrofree")
    schema = writer.register_schema(GNSS.type.DESCRIPTOR.full_name, "protobuf", b"")
    channel = writer.register_channel("gyrofree/cube/gnss", "protobuf", schema)
    writer.add_message(channel, 1_000, b"\x0a\x02\x08\x01", 1_000)
    packed = zstd(bytes(700 * MIB))
    size = 700 * MIB if declared is None else declared
    body = struct.pack("<QQQII", 2_000, 2_000, size, 0, 4) + b"zstd"
    body += struct.pack("<Q", len(packed)) + packed
    at = out.tell()
    out.write(struct.pack("<BQ", 6, len(body)) + body)
    writer.add_message(channel, 3_000, b"\x0a\x02\x08\x01", 3_000)
    writer.finish()
    assert at and len(packed) < 100_000
    path.write_bytes(out.getvalue())


@pytest.mark.parametrize("declared", [None, 100_000, 2**62])
def test_a_bomb_in_a_recording_is_counted_and_the_rest_is_read(tmp_path, declared):
    path = tmp_path / "recording.mcap"
    bombed(path, declared)
    tracemalloc.start()
    damage = Damage()
    assert [row.log_ns for row in read(path, damage)] == [1_000, 3_000]
    assert damage.chunks == 1
    list(scan(path, (GNSS,)))
    list(Source(path, (GNSS,)).items())
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 16 * MIB
