"""Does a recording give the same estimates again? Its inputs go through the estimators' pipeline,
bit for bit compared.

The pipeline is given by the caller (estimator.pipeline.Pipeline in the product), so this room needs
no other service. Inputs go in as the recorder received them. One gateway's messages arrive
everywhere in the order it sent them, so the estimator saw the same order; between gateways the
order may differ, but no estimate depends on two devices.

Estimates are matched by key, run, for_sequence and for_index; header.sequence is left out, for it
counts what one process published and a replay begins at 1. What was recorded before the pipeline
had any state of its own (a recording begun while the estimator was running) differs honestly:
`Comparison.first_difference` and `equal_since` say where.
"""

import math
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from google.protobuf.message import DecodeError, Message
from numpy.typing import NDArray

from messages.contract.topics import (
    ACCEL,
    INNOVATION,
    NAV,
    PIPELINE_INPUTS,
    PIPELINE_ORDERS,
    RATE,
    Topic,
    parse,
)
from sessions.library.scan import scan
from sessions.recording.mcap_damage import Damage
from sessions.recording.mcap_log import read
from sessions.recording.samples import Gathering, Samples, decode, joined, padded

ESTIMATES: tuple[Topic, ...] = (RATE, NAV, INNOVATION)


class Pipeline(Protocol):
    """What estimates without a bus: a function of the messages given to it, in their order, and
    nothing else.
    """

    def on(self, topic: Topic, message: Message) -> Iterable[tuple[Topic, str, str, Message]]:
        """Take one input; what is to be published: topic, device, estimator, message. ValueError:
        not usable.
        """
        ...


@dataclass
class Comparison:
    """One key's estimates, recorded against computed again."""

    equal: int = 0
    different: int = 0
    missing: int = 0  # recorded, not computed again
    extra: int = 0  # computed again, not recorded: lost on the bus, or recorded before or after
    first_difference: str = ""  # for_sequence, for_index and the fields that differ
    equal_since: int | None = (
        None  # for_sequence from which on all recorded ones are equal; None when the last is not
    )

    @property
    def same(self) -> bool:
        """Every recorded estimate came out again, bit for bit (more of them may have)."""
        return self.equal > 0 and not self.different and not self.missing


@dataclass
class Report:
    """The result for a recording."""

    keys: dict[str, Comparison]
    inputs: int
    refused: int  # inputs the pipeline could not use, as it could not when they were live
    damage: str
    others: str = ""  # what other programs wrote into the file

    @property
    def identical(self) -> bool:
        """There were estimates and all of them came out again."""
        return bool(self.keys) and all(comparison.same for comparison in self.keys.values())

    def as_dict(self) -> dict:
        """For JSON."""
        return {"identical": self.identical, **asdict(self)}


def reproduce(path: Path, pipeline: Pipeline) -> Report:
    """Run a recording's inputs through `pipeline` and compare; raises OSError when the file cannot
    be opened.
    """
    recorded, computed = _Estimates(), _Estimates()
    damage = Damage()
    first = first_used(path)
    give_orders(path, pipeline)
    inputs = refused = 0
    for row in read(path, damage):
        try:
            address = parse(row.key)
            if address.topic not in ESTIMATES and address.topic not in PIPELINE_INPUTS:
                continue
            message = decode(address.topic, row.payload)
        except DecodeError:
            refused += 1
            damage.undecodable += 1
            continue
        if address.topic in ESTIMATES:
            recorded.add(row.key, address.topic, message)
            continue
        inputs += 1
        if address.topic is ACCEL and message.header.sequence < first.get(
            (address.device, message.header.run), 0
        ):
            continue  # the estimator was not there yet
        try:
            outputs = list(pipeline.on(address.topic, message))
        except ValueError:
            refused += 1
            continue
        for topic, device, estimator, estimate in outputs:
            if topic in ESTIMATES:
                computed.add(topic.key(address.prefix, device, estimator), topic, estimate)
    before, after = recorded.by_key(), computed.by_key()
    compared = {
        key: compare(before.get(key), after.get(key))
        for key in sorted(before.keys() | after.keys())
    }
    return Report(compared, inputs, refused, str(damage), damage.others)


class _Estimates:
    """Estimates as they come, as columns by bus key."""

    def __init__(self) -> None:
        self._parts: dict[str, list[Samples]] = defaultdict(list)
        self._gathering: dict[str, Gathering] = {}

    def add(self, key: str, topic: Topic, message: Message) -> None:
        """One message more."""
        if key not in self._gathering:
            self._gathering[key] = Gathering(topic, self._parts[key].append)
        self._gathering[key].add(message)

    def by_key(self) -> dict[str, Samples]:
        """All that has come."""
        for one in self._gathering.values():
            one.flush()
        return {key: joined(parts) for key, parts in self._parts.items()}


def give_orders(path: Path, pipeline: Pipeline) -> Pipeline:
    """Tell a new pipeline what people ordered while this recording was made; the pipeline itself.
    Raises OSError.
    """
    for block in scan(path, PIPELINE_ORDERS):
        topic = parse(block.key).topic
        for payload in block.payloads:
            try:
                pipeline.on(topic, topic.type.FromString(payload))
            except DecodeError:
                continue
    return pipeline


def first_used(path: Path, seconds: float = math.inf) -> dict[tuple[str, int], int]:
    """Sequence of the first accelerometer batch that has a recorded rate estimate, by device and
    gateway run; of the first `seconds` of the recording only. Raises OSError.
    """
    first: dict[tuple[str, int], int] = {}
    begin_ns = None
    for block in scan(path, (RATE,)):
        begin_ns = block.log_ns[0] if begin_ns is None else begin_ns
        if (block.log_ns[0] - begin_ns) / 1e9 > seconds:
            break
        device = parse(block.key).device
        for payload in block.payloads:
            try:
                message = decode(RATE, payload)
            except DecodeError:
                continue
            name = (device, message.header.run)
            first[name] = min(first.get(name, message.for_sequence), message.for_sequence)
    return first


def compare(recorded: Samples | None, computed: Samples | None) -> Comparison:
    """One key's estimates, sample by sample and bit for bit."""
    if recorded is None or computed is None:
        return Comparison(missing=len(recorded or ()), extra=len(computed or ()))
    before, after = _names(recorded), _names(computed)
    row_of = {name: row for row, name in enumerate(after)}
    rows = np.array([row_of.get(name, -1) for name in before], dtype=np.int64)
    there = np.flatnonzero(rows >= 0)
    fields = _differences(recorded, there, computed, rows[there])
    differs = np.any(list(fields.values()), axis=0)
    good = rows >= 0
    good[there] &= ~differs
    begin = int(np.flatnonzero(~good)[-1]) + 1 if not good.all() else 0
    result = Comparison(
        equal=int(good.sum()),
        different=int(differs.sum()),
        missing=int((rows < 0).sum()),
        extra=len(row_of.keys() - set(before)),
        equal_since=before[begin][1] if begin < len(before) else None,
    )
    if differs.any():
        k = int(np.flatnonzero(differs)[0])
        _, sequence, index, _ = before[there[k]]
        names = ", ".join(name for name, bad in fields.items() if bad[k])
        result.first_difference = f"for_sequence {sequence} for_index {index}: {names}"
    return result


def _names(found: Samples) -> list[tuple[int, int, int, int]]:
    """What each estimate is for: run, for_sequence, for_index; several for the same are told apart
    by their order.
    """
    n = len(found)
    index = found.fields.get("for_index", np.zeros(n, dtype=np.int64))
    seen: dict[tuple[int, int, int], int] = defaultdict(int)
    names = []
    for one in zip(
        found.header["run"].tolist(),
        found.fields["for_sequence"].tolist(),
        index.tolist(),
        strict=True,
    ):
        names.append((*one, seen[one]))
        seen[one] += 1
    return names


Rows = NDArray[np.int64]
Flags = NDArray[np.bool_]


def _differences(a: Samples, rows_a: Rows, b: Samples, rows_b: Rows) -> dict[str, Flags]:
    """By field: in which of these pairs of rows it differs; what a process counted is left out."""
    header = [_unlike(a.utc_ns[rows_a], b.utc_ns[rows_b])]
    for name, column in a.header.items():
        if name != "sequence":
            header.append(_unlike(column[rows_a], b.header[name][rows_b]))
    found = {"header": np.any(header, axis=0)}
    for name, column in a.fields.items():
        found[name] = _unlike(column[rows_a], b.fields[name][rows_b])
        if name in a.lengths:
            found[name] |= a.lengths[name][rows_a] != b.lengths[name][rows_b]
    return found


def _unlike(a: NDArray[Any], b: NDArray[Any]) -> Flags:
    """Rows that differ in a bit, so that NaN equals itself."""
    if a.dtype == object:
        return np.asarray(a != b, dtype=bool)
    if a.ndim == 2:
        width = max(a.shape[1], b.shape[1])
        a, b = padded(a, width), padded(b, width)
    if a.dtype != b.dtype:
        a, b = a.astype(np.float64), b.astype(np.float64)
    if not a.size:
        return np.zeros(len(a), dtype=bool)
    bits = [np.ascontiguousarray(c).view(np.uint8).reshape(len(c), -1) for c in (a, b)]
    return np.any(bits[0] != bits[1], axis=1)
