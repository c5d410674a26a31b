"""The number that a limit is on: a channel of the charts, an expression of such, or any numeric
field of a topic. What is not known (blind, stale, not said) is NaN, or a sentence that says why.
"""

import re
from dataclasses import dataclass, field

import numpy as np
from google.protobuf.descriptor import FieldDescriptor
from google.protobuf.message import Message
from numpy.typing import NDArray

from dashboard.data.channels import NAMED, Channel, between, sight_of
from dashboard.data.device import SLOW_STALE_S, STALE_S, Device
from logs.figures.expression import Expression, evaluate, known_names, read
from logs.figures.names import slug
from logs.figures.quantity import ExpressionError, Quantity
from logs.figures.sight import vouched
from logs.figures.units import spelt, unit
from messages.contract import gyrofree_pb2 as pb
from messages.contract import rates
from messages.contract.topics import BY_NAME, RATE
from messages.text import plain

Array = NDArray[np.float64]

# topic[.estimator].field[entry]; a dot between digits belongs to a number of an expression
PATH = re.compile(r"([a-z]+)(?:\.([a-z][a-z0-9_-]*))?\.([a-z][a-z0-9_]*)(?:\[([\w-]{1,64})\])?")
WORDS = {FieldDescriptor.CPPTYPE_STRING, FieldDescriptor.CPPTYPE_MESSAGE}
SPARSE = ("nis",)  # columns that have a value at a correction only
BEFORE_S = 2.0  # of samples that are known already, to lie between


@dataclass(frozen=True)
class Path:
    """A field of a message, by its name in the contract."""

    topic: str
    estimator: str  # empty: the leading one
    name: str
    entry: str  # of a list or a map; empty: it is neither


@dataclass(frozen=True)
class Sampled:
    """Samples after the last ones: t (n,) s on the device's axis, y (n,), NaN where not known.
    `why`: nothing is known now, and this is the reason.
    """

    t: Array = field(default_factory=lambda: np.zeros(0))
    y: Array = field(default_factory=lambda: np.zeros(0))
    unit: str = ""
    gap_s: float = STALE_S
    why: str = ""


def parsed(text: str) -> Path | Expression:
    """What a limit's `field` names. Raises ExpressionError with a sentence."""
    text = text.strip()
    match = PATH.fullmatch(text)
    if match is None or match[1] not in BY_NAME:
        if match is not None:
            known = ", ".join(BY_NAME)
            raise ExpressionError(f"There is no topic {match[1]}; there are {known}.")
        return read(text)
    topic, estimator, name, entry = match[1], match[2] or "", match[3], match[4] or ""
    if estimator and not BY_NAME[topic].per_estimator:
        raise ExpressionError(f"{topic} is not of an estimator: want {topic}.{name}.")
    if topic in NAMED and not entry and _is_channel(topic, name):
        before = slug(estimator) or NAMED[topic][0]
        return read(f"{before}_{name}" if before else name)
    declared = BY_NAME[topic].type.DESCRIPTOR.fields_by_name.get(name)
    if declared is None:
        raise ExpressionError(_no_field(topic, name))
    _check_numeric(topic, declared, entry)
    return Path(topic, estimator, name, entry)


def _is_channel(topic: str, name: str) -> bool:
    """Whether the charts call a component of a topic so."""
    return any(
        name in {word + part for part in parts or ("",)} for _, word, parts in NAMED[topic][1]
    )


def _no_field(topic: str, name: str) -> str:
    fields = BY_NAME[topic].type.DESCRIPTOR.fields
    numeric = [one.name for one in fields if one.cpp_type not in WORDS or _is_map(one)]
    return f"{topic} has no field {name}; it has {', '.join(numeric)}."


def _is_map(declared: FieldDescriptor) -> bool:
    inner = declared.message_type
    return inner is not None and inner.GetOptions().map_entry


def _check_numeric(topic: str, declared: FieldDescriptor, entry: str) -> None:
    name = f"{topic}.{declared.name}"
    if declared.cpp_type in WORDS and not _is_map(declared):
        raise ExpressionError(f"{name} is no number.")
    rows = topic == RATE.name and not _has_several(declared.name)
    if (declared.is_repeated and not rows) != bool(entry):
        if entry:
            raise ExpressionError(f"{name} is one number: without [{entry}].")
        raise ExpressionError(f"{name} has several numbers: say which, as {name}[0].")
    if entry and not _is_map(declared) and not entry.isdecimal():
        raise ExpressionError(f"{name} is counted from 0: want {name}[0] or another number.")


def _has_several(name: str) -> bool:
    """Whether a field of a rate holds several numbers in one row of a batch."""
    declared = pb.RateEstimate.DESCRIPTOR.fields_by_name.get(name)
    return declared is not None and declared.is_repeated


def sampled(
    device: Device, what: Path | Expression, after: float, now: float, named: dict[str, Channel]
) -> Sampled:
    """Samples of a device after a time, s on its axis. Call under the store's lock. now:
    time.monotonic(), s.
    """
    if isinstance(what, Path):
        return _of_message(device, what, after, now)
    try:
        return _of_channels(device, what, after, now, named)
    except ExpressionError as error:
        return Sampled(why=str(error))


def _of_message(device: Device, path: Path, after: float, now: float) -> Sampled:
    names = device.estimators(path.topic)
    estimator = path.estimator or (names[0] if names else "")
    heard = device.get(path.topic, estimator)
    if heard is None:
        return Sampled(why=f"nothing has been said on {path.topic} yet")
    if device.stale(path.topic, estimator, now):
        return Sampled(why=f"{path.topic} has been silent for {heard.age(now):.0f} s")
    try:
        value = _value(heard.message, path)
    except (IndexError, ValueError):
        return Sampled(why=f"{path.topic} has no {path.name}[{path.entry}] now")
    gap_s = SLOW_STALE_S.get(path.topic, STALE_S)
    t = np.array([heard.t if heard.t else heard.arrived])
    return Sampled(t[t > after], np.array([value])[t > after], "", gap_s)


def _value(message: Message, path: Path) -> float:
    """Raises IndexError for an entry that is not there."""
    if path.topic == RATE.name:
        message = rates.row(message, -1)
    declared = message.DESCRIPTOR.fields_by_name[path.name]
    value = getattr(message, path.name)
    if not path.entry:
        return float(value)
    if _is_map(declared):
        return float(value[path.entry]) if path.entry in value else np.nan
    return float(value[int(path.entry)])


def _of_channels(
    device: Device, what: Expression, after: float, now: float, named: dict[str, Channel]
) -> Sampled:
    """As dashboard.data.channels.derived, but up to what all sources have said, and nothing where
    the filter does not see.
    """
    known_names(what, {*named, "t"})
    used = {name: named[name] for name in what.names if name != "t"}
    if not used:
        return Sampled(why=f"{plain(what.text)} names no channel")
    sources = sorted({(one.topic, one.estimator) for one in used.values()})
    for topic, estimator in sources:
        if device.stale(topic, estimator, now):
            who = f"{topic} of {estimator}" if estimator else topic
            return Sampled(why=f"{who} is not fresh")
    newest = {source: float(device.rings[source].rows()["t"][-1]) for source in sources}
    end = min(newest.values())  # beyond it one of them has said nothing yet
    tables = {s: device.window(*s, after - BEFORE_S, newest[s]) for s in sources}
    t = min((table[0] for table in tables.values()), key=len)
    known = {"t": Quantity(t, unit("s"))}
    for name, one in used.items():
        own, rows = tables[one.topic, one.estimator]
        seen = vouched(one.of(rows), sight_of(one, rows))
        known[name] = Quantity(between(t, own, seen), unit(one.unit))
    found = evaluate(what, known)
    y = np.broadcast_to(np.asarray(found.values, dtype=float), np.shape(t))
    keep = (t > after) & (t <= end)
    if all(one.column in SPARSE for one in used.values()):
        keep &= np.isfinite(y)
    gap_s = max(SLOW_STALE_S.get(topic, STALE_S) for topic, _ in sources)
    return Sampled(np.array(t[keep]), np.array(y[keep]), spelt(found.unit), gap_s)
