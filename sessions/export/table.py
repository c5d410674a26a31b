"""A recording as tables of numbers, one per bus key: read once for the widths, once for the
rows.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from google.protobuf.message import DecodeError, Message
from numpy.typing import NDArray

from messages.contract.topics import Topic, parse
from sessions.export.columns import TIME, Column, Columns
from sessions.recording.mcap_damage import Damage
from sessions.recording.mcap_log import Recorded, say
from sessions.recording.samples import Gathering, decode
from sessions.recording.timeline import straight

Progress = Callable[[float, str], None]  # share done 0 to 1, what is being done
Files = Path | tuple[Path, ...]  # one recording, also where it goes on from file to file, in order


def silent(done: float, what: str) -> None:
    """No progress shown."""


@dataclass(frozen=True)
class Selection:
    """What of a recording is wanted."""

    topics: frozenset[str] = frozenset()  # names; empty: all
    start_s: float = 0.0  # from the first message's receive time, s
    end_s: float = float("inf")
    fields: Mapping[str, tuple[str, ...]] = field(default_factory=dict)  # by topic; absent: all

    def takes(self, topic: Topic) -> bool:
        """Is this topic wanted?"""
        return not self.topics or topic.name in self.topics


@dataclass
class Survey:
    """What a recording holds."""

    columns: dict[str, Columns] = field(default_factory=dict)  # bus key -> its columns
    counts: dict[str, int] = field(default_factory=dict)  # bus key -> messages
    first_ns: int = 0  # receive time of the first message, ns since 1970
    last_ns: int = 0
    damage: Damage = field(default_factory=Damage)


def files(path: Files) -> tuple[Path, ...]:
    """The files of a recording, in order."""
    return (path,) if isinstance(path, Path) else path


def messages(
    path: Files, selection: Selection, damage: Damage | None = None
) -> Iterator[tuple[Recorded, Topic, Message | None]]:
    """Selected messages in the order of recording, decoded; None for one that cannot be. What
    cannot be read is counted in `damage`, or logged where none is given. Raises OSError.
    """
    start, found = None, Damage() if damage is None else damage
    for row in straight(files(path), found):
        start = row.log_ns if start is None else start
        if not selection.start_s <= (row.log_ns - start) / 1e9 <= selection.end_s:
            continue
        topic = parse(row.key).topic
        if selection.takes(topic):
            try:
                yield row, topic, decode(topic, row.payload)
            except DecodeError:
                found.undecodable += 1
                yield row, topic, None
    if damage is None:
        say(files(path)[-1], found)


def survey(
    path: Files,
    selection: Selection = Selection(),
    progress: Progress = silent,
    damage: Damage | None = None,
) -> Survey:
    """First reading: keys, counts, times, widths. What is damaged is logged. Raises OSError."""
    found = Survey(damage=Damage() if damage is None else damage)
    size = max(1, sum(one.stat().st_size for one in files(path)))
    seen = 0
    for row, topic, message in messages(path, selection, found.damage):
        found.first_ns = found.first_ns or row.log_ns
        found.last_ns = max(found.last_ns, row.log_ns)
        seen += len(row.payload) + 40
        if sum(found.counts.values()) % 5000 == 0:
            progress(
                min(0.99, seen / (4 * size)), "looking through"
            )  # payloads shrink to about a quarter
        if message is None:
            continue
        if row.key not in found.columns:
            found.columns[row.key] = Columns(topic, selection.fields.get(topic.name))
        found.columns[row.key].widen(message)
        found.counts[row.key] = found.counts.get(row.key, 0) + 1
    say(files(path)[-1], found.damage)
    progress(1.0, "looked through")
    return found


Block = dict[str, NDArray[Any]]  # column name -> (n,) numbers or str


def blocks(
    path: Files, found: Survey, selection: Selection = Selection(), progress: Progress = silent
) -> Iterator[tuple[str, Block]]:
    """Second reading: (bus key, some rows of it), the rows of a key in the order of recording.

    Raises OSError.
    """
    total, done = max(1, sum(found.counts.values())), 0
    ready: list[tuple[str, Block]] = []
    gathering = {
        key: Gathering(
            columns.topic,
            lambda taken, key=key, columns=columns: ready.append((key, columns.table(taken))),
            columns.only,
        )
        for key, columns in found.columns.items()
    }
    for row, _, message in messages(path, selection):
        if message is None or row.key not in gathering:
            continue
        gathering[row.key].add(message, row.log_ns)
        yield from ready
        ready.clear()
        done += 1
        if done % 2000 == 0:
            progress(done / total, "writing")
    for one in gathering.values():
        one.flush()
    yield from ready
    progress(1.0, "written")


@dataclass(frozen=True)
class Table:
    """All rows of one key, as arrays."""

    columns: list[Column]
    data: dict[str, NDArray]  # column name -> (n,) float64, or str

    def __len__(self) -> int:
        return len(self.data[TIME])

    def vector(self, *names: str) -> NDArray[np.float64]:
        """Columns side by side, (n, len(names)). Raises KeyError for a column that is not there."""
        return np.column_stack([self.data[name] for name in names])


def tables(
    path: Files,
    selection: Selection = Selection(),
    progress: Progress = silent,
    damage: Damage | None = None,
) -> dict[str, Table]:
    """A whole recording in memory: bus key -> table. What cannot be read is counted in `damage`.
    Raises OSError.
    """
    found = survey(path, selection, lambda done, what: progress(done * 0.4, what), damage)
    parts: dict[str, list[Block]] = {key: [] for key in found.columns}
    for key, block in blocks(
        path, found, selection, lambda done, what: progress(0.4 + done * 0.6, "reading")
    ):
        parts[key].append(block)
    return {key: _table(columns.names, parts[key]) for key, columns in found.columns.items()}


def _table(columns: list[Column], parts: list[Block]) -> Table:
    data = {}
    for column in columns:  # a recording is long: no column is kept twice
        whole = np.concatenate([part.pop(column.name) for part in parts])
        data[column.name] = whole.astype(str if column.text else np.float64, copy=False)
    return Table(columns, data)
