"""Messages of a few topics out of a long recording, fast: by the file's own index, chunk by chunk.

Chunks that hold none of the wanted channels are not read. A file without an index, or with one that
cannot be trusted, is read from front to end instead.
"""

import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from mcap.opcode import Opcode
from mcap.records import ChunkIndex
from mcap.summary import Summary

from messages.contract.topics import Topic, parse
from sessions.recording.mcap_damage import Damage
from sessions.recording.mcap_index import keys_of, ordered_summary_of
from sessions.recording.mcap_log import say
from sessions.recording.mcap_records import (
    MESSAGE,
    RECORD,
    RECORD_LIMIT,
    Unreadable,
    content,
    records,
)
from sessions.recording.timeline import straight

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


def extent(path: Path) -> Extent:
    """Times and counts of a recording. Raises OSError, and ValueError for a file without any
    message.
    """
    found = ordered_summary_of(path)
    if found is not None:
        counts = found.statistics.channel_message_counts
        names = {key: counts.get(number, 0) for number, key in keys_of(found).items()}
        return Extent(
            found.statistics.message_start_time,
            found.statistics.message_end_time,
            names,
            len(found.chunk_indexes),
        )
    damage = Damage()
    first = last = 0
    for row in straight(path, damage):
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
    path: Path,
    topics: tuple[Topic, ...],
    stride: int = 1,
    on_progress: Progress = lambda _: None,
    damage: Damage | None = None,
) -> Iterator[Block]:
    """The messages of these topics, block by block as the file has them; of one chunk in `stride`
    only.

    What cannot be read is counted in `damage`, or logged where none is given. `stride` is for a
    first look; a file without an index is read whole. Raises OSError.
    """
    account = Damage() if damage is None else damage
    found = ordered_summary_of(path)
    if found is None:
        for row in straight(path, account):
            if _wanted(row.key, topics):
                yield Block(row.key, [row.log_ns], [row.payload])
    else:
        yield from _indexed(path, found, topics, stride, on_progress, account)
    if damage is None:
        say(path, account)


def _indexed(
    path: Path,
    found: Summary,
    topics: tuple[Topic, ...],
    stride: int,
    on_progress: Progress,
    damage: Damage,
) -> Iterator[Block]:
    keys = {number: key for number, key in keys_of(found).items() if _wanted(key, topics)}
    chunks = sorted(found.chunk_indexes, key=lambda chunk: chunk.chunk_start_offset)[::stride]
    with path.open("rb") as stream:
        for count, chunk in enumerate(chunks):
            held = chunk.message_index_offsets  # other writers leave them out
            if not held or any(number in keys for number in held):
                yield from _blocks(stream, chunk, keys, damage)
            if count % 50 == 0:
                on_progress(count / len(chunks))
    on_progress(1.0)


def _wanted(key: str, topics: tuple[Topic, ...]) -> bool:
    return parse(key).topic in topics


def _blocks(
    stream: IO[bytes], chunk: ChunkIndex, keys: dict[int, str], damage: Damage
) -> Iterator[Block]:
    """The wanted messages of one chunk, key by key; none of a chunk that cannot be read."""
    found: dict[str, Block] = {}
    for log_ns, key, payload in rows_of(stream, chunk, keys, damage):
        block = found.get(key) or found.setdefault(key, Block(key, [], []))
        block.log_ns.append(log_ns)
        block.payloads.append(payload)
    yield from found.values()


def rows_of(
    stream: IO[bytes], chunk: ChunkIndex, keys: dict[int, str], damage: Damage
) -> list[tuple[int, str, bytes]]:
    """(receive time ns, bus key, payload) of the messages of these channels in one chunk; none of a
    chunk that cannot be read, which is counted.
    """
    stream.seek(chunk.chunk_start_offset)
    rows = []
    try:
        head = stream.read(RECORD.size)
        opcode, length = RECORD.unpack(head) if len(head) == RECORD.size else (0, 0)
        if opcode != Opcode.CHUNK or length > RECORD_LIMIT:
            raise Unreadable("no chunk where the index has one")
        data, _ = content(stream.read(length))
        for opcode, begin, end in records(data):
            if opcode != Opcode.MESSAGE:
                continue
            channel, _, log_ns, _ = MESSAGE.unpack_from(data, begin)
            damage.messages += 1
            if channel in keys:
                rows.append((log_ns, keys[channel], data[begin + MESSAGE.size : end]))
    except (Unreadable, struct.error):
        damage.chunks += 1
        return []
    return rows
