"""Arrays into the repeated double fields of a protobuf message, all at once.

A list for each field costs more than the filter that filled the arrays. In wire format such a field is its tag, its
length and the numbers as they stand in memory, so that bytes are put together and parsed.
"""

import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

PACKED = 2  # wire type of a field with a length


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
        """kind: the message class. Raises KeyError for a field it does not have, TypeError for one of another type."""
        self._heads = []
        for name in fields:
            field = kind.DESCRIPTOR.fields_by_name[name]
            if field.type != field.TYPE_DOUBLE or not field.is_packed:
                raise TypeError(f"{kind.DESCRIPTOR.name}.{name} is not a packed repeated double")
            self._heads.append(_Head(field.number))

    def wire(self, *arrays: Array) -> bytes:
        """Bytes that a message parses (MergeFromString), an array for each field, row-major; empty ones left out."""
        parts = []
        for head, array in zip(self._heads, arrays, strict=True):
            data = array.tobytes()
            if data:
                parts += (head[len(data)], data)
        return b"".join(parts)


if sys.byteorder != "little":
    raise ImportError("estimator.packed copies numbers as they stand in memory, which must be little-endian")
