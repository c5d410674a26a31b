"""MCAP with the bus's own bytes in it: one channel per bus key, its schema a protobuf
FileDescriptorSet. How it is read: mcap_log.py.

The file can be opened by any MCAP viewer; layout and records: https://mcap.dev/spec. Nothing here
looks into a payload.
"""

import hashlib
import os
from pathlib import Path

from google.protobuf.descriptor import FileDescriptor
from google.protobuf.descriptor_pb2 import FileDescriptorProto, FileDescriptorSet

from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import Topic
from sessions.recording.mcap_writer import McapWriter

PROFILE = "gyrofree"
RULES = "google/protobuf/descriptor.proto"  # what the contract's rules are written with


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
