"""Is a message what the contract says? The rules stand beside the fields, in gyrofree.proto.

`check` gives the list of what is wrong, an empty one for a message that may be used. It has two
ways. `_compiled` writes, from the rules, one expression per type that is true for an ordinary
message and costs a microsecond; only where that is false are the fields looked at one by one, to
name what was found and what was wanted. A test holds the two together.
"""

import math
from collections.abc import Callable, Iterator
from functools import cache
from typing import Any, NamedTuple

from google.protobuf.descriptor import Descriptor, FieldDescriptor
from google.protobuf.message import Message

from messages.contract import gyrofree_pb2 as pb
from messages.contract.names import NAME

MESSAGE_BYTES = 1_000_000  # of one message: a record of a journal holds no more than 1 MiB
ROWS = 1024  # samples of one batch, so that the work for one message is bounded
TEXT = 4000  # characters of a text without a rule
BYTES = 1_000_000  # of a field of bytes without a rule
ITEMS = 4096  # of a list without a rule
ENTRIES = 8192  # of a map
NAMES = 1000  # sound ones that are remembered
KINDS = (  # what a refusal can be counted as
    "bytes",  # no message of the type
    "size",
    "key",
    "name",
    "device",  # it speaks in the name of another than its key
    "range",
    "number",  # no finite one
    "length",
    "value",  # not one of those that there are
    "many",  # more devices or streams than there is room for
    "time",  # far from that of all others
    "answer",  # of a publisher: not what was asked for
    "stale",  # of a publisher whose place another has taken
    "claim",  # of a publisher that has claimed no such number, or nothing
    "twin",  # of another publisher of the name, for a time that one was heard
    "repeated",  # it has come before, byte for byte
    "failure",  # we could not take it: a fault of ours
)
FLOATS = (FieldDescriptor.CPPTYPE_DOUBLE, FieldDescriptor.CPPTYPE_FLOAT)
NATURAL = (FieldDescriptor.CPPTYPE_UINT32, FieldDescriptor.CPPTYPE_UINT64)
FOREIGN = {  # rules of fields of types that are not ours: lowest, highest, NaN is not known
    "foxglove.LocationFix.latitude": pb.Rule(min=-90, max=90),
    "foxglove.LocationFix.longitude": pb.Rule(min=-360, max=360),
    "foxglove.LocationFix.altitude": pb.Rule(min=-1e6, max=1e6, none=True),
}


class Refusal(NamedTuple):
    """One thing that is wrong with a message."""

    kind: str  # one of KINDS
    field: str  # "header.utc_ns"
    found: str
    wanted: str

    def __str__(self) -> str:
        return f"{self.field} is {self.found}, want {self.wanted}"


def check(message: Message) -> list[Refusal]:
    """What the contract does not allow in a message; empty: it may be used."""
    quick = _quick.get(type(message))
    if quick is None:
        quick = _quick[type(message)] = _compiled(message.DESCRIPTOR)
    if quick(message):
        return []
    return list(_explain(message, ""))


# --- what the rules of a field come to


class _Limits(NamedTuple):
    low: float | None  # of a number; None: any that fits its type
    high: float | None
    open: bool  # a number may be none, or infinite
    most: int  # of a list, a text
    row: int
    columns: str
    name: bool
    none: bool  # NaN is one of its values: not known


@cache
def _limits(field: FieldDescriptor) -> _Limits:
    rule = FOREIGN.get(field.full_name) or field.GetOptions().Extensions[pb.rule]
    low = rule.min if rule.HasField("min") else None
    high = rule.max if rule.HasField("max") else None
    if low is None and high is not None:
        low = -high if field.is_repeated else 0.0
    whole_type = field.containing_type.GetOptions().Extensions[pb.open]
    if rule.row or rule.columns:
        usual = ROWS * max(1, rule.row)
    elif field.is_repeated:
        usual = ENTRIES if _is_map(field) else ITEMS
    else:
        usual = BYTES if field.type == FieldDescriptor.TYPE_BYTES else TEXT
    return _Limits(
        low,
        high,
        low is None and high is None and whole_type,
        rule.most or usual,
        rule.row,
        rule.columns,
        rule.name,
        rule.none,
    )


def _is_map(field: FieldDescriptor) -> bool:
    return field.message_type is not None and field.message_type.GetOptions().map_entry


# --- the quick way

_quick: dict[type, Callable[[Any], bool]] = {}
_names: set[str] = {""}


@cache
def _compiled(type_: Descriptor) -> Callable[[Any], bool]:
    """Quick test of a type: true for sound messages; false may still be sound."""
    given: dict[str, Any] = {"hypot": math.hypot, "fits": _fits, "seen": _names, "inf": math.inf}
    parts = [part for field in type_.fields for part in _tests(field, given)]
    source = f"lambda m: {' and '.join(parts) or 'True'}"
    return eval(source, given)  # the names in it are fields of our own contract


def _tests(field: FieldDescriptor, given: dict[str, Any]) -> Iterator[str]:
    at, limits, inner = f"m.{field.name}", _limits(field), f"_{field.name}"
    if _is_map(field):
        given[inner] = _entries_are_sound
        yield f"(not {at} or {inner}({at}))"
    elif field.is_repeated:
        yield f"(not (n := len(v := {at})) or {_list_test(field, limits, inner, given)})"
    elif field.message_type is not None:
        given[inner] = _compiled(field.message_type)
        yield f"(not m.HasField({field.name!r}) or {inner}({at}))"
    elif field.cpp_type == FieldDescriptor.CPPTYPE_STRING:
        if limits.name:
            yield f"((v := {at}) in seen or fits(v))"
        else:
            yield f"len({at}) <= {limits.most}"
    elif field.cpp_type == FieldDescriptor.CPPTYPE_ENUM:
        given[inner] = frozenset(field.enum_type.values_by_number)
        yield f"{at} in {inner}"
    elif limits.high is not None or limits.low is not None:
        yield _bounded(at, field, limits)
    elif field.cpp_type in FLOATS and not limits.open:
        yield f"-inf < {at} < inf"


def _bounded(at: str, field: FieldDescriptor, limits: _Limits) -> str:
    """A number between its limits; where the type has none below zero that is not asked for."""
    number = float if field.cpp_type in FLOATS else int
    natural = limits.low == 0.0 and field.cpp_type in NATURAL
    low = "" if limits.low is None or natural else f"{number(limits.low)!r} <= "
    high = "" if limits.high is None else f" <= {number(limits.high)!r}"
    test = f"{low}{at}{high}"
    return f"({test} or {at} != {at})" if limits.none else test


def _list_test(field: FieldDescriptor, limits: _Limits, inner: str, given: dict[str, Any]) -> str:
    """Of the list v of n entries, which is not empty."""
    if limits.columns:
        test = f"0 < (w := m.{limits.columns}) and n <= {ROWS} * w and not n % w"
    elif limits.row > 1:
        test = f"n <= {limits.most} and not n % {limits.row}"
    else:
        test = f"n <= {limits.most}"
    if field.message_type is not None:
        given[inner] = _compiled(field.message_type)
        test += f" and all(map({inner}, v))"
    elif field.cpp_type == FieldDescriptor.CPPTYPE_STRING:
        test += f" and max(map(len, v)) <= {TEXT}"
    elif field.cpp_type == FieldDescriptor.CPPTYPE_ENUM:
        given[inner] = frozenset(field.enum_type.values_by_number)
        test += f" and {inner}.issuperset(v[:])"
    elif limits.high is not None and limits.low is not None:
        # no entry is larger than the root of the sum of their squares, and that is one call
        test += f" and hypot(*v[:]) <= {min(limits.high, -limits.low)!r}"
    elif field.cpp_type in FLOATS and not limits.open:
        test += " and hypot(*v[:]) < inf"
    return test


def _fits(name: str) -> bool:
    """A sound name; those of this system are soon known, and a foreign flood is not remembered."""
    sound = not name or NAME.fullmatch(name) is not None
    if sound and len(_names) < NAMES:
        _names.add(name)
    return sound


def _entries_are_sound(entries: Any) -> bool:
    return len(entries) <= ENTRIES and max(map(len, entries)) <= TEXT


# --- the long way, for a person


def _explain(message: Message, before: str) -> Iterator[Refusal]:
    for field in message.DESCRIPTOR.fields:
        where, value = before + field.name, getattr(message, field.name)
        limits = _limits(field)
        if _is_map(field):
            if len(value) > ENTRIES:
                yield Refusal("length", where, f"{len(value)} long", f"at most {ENTRIES}")
            yield from (
                Refusal("length", where, f"a key of {len(key)} characters", f"at most {TEXT}")
                for key in value
                if len(key) > TEXT
            )
        elif field.is_repeated:
            yield from _explain_list(message, field, limits, where, value)
        elif field.message_type is not None:
            if message.HasField(field.name):
                yield from _explain(value, where + ".")
        else:
            yield from _explain_value(field, limits, where, value)


def _explain_list(
    message: Message, field: FieldDescriptor, limits: _Limits, where: str, value: Any
) -> Iterator[Refusal]:
    n, row, most = len(value), limits.row, limits.most
    if limits.columns and n:
        row = getattr(message, limits.columns)
        most = ROWS * row
        if row < 1:
            yield Refusal("length", where, f"{n} numbers in rows of 0", f"{limits.columns} above 0")
            return
    if n > most:
        yield Refusal("length", where, f"{n} long", f"at most {most}")
        return
    if row > 1 and n % row:
        yield Refusal("length", where, f"{n} long", f"whole rows of {row}")
    for k, item in enumerate(value):
        at = f"{where}[{k}]"
        if field.message_type is not None:
            found = list(_explain(item, at + "."))
        else:
            found = list(_explain_value(field, limits._replace(most=TEXT), at, item))
        if found:
            yield from found
            return  # one is enough: a list has many


def _explain_value(
    field: FieldDescriptor, limits: _Limits, where: str, value: Any
) -> Iterator[Refusal]:
    if field.cpp_type == FieldDescriptor.CPPTYPE_STRING:
        if limits.name and value and not NAME.fullmatch(value):
            yield Refusal("name", where, repr(value[:80]), f"a name like {NAME.pattern}")
        elif not limits.name and len(value) > limits.most:
            yield Refusal("length", where, f"{len(value)} long", f"at most {limits.most}")
    elif field.cpp_type == FieldDescriptor.CPPTYPE_ENUM:
        if value not in field.enum_type.values_by_number:
            yield Refusal("value", where, str(value), f"one of {field.enum_type.name}")
    elif limits.none and math.isnan(value):
        return
    elif field.cpp_type in FLOATS and not limits.open and not math.isfinite(value):
        yield Refusal("number", where, str(value), "a finite number")
    else:
        low, high = limits.low, limits.high
        if (low is not None and value < low) or (high is not None and value > high):
            text = f"{'' if low is None else f'{low:g}'} to {'' if high is None else f'{high:g}'}"
            yield Refusal("range", where, str(value), text)
