"""Messages of one bus key as named columns: what exports and reports read.

Names are the fields' own, which carry their units; parts of vectors end in _x _y _z (quaternions _w
_x _y _z, NED vectors _n _e _d), axes of an accelerometer board in a11 ... a43. Every row begins
with `utc_s`, s since 1970, the time of its sample. Batches become one row per sample. What is text,
a map or a list of messages becomes a text column.
"""

from dataclasses import dataclass
from typing import Any

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
    widths,
)

TIME = "utc_s"


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

    def widen(self, message: Message) -> None:
        """Learn how long the message's vectors are (per sample, in a batch)."""
        for name, width in widths(self.topic, message).items():
            if self.only is not None and name not in self.only:
                continue
            if width >= self._widths.get(name, 0):
                self._widths[name] = width

    @property
    def names(self) -> list[Column]:
        """All columns, in the order of `table`."""
        columns = [Column(TIME)]
        columns += [Column(name, whole=name != "utc_sigma_s") for name in self._header]
        for field in self._fields:
            text, whole = not is_number(field), is_whole(field)
            if field.name in self._widths:
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
            if field.name in self._widths:
                cells += list(padded(column, self._widths[field.name]).T)
            else:
                cells.append(column)
        return {column.name: cell for column, cell in zip(self.names, cells, strict=True)}


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
