"""What is made from spec.toml: docs/protocol.md and core/gf_spec.h.

    python -m firmware_protocol.document            the page, to stdout
    python -m firmware_protocol.document header     the C constants, to stdout

A test says when one of the two files in the repository is behind the spec.
"""

import struct
import sys
from collections.abc import Iterator

from firmware_protocol.spec import FORMATS, SPEC, Field, Layout


def page() -> str:
    """docs/protocol.md."""
    return "\n".join(_page_lines()) + "\n"


def header() -> str:
    """core/gf_spec.h."""
    return "\n".join(_header_lines()) + "\n"


def _table(head: tuple[str, ...], rows: Iterator[tuple]) -> list[str]:
    lines = [head, ("---",) * len(head), *rows]
    return [
        "| " + " | ".join(str(cell).replace("|", "\\|") for cell in line) + " |" for line in lines
    ] + [""]


def _page_lines() -> Iterator[str]:
    protocol = SPEC.raw["protocol"]
    yield "# The wire between board and gateway"
    yield ""
    yield (
        "Made from firmware_protocol/spec.toml by `python -m firmware_protocol.document >"
        " docs/protocol.md`."
    )
    yield ""
    yield f"    00  COBS( header {_size(SPEC.header)} | payload 0..{SPEC.max_payload} | crc32 )  00"
    yield ""
    yield (
        f"Little-endian, natural alignment, at most {SPEC.max_wire} bytes with both delimiters."
        f" {protocol['crc']}: {protocol['crc_text'][0].lower()}{protocol['crc_text'][1:]}. Minor"
        f" version described here: {SPEC.minor}."
    )
    yield ""
    yield protocol["minor_text"]
    yield ""
    yield "## Header"
    yield ""
    yield from _fields(SPEC.header)
    yield from _table(
        ("bit of flags", "name", "meaning"),
        ((entry["bit"], entry["name"], entry["text"]) for entry in SPEC.raw["flag"]),
    )
    yield "## Frames"
    yield ""
    yield from _table(
        ("type", "name", "since minor", "bytes", "purpose"),
        ((f"0x{x.type:02x}", x.name, x.since, _bytes(x), x.text) for x in SPEC.layouts.values()),
    )
    for layout in SPEC.layouts.values():
        yield from _layout(layout)
    for entry in SPEC.raw["struct"]:
        yield f"### {entry['name']} (inside other frames)"
        yield ""
        yield from _table(
            ("type", "field", "unit", "meaning"),
            ((x["type"], x["name"], x.get("unit", ""), x["text"]) for x in entry["field"]),
        )
    yield "## Boards"
    yield ""
    yield from _table(
        ("board_id", "board"), ((entry["id"], entry["text"]) for entry in SPEC.raw["board"])
    )
    yield from _commands()
    yield from _proofs()


def _commands() -> Iterator[str]:
    raw = SPEC.raw
    yield "## Commands"
    yield ""
    yield "CMD with no arguments, unless the text says otherwise:"
    yield ""
    yield from _table(
        ("command", "name", "meaning"),
        ((f"0x{x['id']:04x}", x["name"], x["text"]) for x in raw["command"]),
    )
    yield (
        "Settings: no arguments to ask, one u32 to set; the ACK echoes the u32 in force. They live"
        " until the next"
    )
    yield "boot."
    yield ""
    settings = (
        (f"0x{x['id']:04x}", x["name"], x.get("unit", ""), x["default"], x["text"])
        for x in raw["setting"]
    )
    yield from _table(("command", "name", "unit", "default", "meaning"), settings)
    yield from _table(
        ("status of ACK", "name", "meaning"),
        ((x["id"], x["name"], x["text"]) for x in raw["result"]),
    )


def _proofs() -> Iterator[str]:
    yield "## Damage"
    yield ""
    yield (
        "Bytes that are no frame become one event with one of these words, in the order of the"
        " checks:"
    )
    yield ""
    yield from _table(
        ("reason", "meaning"), ((entry["word"], entry["text"]) for entry in SPEC.raw["reason"])
    )
    yield "What a receiver can prove, and `ledger.py` counts:"
    yield ""
    yield "1. Bytes in = bytes of good frames + bytes of bad chunks + bytes pending."
    yield "2. Lost frames = the sum of the gaps in seq. Bad chunks are not losses."
    yield "3. No frame is accepted that differs from what was sent."
    yield (
        "4. Lost minus the device's own `dropped` = lost on the link. Gaps in first_index = lost"
        " samples."
    )
    yield "5. Any cutting of the stream into reads gives the same events."
    yield ""
    yield (
        "Not provable: loss before the first frame, loss behind the last frame (STATUS bounds it to"
        " 1 s), damage"
    )
    yield "before the CRC was made."


def _layout(layout: Layout) -> Iterator[str]:
    yield f"### 0x{layout.type:02x} {layout.name}"
    yield ""
    yield layout.text
    yield ""
    yield from _fields(layout.fields, layout)


def _fields(fields: tuple[Field, ...], layout: Layout | None = None) -> list[str]:
    rows, offset = [], 0
    for field in fields:
        rows.append((offset, field.wire_type, field.name, field.unit, field.text))
        offset += field.size
    tail = layout and layout.tail
    if tail:
        shape = "bytes" if tail.raw else f"{tail.count} x {tail.columns} x {tail.type}"
        rows.append((offset, shape.replace(" x 1 x", " x"), tail.name, tail.unit, tail.text))
    return _table(("offset", "type", "field", "unit", "meaning"), iter(rows))


def _bytes(layout: Layout) -> str:
    tail = layout.tail
    if tail is None:
        return str(layout.size)
    if tail.raw:
        return f"{layout.size} +"
    width = struct.calcsize(FORMATS[tail.type])
    row = f"{width * tail.columns}" if isinstance(tail.columns, int) else f"{width} per channel"
    return f"{layout.size} + {tail.count} x {row}"


def _size(fields: tuple[Field, ...]) -> int:
    return sum(field.size for field in fields)


def _header_lines() -> Iterator[str]:
    yield "#ifndef GF_SPEC_H"
    yield "#define GF_SPEC_H"
    yield ""
    yield "/* Made from spec.toml by: python -m firmware_protocol.document header.  Do not edit. */"
    yield ""
    yield "enum {"
    yield f"  GF_PROTO = 0x{SPEC.proto:02X},"
    yield f"  GF_MINOR = {SPEC.minor},"
    yield f"  GF_HEADER_SIZE = {_size(SPEC.header)},"
    yield f"  GF_MAX_PAYLOAD = {SPEC.max_payload},"
    yield f"  GF_MAX_WIRE = {SPEC.max_wire},"
    yield "  GF_MAX_BODY = GF_MAX_WIRE - 2 /* bytes between two delimiters */"
    yield "};"
    yield ""
    yield from _enum(f"GF_TYPE_{x.name} = 0x{x.type:02X}" for x in SPEC.layouts.values())
    yield from _enum(f"GF_FLAG_{name.upper()} = {bit}" for name, bit in SPEC.flags.items())
    yield from _enum(
        (f"GF_REASON_{word.upper()} = {i}" for i, word in enumerate(SPEC.reasons, 1)), "gf_reason_t"
    )
    raw = SPEC.raw
    yield from _enum(f"GF_DO_{x['name'].upper()} = 0x{x['id']:04X}" for x in raw["command"])
    yield from _enum(f"GF_SET_{x['name'].upper()} = 0x{x['id']:04X}" for x in raw["setting"])
    yield from _enum(f"GF_DEFAULT_{x['name'].upper()} = {x['default']}" for x in raw["setting"])
    yield from _enum(
        (f"GF_RESULT_{x['name'].upper()} = {x['id']}" for x in raw["result"]), "gf_result_t"
    )
    yield (
        "/* Offsets in bytes; GF_..._SIZE is the smallest payload and where the rows or raw bytes"
        " begin. */"
    )
    yield from _enum(_offsets("HEADER", SPEC.header))
    for layout in SPEC.layouts.values():
        yield from _enum(
            [*_offsets(layout.name, layout.fields), f"GF_{layout.name}_SIZE = {layout.size}"]
        )
    yield from _rules()
    yield ""
    yield "#endif"


def _enum(items: Iterator[str] | list[str], name: str = "") -> list[str]:
    lines = ",\n".join(f"  {item}" for item in items).splitlines()
    return ["typedef enum {" if name else "enum {", *lines, f"}} {name};" if name else "};", ""]


def _offsets(prefix: str, fields: tuple[Field, ...]) -> list[str]:
    items, offset = [], 0
    for field in fields:
        if not field.name.startswith("reserved"):
            items.append(f"GF_{prefix}_{field.name.upper()} = {offset}")
        offset += field.size
    return items


def _rules() -> Iterator[str]:
    yield (
        "/* What a payload must hold: GF_FIXED(type, size), GF_ROWS(type, size, offset of the row"
        " count,"
    )
    yield (
        " * bytes per row), GF_MASKED(type, size, offset of the row count, bytes per value, offset"
        " of the mask)."
    )
    yield " * A type without a line demands nothing. */"
    lines = ["#define GF_LENGTH_RULES"]
    for layout in SPEC.layouts.values():
        name, tail = layout.name, layout.tail
        if layout.size == 0:  # GPS: any number of bytes is whole
            continue
        if tail is None or tail.raw:
            lines.append(f"  GF_FIXED(GF_TYPE_{name}, GF_{name}_SIZE)")
            continue
        width, count = struct.calcsize(FORMATS[tail.type]), f"GF_{name}_{tail.count.upper()}"
        if isinstance(tail.columns, int):
            lines.append(
                f"  GF_ROWS(GF_TYPE_{name}, GF_{name}_SIZE, {count}, {width * tail.columns}u)"
            )
        else:
            mask = f"GF_{name}_{tail.columns.upper()}"
            lines.append(f"  GF_MASKED(GF_TYPE_{name}, GF_{name}_SIZE, {count}, {width}u, {mask})")
    yield from (line + " \\" for line in lines[:-1])
    yield lines[-1]


if __name__ == "__main__":
    sys.stdout.write(header() if sys.argv[1:] == ["header"] else page())
