"""What a chunk of an MCAP file holds, within bounds: a file from outside may say it is small and be
4 GB.

A chunk is decompressed up to the size that it declares and not one byte further, and is left out
when it declares more than LARGEST, or shrank to less than a thousandth (recordings shrink to a
quarter, simulated silence to a fiftieth).
"""

import io
import zlib

import lz4.frame
import zstandard
from mcap.records import Chunk

LARGEST = 64 * 1024**2  # bytes of a chunk once decompressed; ours have 128 KiB
SMALL = 1024**2  # bytes that a chunk may have however little it shrank to
SHRINKS = 1000  # times; more is a bomb


class ChunkError(ValueError):
    """A chunk that is damaged, or not what it declares."""


def content(chunk: Chunk) -> bytes:
    """A chunk decompressed and checked; raises ChunkError."""
    size = chunk.uncompressed_size
    if size > LARGEST or size > SMALL + SHRINKS * len(chunk.data):
        raise ChunkError(
            f"a chunk of {len(chunk.data)} bytes says that it holds {size}: want at most"
            f" {LARGEST >> 20} MiB and not more than {SHRINKS} times its size"
        )
    try:
        data = _decompressed(chunk, size)
    except (zstandard.ZstdError, RuntimeError, EOFError, MemoryError) as error:
        raise ChunkError(f"a chunk cannot be decompressed: {error}") from None
    if len(data) != size:
        raise ChunkError(f"a chunk says {size} bytes and holds another number")
    if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
        raise ChunkError("a chunk has a wrong CRC")
    return data


def _decompressed(chunk: Chunk, size: int) -> bytes:
    """At most size + 1 bytes, whatever the data say of themselves."""
    if chunk.compression == "zstd":
        with zstandard.ZstdDecompressor(max_window_size=LARGEST * 2).stream_reader(
            io.BytesIO(chunk.data)
        ) as stream:
            return stream.read(size + 1)
    if chunk.compression == "lz4":
        data = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=size + 1)
        return bytes(data)
    if chunk.compression:
        raise ChunkError(f"a chunk is compressed by {chunk.compression[:20]!r}: want zstd or lz4")
    return chunk.data
