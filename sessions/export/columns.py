"""Messages of one bus key as rows of named columns: what exports and reports read.

Names are the fields' own, which carry their units; parts of vectors end in _x _y _z (quaternions _w
_x _y _z, NED vectors _n _e _d), axes of an accelerometer board in a11 ... a43. Every row begins
with `utc_s`, s since 1970, the time of its sample. Batches become one row per sample. What is text,
a map or a list of messages becomes a text column.
"""

import json
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from google.protobuf.descriptor import FieldDescriptor
from google.protobuf.json_format import MessageToDict
from google.protobuf.message import Message

from messages.contract.topics import ACCEL, ADC, IMU, Topic

NUMBERS = {
    FieldDescriptor.CPPTYPE_DOUBLE,
    FieldDescriptor.CPPTYPE_FLOAT,
    FieldDescriptor.CPPTYPE_INT32,
    FieldDescriptor.CPPTYPE_INT64,
    FieldDescriptor.CPPTYPE_UINT32,
    FieldDescriptor.CPPTYPE_UINT64,
    FieldDescriptor.CPPTYPE_BOOL,
    FieldDescriptor.CPPTYPE_ENUM,
}
BATCHES: dict[str, tuple[str, ...]] = {  # topic -> its fields with one entry per sample and axis
    ACCEL.name: ("counts", "f_mps2"),
    IMU.name: ("f_b_mps2", "omega_ib_b_radps"),
    ADC.name: ("counts",),
}
HEADER = ("sequence", "run", "epoch", "device_us", "utc_sigma_s", "source", "late")
TIME = "utc_s"

Value = float | int | str


@dataclass(frozen=True)
class Column:
    """One column of a table."""

    name: str
    text: bool = False  # else a number


class Columns:
    """The columns of one key; `widen` must have seen every message before `rows` is asked."""

    def __init__(self, topic: Topic) -> None:
        self.topic = topic
        self._batch = BATCHES.get(topic.name, ())
        descriptor = topic.type.DESCRIPTOR
        self._has_header = "header" in descriptor.fields_by_name
        self._fields = [field for field in descriptor.fields if field.name != "header"]
        self._widths = {f.name: 0 for f in self._fields if _is_vector(f)}
        self._takers: list[Callable[[Message], list[Value]]] = []

    def widen(self, message: Message) -> None:
        """Learn how long the message's vectors are (per sample, in a batch)."""
        n = self._samples(message)
        for name, width in self._widths.items():
            found = len(getattr(message, name))
            width_here = found // n if name in self._batch else found
            if width_here > width:
                self._widths[name] = width_here

    @property
    def names(self) -> list[Column]:
        """All columns, in the order of `rows`."""
        columns = [Column(TIME)]
        if self._has_header:
            columns += [Column(name) for name in HEADER]
        for field in self._fields:
            if field.name in self._widths:
                columns += [
                    Column(name)
                    for name in part_names(field.name, self._widths[field.name], self.topic)
                ]
            else:
                columns.append(Column(field.name, text=not _is_number(field)))
        return columns

    def rows(self, message: Message, log_ns: int) -> Iterator[list[Value]]:
        """One row, or one per sample of a batch. Absent numbers are NaN; log_ns stands for a
        missing header.
        """
        n = self._samples(message)
        header = message.header if self._has_header else None
        start = (header.utc_ns if header is not None and header.utc_ns else log_ns) / 1e9
        head: list[Value] = [getattr(header, name) for name in HEADER] if header is not None else []
        period = getattr(message, "period_s", 0.0) if self._batch else 0.0
        parts = [self._part(message, field, n) for field in self._fields]
        for k in range(n):
            row = [start + k * period, *head]
            for part in parts:
                row += part[k] if part else ()
            yield row

    def _part(self, message: Message, field: FieldDescriptor, n: int) -> list[list[Value]]:
        """The field's cells of every sample."""
        value = getattr(message, field.name)
        if field.name not in self._widths:
            return [
                [value if _is_number(field) or isinstance(value, str) else _text(message, field)]
            ] * n
        width = self._widths[field.name]
        flat = list(value)
        if field.name in self._batch:
            return [_padded(flat[k * width : (k + 1) * width], width) for k in range(n)]
        return [_padded(flat, width)] * n

    def _samples(self, message: Message) -> int:
        if not self._batch:
            return 1
        if self.topic.name == IMU.name:
            return max(1, len(message.f_b_mps2) // 3)
        columns = message.axes if self.topic.name == ACCEL.name else message.channels
        return max(1, len(message.counts or message.f_mps2) // max(1, columns))


def _padded(values: list[Value], width: int) -> list[Value]:
    return values + [math.nan] * (width - len(values))


def _is_vector(field: FieldDescriptor) -> bool:
    return field.is_repeated and _is_number(field)


def _is_number(field: FieldDescriptor) -> bool:
    return field.cpp_type in NUMBERS


def _text(message: Message, field: FieldDescriptor) -> str:
    whole: dict[str, Any] = MessageToDict(message, preserving_proto_field_name=True)
    return json.dumps(whole[field.name], sort_keys=True) if field.name in whole else ""


def part_names(name: str, width: int, topic: Topic) -> list[str]:
    """Column names of a vector's parts."""
    if topic.name == ACCEL.name and width % 3 == 0 and name in BATCHES[ACCEL.name]:
        unit = name.removeprefix(
            "f_"
        )  # a11_counts, a11_mps2: as in the logs that `gyrofree play` reads
        return [f"a{k // 3 + 1}{k % 3 + 1}_{unit}" for k in range(width)]
    if width == 1:
        return [name]
    letters = {
        3: "ned" if "_ned" in name or "_n_" in name else "xyz",
        4: "wxyz" if name.startswith("q") else "",
    }
    ends = letters.get(width) or [str(k) for k in range(width)]
    return [f"{name}_{end}" for end in ends]
