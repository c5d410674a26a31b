"""What recordings hold, sample by sample: for whoever accounts for them after a fault."""

from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from messages.contract import rates
from messages.contract.topics import ACCEL, RATE, Address, parse
from sessions.recording.mcap_log import read


class Batch(NamedTuple):
    """Samples that came in one message."""

    first: int  # index
    count: int
    utc_ns: int  # of the first
    period_s: float


class Hole(NamedTuple):
    """Samples that are not there."""

    at_ns: int  # UTC of the first
    seconds: float


def has_number(address: Address) -> bool:
    """Does its publisher count it, so that it may stand in a recording once only?"""
    fields = address.topic.type.DESCRIPTOR.fields_by_name
    return "header" in fields and address.topic.source != "simulator"


@dataclass
class Recorded:
    """Of one recording or several that follow one another; `read` adds one."""

    wanted: Callable[[Address], bool] = has_number  # which messages are looked at
    rows: dict[str, int] = field(default_factory=dict)  # by the file's folder: all its messages
    twice: int = 0  # messages
    batches: dict[int, list[Batch]] = field(default_factory=lambda: defaultdict(list))  # by boot
    samples: dict[int, set[int]] = field(default_factory=lambda: defaultdict(set))  # likewise
    estimates: dict[tuple[str, int], set[int]] = field(
        default_factory=lambda: defaultdict(set)
    )  # by key and boot
    _seen: set[tuple] = field(default_factory=set)

    def read(self, path: Path) -> None:
        """A recording; raises what reading it does."""
        self.rows[path.parent.name] = 0
        for row in read(path):
            self.rows[path.parent.name] += 1
            address = parse(row.key)
            if self.wanted(address):
                self._take(row.key, address, address.topic.type.FromString(row.payload))

    def _take(self, key: str, address: Address, message) -> None:
        header = message.header
        self.twice += (key, header.run, header.sequence) in self._seen
        self._seen.add((key, header.run, header.sequence))
        if address.topic is ACCEL:
            first, count = message.first_index, len(message.counts) // message.axes
            batch = Batch(first, count, header.utc_ns, message.period_s)
            self.batches[header.epoch].append(batch)
            self.samples[header.epoch].update(range(first, first + count))
        elif address.topic is RATE:
            first, count = message.for_index, rates.count(message)
            self.estimates[key, header.epoch].update(range(first, first + count))

    @property
    def missing(self) -> int:
        """Samples between the first and the last of each boot."""
        return sum(max(have) - min(have) + 1 - len(have) for have in self.samples.values())

    def holes(self) -> Iterator[Hole]:
        """In the order of each boot."""
        for batches in self.batches.values():
            ordered = sorted(batches)
            for batch, following in zip(ordered, ordered[1:], strict=False):
                end = batch.first + batch.count
                if following.first > end:
                    at_ns = batch.utc_ns + round(batch.count * batch.period_s * 1e9)
                    yield Hole(at_ns, (following.first - end) * batch.period_s)

    def unestimated(self, to_the_end: bool) -> int:
        """Samples without an estimate, from each estimator's first one on: to its last, or to the
        last sample.
        """
        lacking = 0
        for (_, boot), have in self.estimates.items():
            last = max(self.samples[boot], default=0) if to_the_end else max(have)
            lacking += len({i for i in self.samples[boot] if min(have) <= i <= last} - have)
        return lacking
