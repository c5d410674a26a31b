"""What a recording's messages say, sample by sample: the one place where its bytes become numbers.

`decode` makes a message of a payload, `samples` makes columns of the messages of one bus key, a row
per sample. Tables, curves, reports, the comparison of a replay and the replay itself all come
through here, so what an older version wrote is brought into the present form here and nowhere else.
"""

import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from google.protobuf.descriptor import FieldDescriptor
from google.protobuf.json_format import MessageToDict
from google.protobuf.message import DecodeError, Message
from numpy.typing import NDArray

from messages.contract import fixes, rates
from messages.contract.checks import check
from messages.contract.topics import ACCEL, ADC, GNSS, IMU, RATE, Topic

Column = NDArray[Any]

KINDS: dict[int, type] = {
    FieldDescriptor.CPPTYPE_DOUBLE: np.float64,
    FieldDescriptor.CPPTYPE_FLOAT: np.float64,
    FieldDescriptor.CPPTYPE_INT32: np.int64,
    FieldDescriptor.CPPTYPE_INT64: np.int64,
    FieldDescriptor.CPPTYPE_UINT32: np.int64,
    FieldDescriptor.CPPTYPE_UINT64: np.uint64,
    FieldDescriptor.CPPTYPE_BOOL: np.bool_,
    FieldDescriptor.CPPTYPE_ENUM: np.int64,
}
BATCHES: dict[str, tuple[str, ...]] = {  # topic -> its fields with one entry per sample and axis
    ACCEL.name: ("counts", "f_mps2"),
    IMU.name: ("f_b_mps2", "omega_ib_b_radps"),
    ADC.name: ("counts",),
    RATE.name: (*rates.ROWS, *rates.NUMBERS),
}
NUMBERS = {RATE.name: rates.NUMBERS}  # topic -> fields with one number per sample of a batch
HIDDEN = {RATE.name: rates.BETWEEN}  # topic -> fields that rows of their own do not need
HEADER = ("sequence", "run", "epoch", "device_us", "utc_sigma_s", "source", "late")
MANY = 1000  # messages that are made into columns at once


@dataclass(frozen=True)
class Samples:
    """Messages of one bus key, a row per sample."""

    utc_ns: NDArray[np.int64]  # (n,) time of the sample's message, ns since 1970
    after_s: NDArray[np.float64]  # (n,) of the sample itself after that, s
    log_ns: NDArray[np.int64]  # (n,) when its message was received, ns since 1970; 0: not told
    header: dict[str, Column]  # of HEADER: name -> (n,)
    fields: dict[str, Column]  # name -> (n,) numbers or str; vectors (n, width), NaN beyond an end
    lengths: dict[str, NDArray[np.int64]]  # vector's name -> (n,) how many numbers it has

    def __len__(self) -> int:
        return len(self.utc_ns)


def decode(topic: Topic, payload: bytes) -> Message:
    """A recorded message of this topic in its present form. Raises DecodeError for bytes that are
    none, and for one that the contract does not allow.
    """
    message = topic.type.FromString(payload)
    wrong = check(message)
    if wrong:
        raise DecodeError(str(wrong[0]))
    if topic is GNSS:
        return fixes.complete(message)
    return rates.complete(message) if topic is RATE else message


def has_header(topic: Topic) -> bool:
    """False for messages of others' types, which have a time but no Header."""
    return "header" in topic.type.DESCRIPTOR.fields_by_name


def fields_of(topic: Topic) -> list[FieldDescriptor]:
    """The fields that become columns: all but the header."""
    hidden = ("header", *HIDDEN.get(topic.name, ()))
    return [field for field in topic.type.DESCRIPTOR.fields if field.name not in hidden]


def is_number(field: FieldDescriptor) -> bool:
    """Numbers and their vectors; all else becomes text."""
    return field.cpp_type in KINDS


def is_vector(topic: Topic, field: FieldDescriptor) -> bool:
    """Does a row hold several numbers of the field side by side?"""
    return field.is_repeated and is_number(field) and field.name not in NUMBERS.get(topic.name, ())


def is_whole(field: FieldDescriptor) -> bool:
    """Whole numbers, enumerations and yes or no."""
    return is_number(field) and KINDS[field.cpp_type] is not np.float64


def samples_in(topic: Topic, message: Message) -> int:
    """How many rows a message makes."""
    if topic.name not in BATCHES:
        return 1
    if topic.name == RATE.name:
        return rates.count(message)
    if topic.name == IMU.name:
        return max(1, len(message.f_b_mps2) // 3)
    if topic.name == ADC.name:
        return max(1, len(message.counts) // max(1, message.channels))
    return max(1, len(message.counts or message.f_mps2) // max(1, message.axes))


def widths(topic: Topic, message: Message) -> dict[str, int]:
    """Numbers of each vector in one row of this message."""
    n, batch = samples_in(topic, message), BATCHES.get(topic.name, ())
    return {
        field.name: len(getattr(message, field.name)) // (n if field.name in batch else 1)
        for field in fields_of(topic)
        if is_vector(topic, field)
    }


def samples(
    topic: Topic,
    messages: Sequence[Message],
    log_ns: Sequence[int] | None = None,
    only: Iterable[str] | None = None,
) -> Samples:
    """Columns of messages of one key.

    log_ns: their receive times, which stand for the time of a message that says none; only: names
    of the wanted fields, the header's among them; None for all.
    """
    wanted = None if only is None else set(only)

    def takes(name: str) -> bool:
        return wanted is None or name in wanted

    n = np.array([samples_in(topic, message) for message in messages], dtype=np.int64)
    received = np.array(log_ns if log_ns is not None else [0] * len(messages), dtype=np.int64)
    headers = [message.header for message in messages] if has_header(topic) else []
    own = np.array([header.utc_ns for header in headers], dtype=np.int64) if headers else received
    fields: dict[str, Column] = {}
    lengths: dict[str, NDArray[np.int64]] = {}
    for field in fields_of(topic):
        if not takes(field.name):
            continue
        if is_vector(topic, field):
            fields[field.name], lengths[field.name] = _vectors(topic, field, messages, n)
        elif field.name in NUMBERS.get(topic.name, ()):
            fields[field.name] = _numbers(field, messages, n)
        else:
            fields[field.name] = np.repeat(_values(field, messages), n)
    found = Samples(
        np.repeat(np.where(own != 0, own, received), n),
        _after(topic, messages, n),
        np.repeat(received, n),
        {
            field.name: np.repeat(_values(field, headers), n)
            for field in (headers[0].DESCRIPTOR.fields if headers else ())
            if field.name in HEADER and takes(field.name)
        },
        fields,
        lengths,
    )
    return _single_estimates(found, messages, n) if topic is RATE else found


def _after(topic: Topic, messages: Sequence[Message], n: NDArray[np.int64]) -> NDArray[np.float64]:
    """Time of each sample after its message's, s."""
    if topic.name not in BATCHES:
        return np.zeros(len(messages))
    return np.concatenate(
        [np.arange(k) * message.period_s for k, message in zip(n, messages, strict=True)]
        or [np.zeros(0)]
    )


def _numbers(field: FieldDescriptor, messages: Sequence[Message], n: NDArray[np.int64]) -> Column:
    """A field with one number per sample; zeros where a message does not have as many."""
    column = np.zeros(int(n.sum()), dtype=KINDS[field.cpp_type])
    at = 0
    for message, rows in zip(messages, n.tolist(), strict=True):
        part = getattr(message, field.name)
        column[at : at + min(rows, len(part))] = part[:rows]
        at += rows
    return column


def _single_estimates(found: Samples, messages: Sequence[Message], n: NDArray[np.int64]) -> Samples:
    """Rows of batches of rate estimates as if each had been a message of its own."""
    fields, lengths, header = found.fields, found.lengths, found.header
    row = np.concatenate([np.arange(k) for k in n] or [np.zeros(0, dtype=np.int64)])
    if "for_index" in fields:
        step = np.repeat(np.array([m.index_step for m in messages], dtype=np.int64), n)
        fields["for_index"] = fields["for_index"] + (step * row).astype(np.uint64)
    if "device_us" in header:
        later = np.round(found.after_s * 1e6).astype(header["device_us"].dtype)
        header["device_us"] = header["device_us"] + later
    told = {"bound_sigma_radps": fields.get("bound_sigma_radps", np.zeros((len(row), 0))) > 0.0}
    dof = _numbers(RATE.type.DESCRIPTOR.fields_by_name["nis_dof"], messages, n)
    told |= dict.fromkeys(rates.ONLY_CORRECTED, dof[:, None] > 0)
    for name in told.keys() & fields.keys():
        known = told[name].any(axis=1)
        if not known.all():
            fields[name] = np.where(known[:, None], fields[name], np.nan)
            lengths[name] = np.where(known, lengths[name], 0)
    if "sight_reason" in fields:
        unseen = np.concatenate([_unseen(m, k) for m, k in zip(messages, n.tolist(), strict=True)])
        fields["sight_reason"] = np.where(unseen, fields["sight_reason"], "").astype(object)
    utc_ns = found.utc_ns + np.round(found.after_s * 1e9).astype(np.int64)
    return replace(found, utc_ns=utc_ns, after_s=np.zeros(len(row)))


def _unseen(message: Message, n: int) -> NDArray[np.bool_]:
    """Rows in which a component of the rate is not valid."""
    sight = np.asarray(message.sight, dtype=np.int64)
    return sight.reshape(n, -1).any(axis=1) if len(sight) else np.ones(n, dtype=bool)


def _values(field: FieldDescriptor, messages: Sequence[Message]) -> Column:
    """One value of each message."""
    if is_number(field):
        return np.array([getattr(m, field.name) for m in messages], dtype=KINDS[field.cpp_type])
    out = np.empty(len(messages), dtype=object)
    for k, message in enumerate(messages):
        value = getattr(message, field.name)
        out[k] = value if isinstance(value, str) else text_of(message, field)
    return out


def text_of(message: Message, field: FieldDescriptor) -> str:
    """A structure as JSON, its zeros spelt out; empty where it is not there."""
    if field.message_type is not None and not field.is_repeated:
        if not message.HasField(field.name):
            return ""
        return json.dumps(_plain(getattr(message, field.name)), sort_keys=True)
    whole = _plain(message)
    return json.dumps(whole[field.name], sort_keys=True) if field.name in whole else ""


def _plain(message: Message) -> Any:
    return MessageToDict(
        message, preserving_proto_field_name=True, always_print_fields_with_no_presence=True
    )


def _vectors(
    topic: Topic, field: FieldDescriptor, messages: Sequence[Message], n: NDArray[np.int64]
) -> tuple[Column, NDArray[np.int64]]:
    """A vector field, a row per sample, and how long it is in each."""
    batch, kind = field.name in BATCHES.get(topic.name, ()), KINDS[field.cpp_type]
    parts = [np.array(getattr(message, field.name), dtype=kind) for message in messages]
    rows = n if batch else np.ones_like(n)
    lengths = np.array([len(part) for part in parts], dtype=np.int64) // rows
    if len(set(lengths.tolist())) <= 1:
        width = int(lengths[0]) if len(lengths) else 0
        flat = [part[: k * width] for part, k in zip(parts, rows, strict=True)]
        table = np.concatenate(flat or [np.zeros(0)]).reshape(int(rows.sum()), width)
    else:
        width = int(lengths.max())
        table = np.full((int(rows.sum()), width), np.nan)
        at = 0
        for part, k, length in zip(parts, rows.tolist(), lengths.tolist(), strict=True):
            table[at : at + k, :length] = part[: k * length].reshape(k, length)
            at += k
    if batch:
        return table, np.repeat(lengths, n)
    return np.repeat(table, n, axis=0), np.repeat(lengths, n)


def padded(column: Column, width: int) -> Column:
    """A vector's column, NaN up to `width`; it stays as it is where nothing is missing."""
    missing = width - column.shape[1]
    if missing <= 0:
        return column
    return np.hstack([column.astype(np.float64), np.full((len(column), missing), np.nan)])


def joined(parts: Sequence[Samples]) -> Samples:
    """Samples of one key, one part after the other."""

    def vectors(name: str) -> Column:
        columns = [part.fields[name] for part in parts]
        width = max((column.shape[1] for column in columns if column.ndim == 2), default=0)
        return np.concatenate([padded(c, width) if c.ndim == 2 else c for c in columns])

    return Samples(
        np.concatenate([part.utc_ns for part in parts]),
        np.concatenate([part.after_s for part in parts]),
        np.concatenate([part.log_ns for part in parts]),
        {name: np.concatenate([part.header[name] for part in parts]) for name in parts[0].header},
        {name: vectors(name) for name in parts[0].fields},
        {name: np.concatenate([part.lengths[name] for part in parts]) for name in parts[0].lengths},
    )


class Gathering:
    """Messages of one key as they come, made into columns MANY at a time."""

    def __init__(
        self, topic: Topic, full: Callable[[Samples], None], only: Iterable[str] | None = None
    ) -> None:
        """full: is given the columns, some at a time and in order."""
        self._topic, self._full = topic, full
        self._only = None if only is None else tuple(only)
        self._messages: list[Message] = []
        self._log_ns: list[int] = []

    def add(self, message: Message, log_ns: int = 0) -> None:
        """One message more, with its receive time."""
        self._messages.append(message)
        self._log_ns.append(log_ns)
        if len(self._messages) >= MANY:
            self.flush()

    def flush(self) -> None:
        """Hand over what has come until now."""
        if self._messages:
            taken = samples(self._topic, self._messages, self._log_ns, self._only)
            self._messages, self._log_ns = [], []
            self._full(taken)
