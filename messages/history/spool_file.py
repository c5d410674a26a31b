"""Records of a spool: what stands before each published message, and how to find them in a file."""

import os
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from messages.history.journal_file import (
    Record,
    walk,
)

HEAD = struct.Struct("<QQqBB")


GLANCE_BYTES = 4096  # most messages are shorter


class Entry(NamedTuple):
    """One published message."""

    position: int
    topic: str  # "accel", "rate/products-ekf"
    device: str
    run: int
    sequence: int
    utc_ns: int
    published_ns: int
    payload: bytes


class Glance(NamedTuple):
    """Where an overview finds a message."""

    utc_ns: int
    segment: int
    offset: int


def entry_of(record: Record) -> Entry:
    """The message in a record; raises struct.error for one that holds none."""
    run, sequence, utc_ns, topic_n, device_n = HEAD.unpack_from(record.data)
    middle = HEAD.size + topic_n
    end = middle + device_n
    topic, device = record.data[HEAD.size : middle].decode(), record.data[middle:end].decode()
    return Entry(
        record.sequence, topic, device, run, sequence, utc_ns, record.utc_ns, record.data[end:]
    )


def count(
    table: dict[tuple[str, str, int], list[int]], topic: str, device: str, run: int, sequence: int
) -> None:
    known = table.get((topic, device, run))
    if known is None:
        table[topic, device, run] = [sequence, sequence]
    else:
        known[1] = sequence


def older(name: Path, run: int) -> bool:
    """True when a segment was written before a run began, whose number is the time of its beginning
    in ns.
    """
    try:
        return name.stat().st_mtime_ns < run
    except FileNotFoundError:
        return True


def records_in(name: Path, limit: int = 0, first: int = 0) -> Iterator[Record]:
    """Good records of a segment from sequence `first` on; with a limit only those in its first
    bytes.

    Nothing when retention was faster.
    """
    try:
        if limit:
            with name.open("rb") as stream:
                data = os.read(stream.fileno(), limit)
        else:
            data = name.read_bytes()
    except FileNotFoundError:
        return
    for _, _, record in walk(data, first=first):
        yield record
