"""spec.toml as objects: struct formats, sizes and checks, all derived from the one authority."""

import re
import struct
import tomllib
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate
from pathlib import Path
from typing import Any

from firmware_protocol import frames

SPEC_PATH = Path(__file__).with_name("spec.toml")
FORMATS = {"u8": "B", "u16": "H", "i16": "h", "u32": "I", "i32": "i", "u64": "Q"}


class SpecError(ValueError):
    """spec.toml contradicts itself or the frame classes."""


@dataclass(frozen=True)
class Field:
    """One field: `length` values of `type`; u8[k] is one byte string."""

    name: str
    type: str
    length: int
    unit: str
    text: str
    struct_class: type | None = None
    struct_names: tuple[str, ...] = ()
    struct_format: str = ""

    @property
    def format(self) -> str:
        if self.struct_class is not None:
            return self.struct_format * self.length
        if self.type == "u8" and self.length > 1:
            return f"{self.length}s"
        return FORMATS[self.type] * self.length

    @property
    def size(self) -> int:
        """Bytes on the wire."""
        return struct.calcsize("<" + self.format)

    @property
    def wire_type(self) -> str:
        return self.type if self.length == 1 else f"{self.type}[{self.length}]"

    def take(self, flat: tuple) -> tuple[Any, tuple]:
        """This field's value off the front of unpacked values, and the rest."""
        if self.struct_class is not None:
            width = len(self.struct_names)
            rows = [flat[i * width : (i + 1) * width] for i in range(self.length)]
            return tuple(self.struct_class(*row) for row in rows), flat[width * self.length :]
        if self.length == 1 or self.type == "u8":
            return flat[0], flat[1:]
        return flat[: self.length], flat[self.length :]

    def flatten(self, value: Any) -> list:
        """The reverse of `take`; raises ValueError when the number of values is wrong."""
        if self.length == 1 or (self.type == "u8" and self.struct_class is None):
            return [value]
        if len(value) != self.length:
            raise ValueError(f"{self.name} has {len(value)} values, the wire carries {self.length}")
        if self.struct_class is None:
            return list(value)
        return [getattr(item, name) for item in value for name in self.struct_names]


@dataclass(frozen=True)
class Tail:
    """What follows the fixed fields: `count` rows of `columns` values, or raw bytes."""

    name: str
    type: str
    count: str
    columns: int | str
    unit: str
    text: str

    @property
    def raw(self) -> bool:
        return self.type == "bytes"


@dataclass(frozen=True)
class Layout:
    """One frame type."""

    type: int
    name: str
    payload_class: type
    since: int
    text: str
    fields: tuple[Field, ...]
    tail: Tail | None

    @cached_property
    def fixed(self) -> struct.Struct:
        return struct.Struct("<" + "".join(field.format for field in self.fields))

    @cached_property
    def size(self) -> int:
        """Smallest payload, bytes."""
        return self.fixed.size

    @cached_property
    def offsets(self) -> dict[str, int]:
        """Bytes before each field."""
        ends = [0, *accumulate(field.size for field in self.fields)]
        return {field.name: end for field, end in zip(self.fields, ends, strict=False)}

    @cached_property
    def flat_names(self) -> tuple[str, ...] | None:
        """Field names when each of them is one value of `fixed`, else None."""
        if any(
            field.struct_class or (field.length > 1 and field.type != "u8") for field in self.fields
        ):
            return None
        return tuple(field.name for field in self.fields)

    @cached_property
    def reserved(self) -> tuple[str, ...]:
        """Fields that carry nothing yet."""
        return tuple(field.name for field in self.fields if field.name.startswith("reserved"))

    def columns(self, payload: bytes) -> int:
        """Values per row of the tail."""
        columns = self.tail.columns
        return columns if isinstance(columns, int) else payload[self.offsets[columns]].bit_count()


@dataclass(frozen=True)
class Spec:
    """The whole of spec.toml."""

    proto: int
    minor: int
    max_payload: int
    max_wire: int
    header: tuple[Field, ...]
    flags: dict[str, int]
    reasons: tuple[str, ...]
    layouts: dict[int, Layout]
    raw: dict


def _field(entry: dict, structs: dict[str, dict]) -> Field:
    match = re.fullmatch(r"(\w+?)(?:\[(\d+)\])?", entry["type"])
    if not match or (match[1] not in FORMATS and match[1] not in structs):
        raise SpecError(
            f"spec.toml: field {entry['name']} has type {entry['type']!r}; known: "
            f"{', '.join([*FORMATS, *structs])}, with [k] for several"
        )
    extra = {}
    if match[1] in structs:
        inner = [_field(field, {}) for field in structs[match[1]]["field"]]
        extra = {
            "struct_class": getattr(frames, structs[match[1]]["class"]),
            "struct_names": tuple(field.name for field in inner),
            "struct_format": "".join(field.format for field in inner),
        }
    return Field(
        entry["name"], match[1], int(match[2] or 1), entry.get("unit", ""), entry["text"], **extra
    )


def _layout(entry: dict, structs: dict[str, dict]) -> Layout:
    tail = entry.get("tail")
    made = tail and Tail(
        tail["name"],
        tail["type"],
        tail.get("count", ""),
        tail.get("columns", 1),
        tail.get("unit", ""),
        tail["text"],
    )
    layout = Layout(
        entry["type"],
        entry["name"],
        getattr(frames, entry["class"]),
        entry["since"],
        entry["text"],
        tuple(_field(field, structs) for field in entry.get("field", ())),
        made,
    )
    wanted = frames.field_names(layout.payload_class)
    derived = {made.count} if made else set()
    found = tuple(
        f.name for f in layout.fields if not f.name.startswith("reserved") and f.name not in derived
    )
    found += (made.name,) if made else ()
    if found != wanted or layout.type != layout.payload_class.TYPE:
        raise SpecError(
            f"spec.toml: {layout.name} (0x{layout.type:02x}) has {found}, frames.py has {wanted}: "
            f"make both the same"
        )
    return layout


def load(path: Path = SPEC_PATH) -> Spec:
    """Read the spec.  Raises SpecError when it contradicts frames.py."""
    raw = tomllib.loads(path.read_text(encoding="utf-8"))
    structs = {entry["name"]: entry for entry in raw["struct"]}
    layouts = [_layout(entry, structs) for entry in raw["frame"]]
    protocol = raw["protocol"]
    return Spec(
        protocol["proto"],
        protocol["minor"],
        protocol["max_payload"],
        protocol["max_wire"],
        tuple(_field(entry, {}) for entry in raw["header"]),
        {entry["name"]: 1 << entry["bit"] for entry in raw["flag"]},
        tuple(entry["word"] for entry in raw["reason"]),
        {layout.type: layout for layout in layouts},
        raw,
    )


SPEC = load()
