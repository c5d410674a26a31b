"""MCAP with the bus's own bytes in it: one channel per bus key, its schema a protobuf
FileDescriptorSet.

The file can be opened by any MCAP viewer; layout and records: https://mcap.dev/spec. Nothing here
looks into a payload.
"""

import hashlib
import io
import os
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from google.protobuf.descriptor import FileDescriptor
from google.protobuf.descriptor_pb2 import FileDescriptorProto, FileDescriptorSet
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Message, Schema
from mcap.stream_reader import StreamReader

from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import Topic
from sessions.recording import mcap_chunk
from sessions.recording.mcap_writer import McapWriter

PROFILE = "gyrofree"
RULES = "google/protobuf/descriptor.proto"  # what the contract's rules are written with
_HEAD = struct.Struct("<BQ")  # opcode and length of a record
RECORD_LIMIT = 64 * 1024**2  # bytes; a longer record is damage, not data (our chunks are 128 KiB)


@dataclass(frozen=True, slots=True)
class Recorded:
    """One message as it crossed the bus."""

    log_ns: int  # when the recorder received it, UTC, ns since 1970
    publish_ns: int  # header.utc_ns, or log_ns when it has none
    key: str
    payload: bytes


def descriptor_set(topic: Topic) -> bytes:
    """The serialised FileDescriptorSet of a topic's type with everything it imports, dependencies
    first.
    """
    files: dict[str, FileDescriptor] = {}

    def visit(file: FileDescriptor) -> None:
        if file.name not in files and file.name != RULES:
            for dependency in file.dependencies:
                visit(dependency)
            files[file.name] = file

    visit(topic.type.DESCRIPTOR.file)
    result = FileDescriptorSet()
    for file in files.values():
        _without_rules(file, result.file.add())
    return result.SerializeToString()


def _without_rules(file: FileDescriptor, out: FileDescriptorProto) -> None:
    """A file as other viewers read it: our rules for what a field may hold are not theirs."""
    file.CopyToProto(out)
    if RULES not in out.dependency:
        return
    out.dependency.remove(RULES)
    del out.extension[:]
    found = list(out.message_type)
    while found:
        message = found.pop()
        found += message.nested_type
        message.options.ClearExtension(pb.open)
        for field in message.field:
            field.options.ClearExtension(pb.rule)
            if not field.options.ByteSize():
                field.ClearField("options")
        if not message.options.ByteSize():
            message.ClearField("options")


class Sink:
    """What the MCAP writer writes to: memory first, the file when `push` is called.

    On a full disk the bytes stay in memory and the next push goes on where the last one stopped, so
    that a disk that gets room again has lost nothing.
    """

    def __init__(self, fd: int) -> None:
        self._fd = fd
        self._written = 0
        self.hash = (
            hashlib.sha256()
        )  # of what the file holds; the writer never goes back, so no second reading
        self.pending = bytearray()

    def write(self, data: bytes) -> int:
        self.pending += data
        return len(data)

    def tell(self) -> int:
        return self._written + len(self.pending)

    def push(self) -> None:
        """Write what is pending; raises OSError with everything unwritten kept."""
        while self.pending:
            n = os.write(self._fd, self.pending)
            self._written += n
            self.hash.update(memoryview(self.pending)[:n])
            del self.pending[:n]


class McapLog:
    """Appends messages; channels and schemas are made at the first message of a key."""

    def __init__(self, fd: int, chunk_bytes: int, folder: Path | None = None) -> None:
        """folder: where the index of a long recording waits for its end."""
        self._sink = Sink(fd)
        self._writer = McapWriter(self._sink, chunk_bytes, folder)
        self._writer.start(PROFILE)
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}

    @property
    def channels(self) -> dict[int, str]:
        """MCAP channel id -> bus key."""
        return {number: key for key, number in self._channels.items()}

    @property
    def pending(self) -> int:
        """Bytes of complete chunks that are not in the file yet."""
        return len(self._sink.pending)

    @property
    def size(self) -> int:
        """Bytes of the file once everything pending is written."""
        return self._sink.tell()

    @property
    def spilt(self) -> bool:
        """Some of the file's index waits on the disk for its end."""
        return self._writer.spilt

    @property
    def sha256(self) -> str:
        """Hex digest of what has been written to the file."""
        return self._sink.hash.hexdigest()

    def open_channel(self, key: str, topic: Topic) -> int:
        """Channel number of a key, made when it is new."""
        if key not in self._channels:
            name = topic.type.DESCRIPTOR.full_name
            if name not in self._schemas:
                self._schemas[name] = self._writer.schema(name, "protobuf", descriptor_set(topic))
            self._channels[key] = self._writer.channel(key, "protobuf", self._schemas[name])
        return self._channels[key]

    def add(
        self, channel: int, log_ns: int, publish_ns: int, payload: bytes, sequence: int = 0
    ) -> None:
        """Append one message; MCAP's own sequence has 32 bits."""
        self._writer.message(channel, log_ns, publish_ns, payload, sequence & 0xFFFFFFFF)

    def close_chunk(self) -> None:
        """End the running chunk, so that the next push writes everything added until now."""
        self._writer.end_chunk()

    def push(self) -> None:
        """Write complete chunks to the file; raises OSError, nothing is forgotten then."""
        self._sink.push()

    def finish(self) -> None:
        """End the data and append index and statistics; push writes them."""
        self._writer.finish()


@dataclass
class Damage:
    """What was wrong with a file that was read to its readable end."""

    chunks: int = 0  # complete, but with a wrong CRC, not to be decompressed, or larger than said
    orphans: int = 0  # messages of channels that no readable chunk declares
    tail: str = ""  # why reading ended before the file's end; empty when it did not

    def __str__(self) -> str:
        parts = [f"{self.chunks} damaged chunks left out"] if self.chunks else []
        parts += [f"{self.orphans} messages of unknown channels left out"] if self.orphans else []
        return "; ".join(parts + ([self.tail] if self.tail else [])) or "no damage"


def read(
    path: Path, damage: Damage | None = None, channels: dict[int, str] | None = None
) -> Iterator[Recorded]:
    """Every readable message in the order of recording, also of a file without an end; CRCs are
    checked.

    `channels` (of session.json) names channels whose declaration is in a damaged chunk. What could
    not be read is counted in `damage`. Raises OSError when the file cannot be opened.
    """
    damage = damage if damage is not None else Damage()
    names = dict(channels or {})
    with path.open("rb") as stream:
        for record in _records(stream, damage):
            if isinstance(record, Channel):
                names[record.id] = record.topic
            elif isinstance(record, Message):
                key = names.get(record.channel_id)
                if key is None:
                    damage.orphans += 1
                else:
                    yield Recorded(record.log_time, record.publish_time, key, record.data)


def _records(stream: IO[bytes], damage: Damage) -> Iterator[Schema | Channel | Message]:
    """Records of all good chunks; ends, with the reason in damage.tail, where the file cannot be
    read on.

    Damaged lengths make the MCAP library raise almost anything (struct.error, UnicodeDecodeError,
    its own errors), so everything but an error of the disk is taken as "this is no MCAP from here
    on".
    """
    records = StreamReader(stream, emit_chunks=True, record_size_limit=RECORD_LIMIT).records
    while True:
        try:
            record = next(records)
        except StopIteration:
            return
        except OSError:
            raise
        except Exception as error:
            damage.tail = f"ends at byte {stream.tell()} without a close ({type(error).__name__})"
            return
        if not isinstance(record, Chunk):
            continue
        try:
            yield from mcap_chunk.records(record)
        except mcap_chunk.ChunkError:
            damage.chunks += 1


def chunk_at(stream: IO[bytes], offset: int) -> Iterator[Message]:
    """Messages of the chunk whose record begins at this byte, as the file's index says; none where
    there is no readable chunk.
    """
    stream.seek(offset)
    opcode, length = _HEAD.unpack(stream.read(_HEAD.size).ljust(_HEAD.size, b"\0"))
    if opcode != Opcode.CHUNK or length > RECORD_LIMIT:
        return
    try:
        chunk = Chunk.read(ReadDataStream(io.BytesIO(stream.read(length))))
        yield from (one for one in mcap_chunk.records(chunk) if isinstance(one, Message))
    except (mcap_chunk.ChunkError, McapError, struct.error, UnicodeDecodeError):
        return
