"""Shared by the tests of the wire: vectors as objects, strategies, and one way to print events for
Python and C.
"""

import struct
import tomllib
from functools import cache
from pathlib import Path

from hypothesis import strategies as st

from firmware_protocol.codec import REASONS, Deframer, Event, Frame
from firmware_protocol.frames import Payload, Unknown
from firmware_protocol.ledger import Ledger
from firmware_protocol.spec import FORMATS, SPEC, Field, Layout

ROOT = Path(__file__).resolve().parents[2]
VECTORS = ROOT / "firmware_protocol" / "vectors.toml"


@cache
def vectors() -> dict:
    return tomllib.loads(VECTORS.read_text(encoding="utf-8"))


def frozen(value: object) -> object:
    """TOML arrays as tuples."""
    return tuple(frozen(item) for item in value) if isinstance(value, list) else value


def payload_of(vector: dict) -> Payload:
    """The frame object that a [[frame]] vector describes."""
    layout = SPEC.layouts.get(vector["type"])
    values = dict(vector["fields"])
    if layout is None:
        return Unknown(vector["type"], bytes.fromhex(values["payload"]))
    for field in layout.fields:
        if field.struct_class:
            values[field.name] = tuple(field.struct_class(**item) for item in values[field.name])
        elif field.type == "u8" and field.length > 1:
            values[field.name] = bytes.fromhex(values[field.name])
    if layout.tail and layout.tail.raw:
        values[layout.tail.name] = bytes.fromhex(values[layout.tail.name])
    return layout.payload_class(**{name: frozen(value) for name, value in values.items()})


def stream_bytes(vector: dict) -> bytes:
    """The bytes of a [[stream]] vector: hex pieces, "xx * n" repeats."""
    wire = b""
    for piece in vector["wire"]:
        data, _, times = piece.partition("*")
        wire += bytes.fromhex(data) * int(times or 1)
    return wire


def printed(events: list[Event], pending: int) -> str:
    """Events as the C harness prints them."""
    lines = []
    for e in events:
        if isinstance(e, Frame):
            lines.append(
                f"F {e.type} {e.epoch} {e.flags} {e.seq} {e.t_us} {e.wire_size} {e.raw.hex()}"
            )
        else:
            lines.append(f"D {REASONS.index(e.reason) + 1} {e.wire_size}")
    return "".join(line + "\n" for line in [*lines, f"P {pending}"])


def receive(wire: bytes, read: int = 4096) -> tuple[Deframer, Ledger, list[Event]]:
    """A whole stream through a deframer and a ledger, `read` bytes at a time."""
    deframer, ledger, events = Deframer(), Ledger(), []
    for start in range(0, len(wire), read):
        data = wire[start : start + read]
        ledger.received(len(data))
        for event in deframer.feed(data):
            ledger.count(event)
            events.append(event)
    return deframer, ledger, events


LIMITS = {
    "u8": (0, 2**8 - 1),
    "u16": (0, 2**16 - 1),
    "i16": (-(2**15), 2**15 - 1),
    "u32": (0, 2**32 - 1),
    "i32": (-(2**31), 2**31 - 1),
    "u64": (0, 2**64 - 1),
}


def numbers(type_: str) -> st.SearchStrategy[int]:
    """Any value of a wire type, both ends included."""
    assert LIMITS.keys() == FORMATS.keys()
    return st.integers(*LIMITS[type_])


def _field_values(field: Field) -> st.SearchStrategy:
    if field.struct_class:
        inner = next(entry for entry in SPEC.raw["struct"] if entry["name"] == field.type)["field"]
        one = st.builds(field.struct_class, **{x["name"]: numbers(x["type"]) for x in inner})
        return st.tuples(*[one] * field.length)
    if field.type == "u8" and field.length > 1:
        return st.binary(min_size=field.length, max_size=field.length)
    if field.length > 1:
        return st.tuples(*[numbers(field.type)] * field.length)
    return numbers(field.type)


@st.composite
def payloads_of(draw: st.DrawFn, layout: Layout) -> Payload:
    """Any payload of one type, from empty to as full as the wire allows."""
    tail = layout.tail
    values = {
        f.name: draw(_field_values(f))
        for f in layout.fields
        if not f.name.startswith("reserved") and not (tail and f.name == tail.count)
    }
    if tail and tail.raw:
        values[tail.name] = draw(st.binary(max_size=SPEC.max_payload - layout.size))
    elif tail:
        columns = (
            tail.columns if isinstance(tail.columns, int) else values[tail.columns].bit_count()
        )
        width = columns * struct.calcsize(FORMATS[tail.type])
        rows = draw(st.integers(0, min(255, (SPEC.max_payload - layout.size) // max(width, 1))))
        row = tuple(draw(numbers(tail.type)) for _ in range(min(columns, 12)))
        values[tail.name] = (
            tuple(row[i % len(row)] for i in range(rows)) if tail.columns == 1 else (row,) * rows
        )
    return layout.payload_class(**values)


unknown_types = st.sampled_from([t for t in range(256) if t not in SPEC.layouts])
payloads = st.one_of(
    *[payloads_of(layout) for layout in SPEC.layouts.values()],
    st.builds(Unknown, unknown_types, st.binary(max_size=SPEC.max_payload)),
)
headers = st.fixed_dictionaries(
    {"epoch": numbers("u8"), "flags": numbers("u8"), "seq": numbers("u32"), "t_us": numbers("u64")}
)
