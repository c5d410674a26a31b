"""Records of MCAP, taken apart within limits; a reader of them counts what cannot be."""

import io
import struct
import zlib
from collections.abc import Iterator
from typing import IO

from mcap.data_stream import ReadDataStream
from mcap.records import Channel, Chunk, Schema

from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import RATE, TopicError, parse
from sessions.recording import mcap_chunk

RECORD_LIMIT = 64 * 1024**2  # bytes of a record that is read (our chunks have 128 KiB)
BLOCK = 1024**2  # bytes at once of a record that is passed over

RECORD = struct.Struct("<BQ")  # opcode, length of what follows
MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time; then the payload
SUMMARY_CRC = 4  # bytes of the footer that its own CRC does not cover


class Unreadable(ValueError):
    """A chunk or record that is no such; the text says why."""


class Names:
    """Which channels are whose."""

    def __init__(self, channels: dict[int, str]) -> None:
        self.keys: dict[int, str] = dict(channels)  # of this program
        self.foreign: dict[int, str] = {}  # of others, in words
        self._schemas: dict[int, str] = {}

    def __contains__(self, channel: int) -> bool:
        return channel in self.keys or channel in self.foreign

    def add(self, channels: dict[int, str]) -> None:
        """Channels of this program that were not known until now."""
        self.keys = channels | self.keys

    def schema(self, schema: Schema) -> None:
        """A schema that the file declares."""
        self._schemas[schema.id] = schema.name

    def channel(self, channel: Channel) -> None:
        """A channel that the file declares."""
        self.keys.pop(channel.id, None)
        self.foreign.pop(channel.id, None)
        name = self._schemas.get(channel.schema_id, "")
        if is_ours(channel.topic, channel.message_encoding, name):
            self.keys[channel.id] = channel.topic
        else:
            kind = " ".join(filter(None, (channel.message_encoding, name)))
            self.foreign[channel.id] = f"{channel.topic} ({kind})" if kind else channel.topic


def is_ours(topic: str, encoding: str, schema: str) -> bool:
    """Does a channel carry messages of this program? schema: its name, empty where unknown."""
    try:
        address = parse(topic)
        kind = address.topic
        kind.key(address.prefix, address.device, address.estimator)  # checks the names
    except TopicError:
        return False
    names = [kind.type.DESCRIPTOR.full_name]
    names += [pb.RateEstimate.DESCRIPTOR.full_name] if kind is RATE else []
    return encoding == "protobuf" and (not schema or schema in names)


def records(data: bytes) -> Iterator[tuple[int, int, int]]:
    """(opcode, begin, end) of the records inside a chunk's content. Raises Unreadable."""
    at = 0
    while at < len(data):
        if at + RECORD.size > len(data):
            raise Unreadable("a record is cut off")
        opcode, length = RECORD.unpack_from(data, at)
        begin = at + RECORD.size
        at = begin + length
        if at > len(data):
            raise Unreadable("a record is longer than its chunk")
        yield opcode, begin, at


def content(body: bytes) -> tuple[bytes, bool]:
    """A chunk record's content, and whether a CRC covers it. Raises Unreadable."""
    chunk = parsed(Chunk, body)
    try:
        return mcap_chunk.content(chunk), bool(chunk.uncompressed_crc)
    except mcap_chunk.ChunkError as error:
        raise Unreadable(str(error)) from None


def parsed(kind: type, body: bytes):
    """A record of the library's. Raises Unreadable: damaged lengths make it raise almost
    anything.
    """
    try:
        return kind.read(ReadDataStream(io.BytesIO(body)))
    except Exception as error:
        raise Unreadable(f"no {kind.__name__} ({type(error).__name__})") from None


def crc_of(stream: IO[bytes], begin: int, end: int) -> int:
    """CRC of a part of a file."""
    stream.seek(begin)
    crc = 0
    while begin < end and (data := stream.read(min(BLOCK, end - begin))):
        crc = zlib.crc32(data, crc)
        begin += len(data)
    return crc
