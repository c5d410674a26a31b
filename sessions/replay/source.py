"""Messages of a recording from any moment on, in the order of their times."""

import heapq
import itertools
import struct
from collections.abc import Iterator
from pathlib import Path

from google.protobuf.message import DecodeError
from mcap.exceptions import McapError
from mcap.reader import SeekingReader

from messages.contract.topics import Topic, TopicError, parse
from sessions.recording.mcap_log import RECORD_LIMIT, Damage, chunk_at, read
from sessions.recording.samples import decode
from sessions.replay.replay import Input


class Source:
    """Messages of a recording from any moment on; `start_ns` and `length_s` are those of the
    file.
    """

    def __init__(self, path: Path, topics: tuple[Topic, ...]) -> None:
        """Raises OSError, and ValueError for a file without any message."""
        self._path, self._topics = path, topics
        self.start_ns, end_ns = self._bounds()
        self.length_s = (end_ns - self.start_ns) / 1e9

    def _bounds(self) -> tuple[int, int]:
        with self._path.open("rb") as stream:
            try:
                found = SeekingReader(stream, record_size_limit=RECORD_LIMIT).get_summary()
            except (McapError, ValueError, EOFError, struct.error):
                found = None
        self._index = found
        self._indexed = (
            found is not None and found.statistics is not None and bool(found.chunk_indexes)
        )
        if self._indexed and found.statistics.message_count:
            return found.statistics.message_start_time, found.statistics.message_end_time
        damage = Damage()
        times = [
            row.log_ns for row in read(self._path, damage)
        ]  # without an index: as far as it can be read
        if not times:
            raise ValueError(f"{self._path}: no message in it, {damage}: want an MCAP recording")
        return min(times), max(times)

    def items(self, from_ns: int = 0) -> Iterator[Input]:
        """Decoded messages from this log time on, in its order."""
        for log_ns, key, payload in self._rows(from_ns):
            try:
                address = parse(key)
                if address.topic in self._topics:
                    yield Input(log_ns, address, decode(address.topic, payload))
            except (TopicError, DecodeError):
                continue

    def _rows(self, from_ns: int) -> Iterator[tuple[int, str, bytes]]:
        if not self._indexed:
            yield from (
                (r.log_ns, r.key, r.payload) for r in read(self._path) if r.log_ns >= from_ns
            )
            return
        yield from self._indexed_rows(from_ns)

    def _indexed_rows(self, from_ns: int) -> Iterator[tuple[int, str, bytes]]:
        """By the file's index, one chunk at a time: a message waits until no later chunk can have
        an earlier one.
        """
        waiting: list[tuple[int, int, str, bytes]] = []
        order = itertools.count()
        chunks = sorted(
            (one for one in self._index.chunk_indexes if one.message_end_time >= from_ns),
            key=lambda one: one.message_start_time,
        )
        with self._path.open("rb") as stream:
            for one in chunks:
                while waiting and waiting[0][0] < one.message_start_time:
                    log_ns, _, key, payload = heapq.heappop(waiting)
                    yield log_ns, key, payload
                for message in chunk_at(stream, one.chunk_start_offset):
                    channel = self._index.channels.get(message.channel_id)
                    if channel is not None and message.log_time >= from_ns:
                        row = message.log_time, next(order), channel.topic, message.data
                        heapq.heappush(waiting, row)
        while waiting:
            log_ns, _, key, payload = heapq.heappop(waiting)
            yield log_ns, key, payload
