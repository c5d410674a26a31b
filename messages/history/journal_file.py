"""The journal's record, as bytes.

    segment = magic "GFJSEG01" | u64 run | u64 first sequence | record ...
    record  = magic "GFJ1" | u64 sequence | u64 monotonic ns | u64 UTC ns | u32 length | u8 channel
    | bytes | u32 crc

all little-endian; crc is zlib's CRC-32 over everything before it. The magic lets a reader find the
next record after damage.
"""

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass

SEGMENT_MAGIC = b"GFJSEG01"
RECORD_MAGIC = b"GFJ1"
SEGMENT_HEAD = struct.Struct("<8sQQ")
RECORD_HEAD = struct.Struct("<4sQQQIB")
CRC = struct.Struct("<I")
MAX_BYTES = 1 << 20  # of one read; a longer length is damage

BOARD, GNSS, PUBLISHED = (
    0,
    1,
    2,
)  # channels; journals of published messages are described in spool.py


@dataclass(frozen=True)
class Record:
    """One read of one port, or one published message."""

    sequence: int
    monotonic_ns: int
    utc_ns: int
    channel: int
    data: bytes


def pack(record: Record) -> bytes:
    """The record as it stands on the disk."""
    body = RECORD_HEAD.pack(
        RECORD_MAGIC,
        record.sequence,
        record.monotonic_ns,
        record.utc_ns,
        len(record.data),
        record.channel,
    )
    body += record.data
    return body + CRC.pack(zlib.crc32(body))


@dataclass(frozen=True)
class Scan:
    """What a buffer holds: (start, end, record) of the good records, and the bytes that belong to
    none.
    """

    records: list[tuple[int, int, Record]]
    damaged_bytes: int

    @property
    def good_end(self) -> int:
        """Where the last good record ends; the segment's head when there is none."""
        return self.records[-1][1] if self.records else SEGMENT_HEAD.size


def unpack_at(data: bytes, start: int) -> tuple[Record, int] | None:
    """Record at `start` and where it ends; None when no whole, undamaged record begins there."""
    body = start + RECORD_HEAD.size
    if data[start : start + 4] != RECORD_MAGIC or body + CRC.size > len(data):
        return None
    _, sequence, monotonic_ns, utc_ns, length, channel = RECORD_HEAD.unpack_from(data, start)
    end = body + length
    if length > MAX_BYTES or end + CRC.size > len(data):
        return None
    if zlib.crc32(memoryview(data)[start:end]) != CRC.unpack_from(data, end)[0]:
        return None
    return Record(sequence, monotonic_ns, utc_ns, channel, bytes(data[body:end])), end + CRC.size


def walk(
    data: bytes, start: int = SEGMENT_HEAD.size, first: int = 0
) -> Iterator[tuple[int, int, Record]]:
    """Good records from `start` on, one at a time: (start, end, record); damage is stepped over to
    the next magic.

    Those before sequence `first` are left out without a look at their CRC, where the next record
    follows as it should.
    """
    while 0 <= start < len(data):
        end = _skip(data, start, first) if first else None
        if end is not None:
            start = end
            continue
        found = unpack_at(data, start)
        if found:
            if found[0].sequence >= first:
                yield start, found[1], found[0]
            start = found[1]
        else:
            start = data.find(RECORD_MAGIC, start + 1)


def _skip(data: bytes, start: int, first: int) -> int | None:
    """Where the record behind this one begins, when both come before `first` and look sound; else
    None.
    """
    if start + RECORD_HEAD.size > len(data):
        return None
    magic, sequence, _, _, length, _ = RECORD_HEAD.unpack_from(data, start)
    end = start + RECORD_HEAD.size + length + CRC.size
    if magic != RECORD_MAGIC or sequence + 1 >= first or end + RECORD_HEAD.size > len(data):
        return None
    magic, following, *_ = RECORD_HEAD.unpack_from(data, end)
    return end if magic == RECORD_MAGIC and following == sequence + 1 else None


def scan(data: bytes, start: int = SEGMENT_HEAD.size) -> Scan:
    """All good records from `start` on; damage is stepped over to the next magic and counted."""
    records = list(walk(data, start))
    return Scan(records, max(0, len(data) - start) - sum(end - begin for begin, end, _ in records))


def last_whole(data: bytes) -> int | None:
    """Sequence of the record that ends where `data` ends; None when none does: a torn tail, or one
    longer than that.
    """
    start = len(data)
    while (start := data.rfind(RECORD_MAGIC, 0, start)) >= 0:
        found = unpack_at(data, start)
        if found:
            return found[0].sequence if found[1] == len(data) else None
    return None


def records(data: bytes) -> Iterator[Record]:
    """Good records of concatenated record bytes, as a history reply carries them."""
    for _, _, record in walk(data, 0):
        yield record
