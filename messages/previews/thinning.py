"""A message made small for a picture: one row of its columns, numbers to 24 bits.

Columns are known by the rules in gyrofree.proto, so a new topic is thinned at once. Only columns
are rounded: a latitude is no column, and 24 bits would be metres of it.
"""

from functools import cache

import numpy as np
from google.protobuf.descriptor import Descriptor, FieldDescriptor
from google.protobuf.message import DecodeError, Message

from messages.contract import gyrofree_pb2 as pb
from messages.contract import topics as tp
from messages.previews.frames import Frame

HALF, MASK = np.int64(1 << 28), np.int64(-1 << 29)  # of the 29 bits of a double that a single lacks


@cache
def _columns(descriptor: Descriptor) -> tuple[tuple[str, int, str, bool], ...]:
    """Of each column: name, numbers in a row (0: as many as a field says), that field, is it of
    floating point?
    """
    found = []
    for field in descriptor.fields:
        rule = field.GetOptions().Extensions[pb.rule]
        if field.is_repeated and (rule.row or rule.columns):
            floating = field.cpp_type == FieldDescriptor.CPPTYPE_DOUBLE
            found.append((field.name, rule.row, rule.columns, floating))
    return tuple(found)


def rows(message: Message) -> int:
    """How many samples a message has: the fewest rows of a column that is as wide as it says."""
    counts = []
    for name, row, columns, _ in _columns(message.DESCRIPTOR):
        width, length = row or getattr(message, columns), len(getattr(message, name))
        if width and length:
            counts.append(length // width)
    return max(1, min(counts, default=1))


def thin(message: Message) -> None:
    """Keep the first row, which is the one that the header's time is of."""
    count = rows(message)
    for name, _, _, floating in _columns(message.DESCRIPTOR):
        column = getattr(message, name)
        if not column:
            continue
        keep = max(1, len(column) // count)
        if floating:
            kept = rounded(np.array(column[:keep]))
            del column[:]
            column.extend(kept.tolist())
        else:
            del column[keep:]


def rounded(values: np.ndarray) -> np.ndarray:
    """float64 (n,) to 24 bits; what is no number stays as it is."""
    bits = values.astype(np.float64).view(np.int64)
    short = ((bits + HALF) & MASK).view(np.float64)
    return np.where(np.isfinite(values) & np.isfinite(short), short, values)


def frame_of(topic: tp.Topic, name: str, payload: bytes) -> Frame | None:
    """A message as it stands in a frame; None for bytes that are none."""
    message = topic.type()
    try:
        message.ParseFromString(payload)
    except DecodeError:
        return None
    thin(message)
    header = message.header
    return Frame(name, header.run, header.sequence, header.utc_ns, message.SerializeToString())
