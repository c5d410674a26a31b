"""Messages of a recording from any moment on, in the order of their times."""

from collections.abc import Iterator
from pathlib import Path

from google.protobuf.message import DecodeError
from mcap.exceptions import McapError
from mcap.reader import make_reader

from messages.contract.topics import Topic, TopicError, parse
from sessions.recording.mcap_log import Damage, read
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
                found = make_reader(stream).get_summary()
            except (McapError, ValueError, EOFError):
                found = None
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
        with self._path.open("rb") as stream:
            for _, channel, message in make_reader(stream).iter_messages(
                starting_at=from_ns or None
            ):
                yield message.log_time, channel.topic, message.data
