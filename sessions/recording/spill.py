"""Bytes that are only read again at the end: in memory while they are few, then in a nameless file.

The index of an open recording is such a thing. With twenty channels and a chunk every 0.4 s it
grows by some MB an hour, as objects of a library by 20 MB an hour. The system removes the file
with the process.
"""

import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import IO

HELD_BYTES = 64 * 1024
PIECE_BYTES = 1 << 20


class Spill:
    """Append now, iterate over all of it later."""

    def __init__(self, folder: Path | None = None) -> None:
        """folder: of the file that takes what memory should not."""
        self._folder = folder
        self._held = bytearray()
        self._file: IO[bytes] | None = None

    @property
    def on_disk(self) -> bool:
        """Some of it is in the file."""
        return self._file is not None

    def append(self, data: bytes) -> None:
        """Keep bytes; a disk that refuses costs memory, nothing else."""
        self._held += data
        if len(self._held) < HELD_BYTES:
            return
        try:
            if self._file is None:
                self._file = tempfile.TemporaryFile(dir=self._folder, buffering=0)
            at = self._file.tell()
            if self._file.write(self._held) == len(self._held):
                self._held.clear()
            else:  # what a full disk does first
                self._file.seek(at)
        except OSError:
            return

    def __iter__(self) -> Iterator[bytes]:
        """All of it in its order, in pieces; raises OSError when the file cannot be read."""
        if self._file is not None:
            end = self._file.tell()
            self._file.seek(0)
            left = end
            while left and (piece := self._file.read(min(left, PIECE_BYTES))):
                left -= len(piece)
                yield piece
            self._file.seek(end)
        yield bytes(self._held)
