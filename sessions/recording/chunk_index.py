"""Where the chunks of an open MCAP file lie, without keeping it in memory.

The writer of the mcap library makes an index record of every chunk and holds them all until the
file is closed. With twenty channels and a chunk every 0.4 s that is some 20 MB an hour. Here they
are held as the bytes that will stand in the summary, and those in a file without a name, which the
system removes with the process.
"""

import tempfile
from collections.abc import Iterator
from pathlib import Path

from mcap.data_stream import RecordBuilder
from mcap.records import ChunkIndex
from mcap.writer import Writer

HELD_BYTES = 64 * 1024
_NAME = "_Writer__chunk_indices"


class _Bytes:
    """A record that is written as it is."""

    def __init__(self, data: bytes) -> None:
        self._data = data

    def write(self, builder: RecordBuilder) -> None:
        builder.write(self._data)


class ChunkIndices:
    """Takes the place of the writer's list: what is appended is held as bytes, and given back as
    records to write.
    """

    def __init__(self, folder: Path | None = None) -> None:
        """folder: of the file that takes what memory should not."""
        self._folder = folder
        self._held = bytearray()
        self._spilt = None

    def append(self, index: ChunkIndex) -> None:
        """Keep one; a disk that refuses costs memory, nothing else: the chunk itself is in the file
        already.
        """
        builder = RecordBuilder()
        index.write(builder)
        self._held += builder.end()
        if len(self._held) < HELD_BYTES:
            return
        try:
            if self._spilt is None:
                self._spilt = tempfile.TemporaryFile(dir=self._folder, buffering=0)
            at = self._spilt.tell()
            if self._spilt.write(self._held) == len(self._held):
                self._held.clear()
            else:  # what a full disk does first
                self._spilt.seek(at)
        except OSError:
            return

    def __iter__(self) -> Iterator[_Bytes]:
        if self._spilt is not None:
            end = self._spilt.tell()
            self._spilt.seek(0)
            yield _Bytes(self._spilt.read(end))
            self._spilt.seek(end)
        yield _Bytes(bytes(self._held))


def spill(writer: Writer, folder: Path | None = None) -> None:
    """Have `writer` keep its chunk index on the disk; raises AttributeError for one that has no
    such list.
    """
    if getattr(writer, _NAME) != []:
        raise AttributeError(
            f"mcap's writer has no empty list {_NAME} for its chunk index: adapt"
            " sessions/chunk_index"
        )
    setattr(writer, _NAME, ChunkIndices(folder))
