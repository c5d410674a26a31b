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

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Protocol

from google.protobuf.message import DecodeError, Message

from messages.contract.topics import (
    ACCEL,
    INNOVATION,
    NAV,
    PIPELINE_INPUTS,
    PIPELINE_ORDERS,
    RATE,
    Topic,
    TopicError,
    parse,
)
from sessions.library.scan import scan
from sessions.recording.mcap_log import Damage, read

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
    recorded: dict[str, dict[tuple, bytes]] = defaultdict(dict)
    computed: dict[str, dict[tuple, bytes]] = defaultdict(dict)
    damage = Damage()
    first = _first_used(path)
    give_orders(path, pipeline)
    inputs = refused = 0
    for row in read(path, damage):
        try:
            address = parse(row.key)
            if address.topic not in ESTIMATES and address.topic not in PIPELINE_INPUTS:
                continue
            message = address.topic.type.FromString(row.payload)
        except (TopicError, DecodeError):
            refused += 1
            continue
        if address.topic in ESTIMATES:
            _keep(recorded[row.key], message)
            continue
        inputs += 1
        if address.topic is ACCEL and message.header.sequence < first.get(
            (row.key, message.header.run), 0
        ):
            continue  # the estimator was not there yet
        try:
            outputs = list(pipeline.on(address.topic, message))
        except ValueError:
            refused += 1
            continue
        for topic, device, estimator, estimate in outputs:
            if topic in ESTIMATES:
                _keep(computed[topic.key(address.prefix, device, estimator)], estimate)
    keys = sorted(recorded.keys() | computed.keys())
    compared = {key: _compare(parse(key).topic, recorded[key], computed[key]) for key in keys}
    return Report(compared, inputs, refused, str(damage))


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


def _first_used(path: Path) -> dict[tuple[str, int], int]:
    """Sequence of the first accelerometer batch that has a recorded rate estimate, by input key and
    gateway run.
    """
    first: dict[tuple[str, int], int] = {}
    for row in read(path, Damage()):
        try:
            address = parse(row.key)
            if address.topic is not RATE:
                continue
            message = RATE.type.FromString(row.payload)
        except (TopicError, DecodeError):
            continue
        name = (ACCEL.key(address.prefix, address.device), message.header.run)
        first[name] = min(first.get(name, message.for_sequence), message.for_sequence)
    return first


def _keep(table: dict[tuple, bytes], message: Message) -> None:
    """File an estimate under what it is for; several for the same are told apart by their order."""
    copy = type(message)()
    copy.CopyFrom(message)
    copy.header.ClearField("sequence")
    index = copy.for_index if "for_index" in copy.DESCRIPTOR.fields_by_name else 0
    name = (copy.header.run, copy.for_sequence, index)
    n = 0
    while (*name, n) in table:
        n += 1
    table[(*name, n)] = copy.SerializeToString(deterministic=True)


def _compare(
    topic: Topic, recorded: dict[tuple, bytes], computed: dict[tuple, bytes]
) -> Comparison:
    result = Comparison(extra=sum(name not in recorded for name in computed))
    for name, payload in recorded.items():
        again = computed.get(name)
        if again == payload:
            result.equal += 1
            result.equal_since = name[1] if result.equal_since is None else result.equal_since
            continue
        result.equal_since = None
        if again is None:
            result.missing += 1
        else:
            result.different += 1
            if not result.first_difference:
                fields = ", ".join(differing_fields(topic, payload, again))
                result.first_difference = f"for_sequence {name[1]} for_index {name[2]}: {fields}"
    return result


def differing_fields(topic: Topic, a: bytes, b: bytes) -> list[str]:
    """Names of the fields in which two messages of a topic differ."""
    one, two = topic.type.FromString(a), topic.type.FromString(b)
    return [field.name for field in one.DESCRIPTOR.fields if not _equal(one, two, field.name)]


def _equal(one: Message, two: Message, name: str) -> bool:
    """Compare one field as bytes, so that NaN equals itself."""
    parts = []
    for message in (one, two):
        part = type(message)()
        part.CopyFrom(message)
        for field, _ in message.ListFields():
            if field.name != name:
                part.ClearField(field.name)
        parts.append(part.SerializeToString(deterministic=True))
    return parts[0] == parts[1]
