"""Orders as they were given, with what came of each: a file that is only added to, of bounded size.

Lines of JSON, each written whole; at LARGEST the file becomes `.1`, which the next one replaces.
"""

import json
import logging
import os
from collections import deque
from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path

from google.protobuf.json_format import MessageToDict, ParseDict, ParseError

from messages.contract import gyrofree_pb2 as pb

log = logging.getLogger(__name__)

LARGEST = 4 << 20  # bytes of one file
KEPT = 1000  # entries that are answered from memory


class History:
    """The newest in memory, all in the file. Used by one thread."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.lost = 0  # entries that could not be written
        self._newest: deque[pb.OrderGiven] = deque(maxlen=KEPT)
        for file in (self._older, path):
            self._newest.extend(_read(file))

    @property
    def _older(self) -> Path:
        return self._path.with_name(self._path.name + ".1")

    def add(self, one: pb.OrderGiven) -> None:
        """Keep one more."""
        self._newest.append(one)
        try:
            self._write(one)
        except OSError as error:
            self.lost += 1
            if self.lost & (self.lost - 1) == 0:
                log.error("%s: %s: %d orders not kept", self._path, error.strerror, self.lost)

    def find(self, text: str, most: int) -> list[pb.OrderGiven]:
        """The newest that contain every word of the text, newest first."""
        return newest_of(self._newest, text, most)

    def _write(self, one: pb.OrderGiven) -> None:
        line = json.dumps(MessageToDict(one, preserving_proto_field_name=True)) + "\n"
        self._path.parent.mkdir(parents=True, exist_ok=True)
        flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC
        handle = os.open(self._path, flags, 0o600)
        try:
            if os.fstat(handle).st_size > LARGEST:
                os.replace(self._path, self._older)
                os.close(handle)
                handle = os.open(self._path, flags, 0o600)
            os.write(handle, line.encode())
        finally:
            os.close(handle)


def newest_of(given: Sequence[pb.OrderGiven], text: str, most: int) -> list[pb.OrderGiven]:
    """Those that contain every word of the text, newest first; `given` is oldest first, and another
    thread may add to it.
    """
    words, there = text.lower().split(), tuple(given)
    return list(islice((one for one in reversed(there) if _has(one, words)), most))


def _has(one: pb.OrderGiven, words: list[str]) -> bool:
    outcome = pb.OrderGiven.Outcome.Name(one.outcome).removeprefix("OUTCOME_").replace("_", " ")
    said = (one.user, one.place, one.whom, one.device, one.what, outcome, one.text)
    inside = " ".join(said).lower()
    return all(word in inside for word in words)


def _read(path: Path) -> Iterator[pb.OrderGiven]:
    """What can be read of it; a line that a crash cut off is passed over, and said."""
    try:
        lines = path.read_bytes().splitlines()[-KEPT:]
    except OSError:
        return
    damaged = 0
    for line in lines:
        try:
            yield ParseDict(json.loads(line), pb.OrderGiven(), ignore_unknown_fields=True)
        except (ValueError, ParseError, RecursionError):
            damaged += 1
    if damaged:
        log.warning("%s: %d lines are no orders", path, damaged)
