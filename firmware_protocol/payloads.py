"""Payload bytes <-> frame objects, driven by spec.toml.  No header, no CRC, no framing."""

import struct
from collections.abc import Callable
from itertools import chain

from firmware_protocol.frames import Payload, Unknown
from firmware_protocol.spec import FORMATS, SPEC, Layout


class FrameError(ValueError):
    """A frame that cannot be put on the wire; a mistake of the caller, never of the line."""


def shortage(type_: int, payload: bytes) -> str:
    """Why a payload is too short for its type, or "" when it is whole or the type is unknown.

    Longer payloads are whole: minor versions append.
    """
    layout = SPEC.layouts.get(type_)
    if layout is None:
        return ""
    need = layout.size
    if len(payload) >= need and layout.tail and not layout.tail.raw:
        rows = payload[layout.offsets[layout.tail.count]]
        need += rows * layout.columns(payload) * struct.calcsize(FORMATS[layout.tail.type])
    return "" if len(payload) >= need else f"{layout.name} wants {need} bytes, got {len(payload)}"


def unpack(type_: int, payload: bytes) -> Payload:
    """The frame object of a payload that `shortage` found whole; Unknown for unknown types."""
    layout = SPEC.layouts.get(type_)
    if layout is None:
        return Unknown(type_, payload)
    flat: tuple = layout.fixed.unpack_from(payload)
    if layout.flat_names:
        values = dict(zip(layout.flat_names, flat, strict=True))
    else:
        values = {}
        for field in layout.fields:
            values[field.name], flat = field.take(flat)
    for name in layout.reserved:
        del values[name]
    tail = layout.tail
    if tail and tail.raw:
        values[tail.name] = payload[layout.size :]
    elif tail:
        values[tail.name] = _rows(layout, payload, values.pop(tail.count))
    return layout.payload_class(**values)


def _rows(layout: Layout, payload: bytes, count: int) -> tuple:
    columns, code = layout.columns(payload), FORMATS[layout.tail.type]
    if layout.tail.columns == 1:
        return struct.unpack_from(f"<{count}{code}", payload, layout.size)
    if columns == 0:
        return ((),) * count
    form = f"<{columns}{code}"
    return tuple(
        struct.iter_unpack(form, payload[layout.size : layout.size + count * struct.calcsize(form)])
    )


def pack(payload: Payload) -> bytes:
    """Payload bytes of a frame object.  Raises FrameError when a value does not fit its field."""
    if isinstance(payload, Unknown):
        data = bytes(payload.payload)
    else:
        data = _pack_known(SPEC.layouts[payload.TYPE], payload)
    if len(data) > SPEC.max_payload:
        raise FrameError(
            f"{type(payload).__name__} payload has {len(data)} bytes, the wire carries "
            f"{SPEC.max_payload}: put fewer samples into a frame"
        )
    return data


def _pack_known(layout: Layout, payload: Payload) -> bytes:
    tail = layout.tail
    data = getattr(payload, tail.name) if tail else b""

    def value(name: str) -> object:
        if tail and name == tail.count:
            return len(data)
        return 0 if name.startswith("reserved") else getattr(payload, name)

    try:
        flat = [item for field in layout.fields for item in field.flatten(value(field.name))]
        head = layout.fixed.pack(*flat)
        return head + (_pack_tail(layout, head, data) if tail else b"")
    except (struct.error, ValueError, TypeError) as error:
        raise FrameError(
            f"{layout.name} does not fit its fields ({error}): {_short(payload)}"
        ) from error


def _pack_tail(layout: Layout, head: bytes, data: bytes | tuple) -> bytes:
    tail = layout.tail
    if tail.raw:
        return bytes(data)
    columns = layout.columns(head)
    rows = [(item,) for item in data] if tail.columns == 1 else data
    if wrong := next((row for row in rows if len(row) != columns), None):
        raise ValueError(f"a row of {tail.name} has {len(wrong)} values, wants {columns}")
    return struct.pack(f"<{len(rows) * columns}{FORMATS[tail.type]}", *chain.from_iterable(rows))


def _short(payload: Payload) -> str:
    text = repr(payload)
    return text if len(text) <= 200 else text[:200] + "..."


def length_rules() -> list[tuple[int, int, int, Callable[[bytes], int] | None] | None]:
    """Per type byte: (smallest size, offset of the row count, bytes per row, row size by mask) or
    None.

    The hot path's form of `shortage`; a test holds the two together.
    """
    rules: list = [None] * 256
    for type_, layout in SPEC.layouts.items():
        tail = layout.tail
        if tail is None or tail.raw:
            rules[type_] = (layout.size, 0, 0, None)
            continue
        width = struct.calcsize(FORMATS[tail.type])
        if isinstance(tail.columns, int):
            rules[type_] = (layout.size, layout.offsets[tail.count], width * tail.columns, None)
        else:
            mask_at = layout.offsets[tail.columns]
            rules[type_] = (
                layout.size,
                layout.offsets[tail.count],
                0,
                lambda payload, at=mask_at, width=width: payload[at].bit_count() * width,
            )
    return rules
