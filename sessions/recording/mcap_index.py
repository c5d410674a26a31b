"""An MCAP file's own index at its end: used where it can be trusted to lead to every message."""

import functools
import os
import struct
from collections.abc import Iterable
from itertools import pairwise
from pathlib import Path

from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.reader import SeekingReader
from mcap.records import ChunkIndex
from mcap.summary import Summary

from sessions.recording.mcap_records import RECORD, SUMMARY_CRC, Names, crc_of
from sessions.recording.mcap_writer import MAGIC

BACK_S, PAUSE_S = (
    1.0,
    60.0,
)  # receive times that go back, or jump further: a clock may have been set
STILL_CHUNKS = 8  # one after another that end at one time: likewise
FOOTER = struct.Struct("<QQI")  # begin of the summary, of its offsets, CRC


def summary_of(path: Path) -> Summary | None:
    """The file's own index; None where it has none that leads to every message. Raises OSError."""
    found = path.stat()
    return _summary(path, found.st_size, found.st_mtime_ns)


def ordered_summary_of(path: Path) -> Summary | None:
    """The same, where receive times can be gone by as well: a file whose clock was set while it was
    recorded has to be read whole, by timeline.straight. Raises OSError.
    """
    found = summary_of(path)
    return None if found is None or stepped(found.chunk_indexes) else found


def stepped(chunks: Iterable[ChunkIndex]) -> bool:
    """Do the receive times of a file go back, jump or stand still, as far as its index tells? Then
    the index cannot be gone by, and the file has to be read by `straight`.
    """
    ordered = sorted(chunks, key=lambda chunk: chunk.chunk_start_offset)
    pause_ns, back_ns = PAUSE_S * 1e9, BACK_S * 1e9
    if any(one.message_end_time - one.message_start_time > pause_ns for one in ordered):
        return True
    still = 0
    for before, one in pairwise(ordered):
        jump = one.message_start_time - before.message_end_time
        if jump < -back_ns or jump > pause_ns:
            return True
        still = still + 1 if one.message_end_time <= before.message_end_time else 0
        if still >= STILL_CHUNKS:
            return True
    return False


@functools.lru_cache(maxsize=2)  # that of an hour takes longer to read than a first look at it
def _summary(path: Path, size: int, mtime_ns: int) -> Summary | None:
    tail = RECORD.size + FOOTER.size + len(MAGIC)
    with path.open("rb") as stream:
        if size < 2 * tail:
            return None
        stream.seek(-tail, os.SEEK_END)
        end = stream.read()
        opcode, _ = RECORD.unpack_from(end)
        start, _, crc = FOOTER.unpack_from(end, RECORD.size)
        if opcode != Opcode.FOOTER or not end.endswith(MAGIC) or not 0 < start < size:
            return None
        if crc and crc_of(stream, start, size - len(MAGIC) - SUMMARY_CRC) != crc:
            return None
        stream.seek(0)
        try:
            found = SeekingReader(stream, record_size_limit=size).get_summary()
        except (McapError, ValueError, EOFError, struct.error, MemoryError):
            return None
    return found if found is not None and _leads_to_all(found) else None


def _leads_to_all(found: Summary) -> bool:
    counted = found.statistics
    return bool(
        counted is not None
        and counted.message_count
        and found.chunk_indexes
        and len(found.chunk_indexes) == counted.chunk_count
        and counted.channel_message_counts.keys() <= found.channels.keys()
        and {0, *found.schemas} >= {channel.schema_id for channel in found.channels.values()}
    )


def keys_of(found: Summary) -> dict[int, str]:
    """Channel -> bus key, of this program's channels."""
    names = Names({})
    for schema in found.schemas.values():
        names.schema(schema)
    for channel in found.channels.values():
        names.channel(channel)
    return names.keys
