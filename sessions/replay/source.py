"""Messages of a recording from any moment on, in the order of their times."""

import heapq
from collections.abc import Iterator
from pathlib import Path

from google.protobuf.message import DecodeError

from messages.contract.topics import Topic, TopicError, parse
from sessions.library.scan import rows_of
from sessions.recording.mcap_damage import Damage
from sessions.recording.mcap_index import keys_of, ordered_summary_of
from sessions.recording.mcap_log import say
from sessions.recording.samples import decode
from sessions.recording.timeline import straight
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
        self._index = ordered_summary_of(self._path)
        if self._index is not None:
            found = self._index.statistics
            return found.message_start_time, found.message_end_time
        damage = Damage()
        first = last = 0
        for row in straight(self._path, damage):  # without an index: as far as it can be read
            first, last = min(first or row.log_ns, row.log_ns), max(last, row.log_ns)
        say(self._path, damage)
        if not first:
            raise ValueError(f"{self._path}: no message in it, {damage}: want an MCAP recording")
        return first, last

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
        """Of all keys, in the order of their times as far as the file has an index."""
        if self._index is None:
            rows = ((r.log_ns, r.key, r.payload) for r in straight(self._path))
            yield from (row for row in rows if row[0] >= from_ns)
            return
        chunks = [c for c in self._index.chunk_indexes if c.message_end_time >= from_ns]
        chunks.sort(key=lambda chunk: (chunk.message_start_time, chunk.chunk_start_offset))
        damage, held, count = Damage(), [], 0
        with self._path.open("rb") as stream:
            for chunk in chunks:
                while held and held[0][0] < chunk.message_start_time:
                    log_ns, _, key, payload = heapq.heappop(held)
                    yield log_ns, key, payload
                for row in rows_of(stream, chunk, keys_of(self._index), damage):
                    if row[0] >= from_ns:
                        count += 1  # equal times stay in the file's order
                        heapq.heappush(held, (row[0], count, row[1], row[2]))
        while held:
            log_ns, _, key, payload = heapq.heappop(held)
            yield log_ns, key, payload
        say(self._path, damage)
