"""Arrays into the repeated double fields of a protobuf message, all at once.

A list for each field costs more than the filter that filled the arrays. In wire format such a field
is its tag, its length and the numbers as they stand in memory, so that bytes are put together and
parsed.
"""

import sys
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from inertial.rate.direct import Direct

Array = NDArray[np.float64]
Bytes = NDArray[np.uint8]

FIXED64, PACKED = 1, 2  # wire types: of eight bytes, of a field with a length


def varint(value: int) -> bytes:
    """A whole number >= 0 as protobuf writes it."""
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    out.append(value)
    return bytes(out)


class _Head(dict[int, bytes]):
    """Tag and length of one field, by the bytes that follow."""

    def __init__(self, number: int) -> None:
        super().__init__()
        self._tag = varint(number << 3 | PACKED)

    def __missing__(self, size: int) -> bytes:
        head = self[size] = self._tag + varint(size)
        return head


class Doubles:
    """Repeated double fields of one kind of message, filled from arrays of float64."""

    def __init__(self, kind: Any, *fields: str) -> None:
        """kind: the message class. Raises KeyError for a field it does not have, TypeError for one
        of another type.
        """
        self._heads = []
        for name in fields:
            field = kind.DESCRIPTOR.fields_by_name[name]
            if field.type != field.TYPE_DOUBLE or not field.is_packed:
                raise TypeError(f"{kind.DESCRIPTOR.name}.{name} is not a packed repeated double")
            self._heads.append(_Head(field.number))

    def wire(self, *arrays: Array) -> bytes:
        """Bytes that a message parses (MergeFromString), an array for each field, row-major; empty
        ones left out.
        """
        parts = []
        for head, array in zip(self._heads, arrays, strict=True):
            data = array.tobytes()
            if data:
                parts += (head[len(data)], data)
        return b"".join(parts)


class RowFields:
    """Double fields of one kind of message, copied from rows of float64 that hold them side by
    side.
    """

    def __init__(self, kind: Any, **columns: tuple[int, int]) -> None:
        """By field: its first column and how many it takes. Raises as Doubles does."""
        template, moves = bytearray(), []
        for name, (first, size) in columns.items():
            field = kind.DESCRIPTOR.fields_by_name[name]
            if field.type != field.TYPE_DOUBLE or field.is_repeated and not field.is_packed:
                raise TypeError(f"{kind.DESCRIPTOR.name}.{name} is not made of packed doubles")
            head = varint(field.number << 3 | (PACKED if field.is_repeated else FIXED64))
            template += head + varint(8 * size) if field.is_repeated else head
            moves.append((8 * first, len(template), 8 * size))
            template += bytes(8 * size)
        self.size = len(template)  # bytes of one row
        self._template, self._moves = np.frombuffer(bytes(template), np.uint8), np.array(moves)

    def wire(self, rows: Array) -> bytes:
        """Rows (n, columns) as n pieces of `size` bytes, each of which a message parses
        (MergeFromString).
        """
        out = np.empty((len(rows), self.size), np.uint8)
        _fill(rows.view(np.uint8), self._moves, self._template, out)
        return out.tobytes()


@njit(cache=True)
def _copy(rows: Bytes, moves: NDArray[np.int64], template: Bytes, out: Bytes) -> None:
    for r in range(len(rows)):
        out[r] = template
        for k in range(len(moves)):
            source, target, size = moves[k]
            for i in range(size):
                out[r, target + i] = rows[r, source + i]


_fill = Direct(_copy)

if sys.byteorder != "little":
    raise ImportError(
        "estimator.packed copies numbers as they stand in memory, which must be little-endian"
    )
