"""Writes MCAP with chunks and indices (https://mcap.dev/spec).

Our own, because the writer of the mcap library keeps the index of every chunk as an object until
the file is closed, and offers no way to keep it elsewhere (spill.py). Records are the library's,
but for messages and their index: those are packed here, once each, for they come thousands a
second. What is written is what the library writes, byte for byte.
"""

import struct
import zlib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Protocol

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Schema,
    Statistics,
    SummaryOffset,
)

from sessions.recording.spill import Spill

MAGIC = b"\x89MCAP0\r\n"
LIBRARY = "gyrofree"
COMPRESSION = "zstd"
_RECORD = struct.Struct("<BQ")  # opcode, length of what follows
_MESSAGE = struct.Struct("<BQHIQQ")  # ... channel, sequence, log time, publish time; then the data
_INDEX = struct.Struct("<BQHI")  # ... channel, bytes of the (time, offset) pairs that follow
_PAIR = struct.Struct("<QQ")
_FOOTER = struct.Struct("<BQQQ")  # what the summary's CRC covers of the footer


class Stream(Protocol):
    """What the writer writes to."""

    def write(self, data: bytes) -> int:
        """Take all of it."""

    def tell(self) -> int:
        """Bytes taken so far."""


class McapWriter:
    """Messages into chunks, chunks to the stream; call start first and finish last."""

    def __init__(self, stream: Stream, chunk_bytes: int, folder: Path | None = None) -> None:
        """folder: where the index of a long file waits for its end."""
        self._stream, self._chunk_bytes = stream, chunk_bytes
        self._chunk = bytearray()
        self._first_ns, self._last_ns = 0, 0  # log times in the chunk
        self._index: dict[int, bytearray] = {}  # channel -> (time, offset) pairs of the chunk
        self._chunk_index = Spill(folder)
        self._schemas: list[Schema] = []
        self._channels: list[Channel] = []
        self._statistics = Statistics(
            attachment_count=0,
            channel_count=0,
            channel_message_counts={},
            chunk_count=0,
            message_count=0,
            message_end_time=0,
            message_start_time=0,
            metadata_count=0,
            schema_count=0,
        )

    @property
    def spilt(self) -> bool:
        """Some of the index waits on the disk."""
        return self._chunk_index.on_disk

    def start(self, profile: str) -> None:
        """The beginning of the file."""
        self._stream.write(MAGIC + packed(Header(profile, LIBRARY)))

    def schema(self, name: str, encoding: str, data: bytes) -> int:
        """Declare a schema; its number."""
        number = len(self._schemas) + 1
        self._schemas.append(Schema(id=number, name=name, encoding=encoding, data=data))
        self._chunk += packed(self._schemas[-1])
        self._statistics.schema_count = number
        return number

    def channel(self, topic: str, encoding: str, schema: int) -> int:
        """Declare a channel; its number."""
        number = len(self._channels) + 1
        self._channels.append(
            Channel(
                id=number, topic=topic, message_encoding=encoding, metadata={}, schema_id=schema
            )
        )
        self._chunk += packed(self._channels[-1])
        self._statistics.channel_count = number
        return number

    def message(
        self, channel: int, log_ns: int, publish_ns: int, data: bytes, sequence: int
    ) -> None:
        """Append one; the chunk ends by itself when it is large enough."""
        pairs = self._index.get(channel)
        if pairs is None:
            if not self._index:
                self._first_ns = self._last_ns = log_ns
            pairs = self._index[channel] = bytearray()
        pairs += _PAIR.pack(log_ns, len(self._chunk))
        self._first_ns = min(self._first_ns, log_ns)
        self._last_ns = max(self._last_ns, log_ns)
        length = _MESSAGE.size - _RECORD.size + len(data)
        self._chunk += _MESSAGE.pack(Opcode.MESSAGE, length, channel, sequence, log_ns, publish_ns)
        self._chunk += data
        counts = self._statistics.channel_message_counts
        counts[channel] = counts.get(channel, 0) + 1
        if len(self._chunk) > self._chunk_bytes:
            self.end_chunk()

    def end_chunk(self) -> None:
        """Write the running chunk to the stream; declarations without a message wait for one."""
        if not self._index:
            return
        raw = bytes(self._chunk)
        data = zstandard.compress(raw)
        chunk = packed(
            Chunk(
                compression=COMPRESSION,
                data=data,
                message_start_time=self._first_ns,
                message_end_time=self._last_ns,
                uncompressed_crc=zlib.crc32(raw),
                uncompressed_size=len(raw),
            )
        )
        at = self._stream.tell()
        offsets, index = self._message_index(at + len(chunk))
        self._chunk_index.append(
            packed(
                ChunkIndex(
                    chunk_start_offset=at,
                    chunk_length=len(chunk),
                    compression=COMPRESSION,
                    compressed_size=len(data),
                    uncompressed_size=len(raw),
                    message_start_time=self._first_ns,
                    message_end_time=self._last_ns,
                    message_index_offsets=offsets,
                    message_index_length=len(index),
                )
            )
        )
        self._stream.write(chunk + index)
        self._count()
        self._chunk.clear()
        self._index.clear()

    def _message_index(self, at: int) -> tuple[dict[int, int], bytes]:
        """Where each channel's index of this chunk stands, and the indices; they begin at `at`."""
        offsets, index = {}, bytearray()
        for channel, pairs in self._index.items():
            offsets[channel] = at + len(index)
            length = _INDEX.size - _RECORD.size + len(pairs)
            index += _INDEX.pack(Opcode.MESSAGE_INDEX, length, channel, len(pairs)) + pairs
        return offsets, bytes(index)

    def _count(self) -> None:
        s = self._statistics
        if not s.chunk_count:
            s.message_start_time = self._first_ns
        s.message_start_time = min(s.message_start_time, self._first_ns)
        s.message_end_time = max(s.message_end_time, self._last_ns)
        s.chunk_count += 1
        s.message_count = sum(s.channel_message_counts.values())

    def finish(self) -> None:
        """End the data; summary, footer and magic follow."""
        self.end_chunk()
        self._stream.write(packed(DataEnd(0)))
        start, crc = self._stream.tell(), 0
        offsets = []
        for opcode, records in self._groups():
            group_start = self._stream.tell()
            for data in records:
                crc = zlib.crc32(data, crc)
                self._stream.write(data)
            length = self._stream.tell() - group_start
            offsets.append(packed(SummaryOffset(opcode, group_start, length)))
        offsets_start = self._stream.tell()
        crc = zlib.crc32(b"".join(offsets), crc)
        length = _FOOTER.size - _RECORD.size + 4
        crc = zlib.crc32(_FOOTER.pack(Opcode.FOOTER, length, start, offsets_start), crc)
        self._stream.write(b"".join(offsets) + packed(Footer(start, offsets_start, crc)) + MAGIC)

    def _groups(self) -> Iterator[tuple[Opcode, Iterable[bytes]]]:
        yield Opcode.SCHEMA, map(packed, self._schemas)
        yield Opcode.CHANNEL, map(packed, self._channels)
        yield Opcode.STATISTICS, [packed(self._statistics)]
        yield Opcode.CHUNK_INDEX, self._chunk_index


def packed(record: McapRecord) -> bytes:
    """A record as the bytes of the file."""
    builder = RecordBuilder()
    record.write(builder)
    return builder.end()
