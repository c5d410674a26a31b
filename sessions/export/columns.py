"""Messages of one bus key as named columns: what exports and reports read.

Names are the fields' own, which carry their units; parts of vectors end in _x _y _z (quaternions _w
_x _y _z, NED vectors _n _e _d), axes of an accelerometer board in a11 ... a43. Every row begins
with `utc_s`, s since 1970, the time of its sample. Batches become one row per sample. What is
a map, a message or a list of messages becomes a column for each of its parts, as refused_late,
translation_x, axes_a11_state: no cell holds a structure.
"""

import json
import math
import re
from dataclasses import dataclass
from typing import Any

import numpy as np
from google.protobuf.descriptor import FieldDescriptor
from google.protobuf.message import Message
from numpy.typing import NDArray

from messages.contract.topics import ACCEL, Topic
from sessions.recording.samples import (
    BATCHES,
    HEADER,
    Samples,
    fields_of,
    has_header,
    is_number,
    is_whole,
    padded,
    text_of,
    widths,
)

TIME = "utc_s"
MOST_PARTS = 2000  # of one structure: a foreign recording cannot make columns without end


@dataclass(frozen=True)
class Column:
    """One column of a table."""

    name: str
    text: bool = False  # else a number
    whole: bool = False  # a number without decimals, also where others are missing


class Columns:
    """The columns of one key; `widen` must have seen every message before `table` is asked."""

    def __init__(self, topic: Topic, only: tuple[str, ...] | None = None) -> None:
        """only: names of the wanted fields, the header's among them; None for all."""
        self.topic, self.only = topic, only
        self._header = [n for n in HEADER if has_header(topic) and (only is None or n in only)]
        self._fields = [f for f in fields_of(topic) if only is None or f.name in only]
        self._widths: dict[str, int] = {}
        self._inside: dict[str, dict[str, bool]] = {  # field -> its parts: is it text?
            field.name: {} for field in self._fields if is_structure(field)
        }

    def widen(self, message: Message) -> None:
        """Learn how long the message's vectors are (per sample, in a batch)."""
        for name, width in widths(self.topic, message).items():
            if self.only is not None and name not in self.only:
                continue
            if width >= self._widths.get(name, 0):
                self._widths[name] = width
        for name, parts in self._inside.items():
            for part, value in flat(structure(message, name)).items():
                if len(parts) < MOST_PARTS:
                    parts[part] = parts.get(part, False) or isinstance(value, str)

    @property
    def names(self) -> list[Column]:
        """All columns, in the order of `table`."""
        columns = [Column(TIME)]
        columns += [Column(name, whole=name != "utc_sigma_s") for name in self._header]
        for field in self._fields:
            text, whole = not is_number(field), is_whole(field)
            if field.name in self._inside:
                parts = self._inside[field.name]
                columns += [
                    Column(f"{field.name}_{part}".rstrip("_"), parts[part]) for part in parts
                ]
            elif field.name in self._widths:
                parts = part_names(field.name, self._widths[field.name], self.topic)
                columns += [Column(name, text, whole) for name in parts]
            else:
                columns.append(Column(field.name, text, whole))
        return columns

    def table(self, found: Samples) -> dict[str, NDArray[Any]]:
        """Column name -> (n,) numbers or str. What a sample does not say is NaN."""
        cells: list[NDArray[Any]] = [found.utc_ns / 1e9 + found.after_s]
        cells += [found.header[name] for name in self._header]
        for field in self._fields:
            column = found.fields[field.name]
            if field.name in self._inside:
                cells += _parts(column, self._inside[field.name])
            elif field.name in self._widths:
                cells += list(padded(column, self._widths[field.name]).T)
            else:
                cells.append(column)
        return {column.name: cell for column, cell in zip(self.names, cells, strict=True)}


def is_structure(field: FieldDescriptor) -> bool:
    """Maps, messages and lists of either, or of text."""
    return not is_number(field) and (field.message_type is not None or field.is_repeated)


def structure(message: Message, name: str) -> Any:
    """What a field holds, as Python's own; None where it is empty."""
    text = text_of(message, message.DESCRIPTOR.fields_by_name[name])
    return json.loads(text) if text else None


def flat(value: Any, stem: str = "") -> dict[str, Any]:
    """The parts of a structure by their place in it: names and numbers joined by _; what has a
    name of its own stands under that.
    """
    if isinstance(value, dict):
        pairs = list(value.items())
    elif isinstance(value, list):
        named = [one.get("name") if isinstance(one, dict) else None for one in value]
        own = all(isinstance(name, str) and name for name in named) and len(set(named)) == len(
            named
        )
        pairs = list(zip(named, value, strict=True)) if own else list(enumerate(value))
    else:
        return {stem: value}
    parts: dict[str, Any] = {}
    for name, one in pairs:
        plainly = re.sub(r"[^A-Za-z0-9]+", "_", str(name)).strip("_")
        parts |= flat(one, f"{stem}_{plainly}" if stem else plainly)
    return parts


def _parts(column: NDArray[Any], parts: dict[str, bool]) -> list[NDArray[Any]]:
    """Columns (n,) of the parts of structures, which come as JSON."""
    rows = [flat(json.loads(cell)) if cell else {} for cell in column.tolist()]
    out: list[NDArray[Any]] = []
    for part, text in parts.items():
        if text:
            out.append(np.array([str(row.get(part, "")) for row in rows], dtype=object))
        else:
            out.append(np.array([_number(row.get(part)) for row in rows], dtype=np.float64))
    return out


def _number(value: Any) -> float:
    """NaN where nothing is said."""
    return math.nan if value is None else float(value)


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
