"""Messages of a few topics out of a long recording, fast: by the file's own index, chunk by chunk.

mcap.reader makes an object of every message; here only those of the wanted channels are touched,
found by the MessageIndex records behind each chunk (https://mcap.dev/spec#message-index-op0x07). A
file without an index, or with one that cannot be read, is read from front to end instead.
"""

import functools
import io
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.reader import SeekingReader
from mcap.records import Chunk, ChunkIndex
from mcap.summary import Summary

from messages.contract.topics import Topic, TopicError, parse
from sessions.recording import mcap_chunk
from sessions.recording.mcap_log import RECORD_LIMIT, Damage, read

RECORD = struct.Struct("<BQ")  # opcode, length
MESSAGE_HEAD = 22  # bytes before a message's payload: channel, sequence, log and publish time
INDEX_HEAD = struct.Struct(
    "<BQHI"
)  # of a MessageIndex record: opcode, length, channel, bytes of its entries
ENTRY = np.dtype([("log_ns", "<u8"), ("offset", "<u8")])
LENGTH = struct.Struct("<Q")

Progress = Callable[[float], None]


@dataclass(frozen=True)
class Extent:
    """What a recording holds, without reading it."""

    first_ns: int  # receive time of the first message, ns since 1970
    last_ns: int
    counts: dict[str, int]  # bus key -> messages; empty when the file has no index
    chunks: int  # pieces that can be read on their own; 0 without an index

    @property
    def seconds(self) -> float:
        """First to last message, s."""
        return (self.last_ns - self.first_ns) / 1e9


def summary_of(path: Path) -> Summary | None:
    """The file's own index; None where it has none that can be read. Raises OSError."""
    found = path.stat()
    return _summary(path, found.st_size, found.st_mtime_ns)


@functools.lru_cache(maxsize=2)  # that of an hour takes longer to read than a first look at it
def _summary(path: Path, size: int, mtime_ns: int) -> Summary | None:
    with path.open("rb") as stream:
        try:
            found = SeekingReader(stream, record_size_limit=RECORD_LIMIT).get_summary()
        except (McapError, ValueError, EOFError, struct.error):
            return None
    whole = (
        found is not None
        and found.statistics is not None
        and found.statistics.message_count
        and found.chunk_indexes
    )
    return found if whole else None


def extent(path: Path) -> Extent:
    """Times and counts of a recording. Raises OSError, and ValueError for a file without any
    message.
    """
    found = summary_of(path)
    if found is not None:
        counts = found.statistics.channel_message_counts
        names = {channel.topic: counts.get(number, 0) for number, channel in found.channels.items()}
        return Extent(
            found.statistics.message_start_time,
            found.statistics.message_end_time,
            names,
            len(found.chunk_indexes),
        )
    damage = Damage()
    first = last = 0
    for row in read(path, damage):
        first = min(first or row.log_ns, row.log_ns)
        last = max(last, row.log_ns)
    if not first:
        raise ValueError(f"{path}: no message in it, {damage}: want an MCAP recording")
    return Extent(first, last, {}, 0)


@dataclass(frozen=True)
class Block:
    """Consecutive messages of one key, in the order of the file."""

    key: str
    log_ns: list[int]  # receive times, ns since 1970
    payloads: list[bytes]


def scan(
    path: Path, topics: tuple[Topic, ...], stride: int = 1, on_progress: Progress = lambda _: None
) -> Iterator[Block]:
    """The messages of these topics, block by block as the file has them; of one chunk in `stride`
    only.

    A damaged chunk is left out. `stride` is for a first look; a file without an index is read
    whole. Raises OSError.
    """
    found = summary_of(path)
    if found is None:
        for row in read(path):
            if _wanted(row.key, topics):
                yield Block(row.key, [row.log_ns], [row.payload])
        return
    keys = {
        number: channel.topic
        for number, channel in found.channels.items()
        if _wanted(channel.topic, topics)
    }
    chunks = sorted(found.chunk_indexes, key=lambda chunk: chunk.chunk_start_offset)[::stride]
    with path.open("rb") as stream:
        for count, chunk in enumerate(chunks):
            if any(number in keys for number in chunk.message_index_offsets):
                yield from _blocks(stream, chunk, keys)
            if count % 50 == 0:
                on_progress(count / len(chunks))
    on_progress(1.0)


def _wanted(key: str, topics: tuple[Topic, ...]) -> bool:
    try:
        return parse(key).topic in topics
    except TopicError:
        return False


def _blocks(stream: IO[bytes], chunk: ChunkIndex, keys: dict[int, str]) -> Iterator[Block]:
    """The wanted messages of one chunk, key by key; none of a chunk that cannot be read."""
    stream.seek(chunk.chunk_start_offset)
    if max(chunk.chunk_length, chunk.message_index_length) > RECORD_LIMIT:
        return
    try:
        data = _inside(stream.read(chunk.chunk_length))
    except Exception:  # damaged lengths make the library raise almost anything, see mcap_log
        return
    index = stream.read(chunk.message_index_length)
    position = 0
    while position + INDEX_HEAD.size <= len(index):
        _, length, channel, size = INDEX_HEAD.unpack_from(index, position)
        if channel in keys:
            entries = np.frombuffer(
                index, ENTRY, size // ENTRY.itemsize, position + INDEX_HEAD.size
            )
            yield Block(
                keys[channel],
                entries["log_ns"].tolist(),
                _payloads(data, entries["offset"].tolist()),
            )
        position += RECORD.size + length


def _payloads(data: bytes, offsets: list[int]) -> list[bytes]:
    length_at = LENGTH.unpack_from
    begin = RECORD.size + MESSAGE_HEAD
    return [data[o + begin : o + RECORD.size + length_at(data, o + 1)[0]] for o in offsets]


def _inside(record: bytes) -> bytes:
    """A chunk's records, decompressed and checked by their CRC."""
    chunk = Chunk.read(ReadDataStream(io.BytesIO(record[RECORD.size :])))
    return mcap_chunk.content(chunk)
