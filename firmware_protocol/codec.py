"""Bytes in, events out: the deframer, and the encoder it undoes.  No port, no clock, no thread.

    00  COBS( header 16 | payload 0..488 | crc32 )  00        at most 512 bytes, little-endian,
    spec.toml

Every byte fed becomes part of exactly one event or is pending: an event carries the delimiter that
closed it and the one that opened it, so sizes of events plus `Deframer.pending` are the bytes in.
How the stream is cut into reads changes nothing.
"""

import struct
from functools import cached_property
from typing import NamedTuple
from zlib import crc32

from cobs import cobs

from firmware_protocol.frames import Payload
from firmware_protocol.payloads import FrameError, length_rules, pack, shortage, unpack
from firmware_protocol.spec import SPEC

__all__ = [
    "FLAG_CONFIG",
    "FLAG_DROPPED",
    "FLAG_PPS",
    "FLAG_SIMULATED",
    "REASONS",
    "Damaged",
    "Deframer",
    "Event",
    "Frame",
    "FrameError",
    "encode",
]

FLAG_DROPPED = SPEC.flags["dropped"]
FLAG_PPS = SPEC.flags["pps"]
FLAG_SIMULATED = SPEC.flags["simulated"]
FLAG_CONFIG = SPEC.flags["config"]

REASONS = SPEC.reasons
"""Every word `Damaged.reason` can be."""

HEADER = struct.Struct("<" + "".join(field.format for field in SPEC.header))
CRC_SIZE = 4
MAX_BODY = SPEC.max_wire - 2  # bytes between two delimiters
HEADER_SIZE = HEADER.size
MIN_FRAME = HEADER_SIZE + CRC_SIZE  # bytes before stuffing
MAX_FRAME = MIN_FRAME + SPEC.max_payload
RESIDUE = 0x2144DF1C  # crc32 of any data followed by its own crc32, little-endian
PROTO = SPEC.proto


class _Header(NamedTuple):
    type: int
    epoch: int
    flags: int
    seq: int
    t_us: int
    raw: bytes
    wire_size: int


class Frame(_Header):
    """A whole frame: type, epoch, flags, seq, t_us (device microseconds), raw payload bytes, bytes
    on the wire.

    A tuple and not a dataclass because 300,000 of them are made in a second; `payload` is decoded
    on first use.
    """

    @cached_property
    def payload(self) -> Payload:
        """The payload as its frames.py class; Unknown for a type this version does not know."""
        return unpack(self.type, self.raw)


class Damaged(NamedTuple):
    """Bytes that reached us and are no frame; counted and published, never raised."""

    data: bytes
    """All of them, delimiters included, so that lengths add up to the bytes in."""
    reason: str
    """One of REASONS."""
    detail: str = ""
    """For the log: what was found and what was wanted."""

    @property
    def wire_size(self) -> int:
        return len(self.data)


Event = Frame | Damaged


def encode(payload_obj: Payload, *, epoch: int, seq: int, t_us: int, flags: int = 0) -> bytes:
    """Wire bytes of one frame, both delimiters included.

    epoch and seq wrap at 2^8 and 2^32 as on the device; t_us in device microseconds.  Raises
    FrameError when a value does not fit its field or the payload exceeds 488 bytes.
    """
    payload = pack(payload_obj)
    try:
        header = HEADER.pack(PROTO, payload_obj.TYPE, epoch & 0xFF, flags, seq & 0xFFFFFFFF, t_us)
    except struct.error as error:
        raise FrameError(
            f"header of {type(payload_obj).__name__} does not fit ({error}): type"
            f" {payload_obj.TYPE}, flags {flags}, t_us {t_us}"
        ) from error
    body = header + payload
    return b"\0" + cobs.encode(body + crc32(body).to_bytes(CRC_SIZE, "little")) + b"\0"


class Deframer:
    """Turns any cutting of the byte stream into the same sequence of events."""

    def __init__(self) -> None:
        self._body = b""  # since the last delimiter, at most MAX_BODY bytes
        self._zeros = 0  # delimiters before it that no event carries yet
        self._overrun = False  # inside a chunk that is longer than any frame

    @property
    def pending(self) -> int:
        """Bytes fed that no event carries yet, at most 511."""
        return self._zeros + len(self._body)

    def feed(self, data: bytes) -> list[Event]:
        """Events completed by these bytes, in order.  Never raises for what the bytes contain."""
        chunks = (self._body + data).split(b"\0")
        last = chunks.pop()
        events: list[Event] = []
        for chunk in chunks:
            if not chunk:
                self._delimiter(events)
            elif self._overrun or self._zeros > 1 or len(chunk) > MAX_BODY:
                self._close_unusual(chunk, events)
            else:
                events.append(_decode(chunk, self._zeros))
                self._zeros = 0
        self._body = self._shorten(last, events) if last else last
        return events

    def close(self) -> list[Event]:
        """End of the stream: what is pending becomes one event, so that every byte has one."""
        data = b"\0" * self._zeros + self._body
        self.__init__()
        return (
            [Damaged(data, "unfinished", f"{len(data)} bytes at the end of the stream")]
            if data
            else []
        )

    def _delimiter(self, events: list[Event]) -> None:
        """A delimiter behind a delimiter opens a frame; more of them are idle line."""
        self._zeros += 1
        if self._zeros == MAX_BODY + 1:
            self._idle(events)

    def _idle(self, events: list[Event]) -> None:
        if self._zeros > 1:
            spare = self._zeros - 1
            events.append(Damaged(b"\0" * spare, "idle", f"{spare} spare delimiters"))
            self._zeros = 1

    def _shorten(self, body: bytes, events: list[Event]) -> bytes:
        """Cut off what exceeds any frame, in pieces of MAX_BODY, and return the rest."""
        self._idle(events)
        while len(body) > MAX_BODY:
            self._long(body[:MAX_BODY], b"", events)
            self._overrun, body = True, body[MAX_BODY:]
        return body

    def _long(self, piece: bytes, end: bytes, events: list[Event]) -> None:
        data = b"\0" * self._zeros + piece + end
        events.append(Damaged(data, "long", f"no delimiter within {MAX_BODY} bytes"))
        self._zeros = 0

    def _close_unusual(self, chunk: bytes, events: list[Event]) -> None:
        """A chunk after idle line, or one longer than any frame."""
        rest = self._shorten(chunk, events)
        if self._overrun:
            self._long(rest, b"\0", events)
        else:
            events.append(_decode(rest, self._zeros))
        self._overrun, self._zeros = False, 0


_RULES = length_rules()
_PROTO_AT = 0
_after_proto = struct.Struct("<x" + HEADER.format.lstrip("<")[1:]).unpack_from
_make = tuple.__new__  # skips NamedTuple's Python-level constructor, a sixth of the time of a frame


def _decode(chunk: bytes, zeros: int) -> Event:
    """One chunk between two delimiters; `zeros` of them, 0 or 1, opened it and one closed it."""
    try:
        body = cobs.decode(chunk)
    except cobs.DecodeError as error:
        return _damaged(chunk, zeros, "cobs", str(error))
    size = len(body)
    if crc32(body) != RESIDUE or body[_PROTO_AT] != PROTO or not MIN_FRAME <= size <= MAX_FRAME:
        return _refused(chunk, zeros, body)
    type_, epoch, flags, seq, t_us = _after_proto(body)
    payload = body[HEADER_SIZE:-CRC_SIZE]
    rule = _RULES[type_]
    if rule is not None:
        least, count_at, width, width_of = rule
        size -= MIN_FRAME
        if size < least or (
            count_at
            and size < least + payload[count_at] * (width_of(payload) if width_of else width)
        ):
            return _damaged(chunk, zeros, "payload", shortage(type_, payload))
    return _make(Frame, (type_, epoch, flags, seq, t_us, payload, len(chunk) + 1 + zeros))


def _refused(chunk: bytes, zeros: int, body: bytes) -> Damaged:
    """Why an unstuffed body is no frame of ours, in the order of spec.toml."""
    size = len(body) - MIN_FRAME
    if size > SPEC.max_payload:
        return _damaged(
            chunk, zeros, "long", f"payload of {size} bytes, at most {SPEC.max_payload}"
        )
    if size < 0:
        return _damaged(chunk, zeros, "short", f"{len(body)} bytes, header and CRC are {MIN_FRAME}")
    if crc32(body) != RESIDUE:
        received, computed = int.from_bytes(body[-CRC_SIZE:], "little"), crc32(body[:-CRC_SIZE])
        return _damaged(
            chunk, zeros, "crc", f"0x{received:08x} received, 0x{computed:08x} computed"
        )
    return _damaged(
        chunk,
        zeros,
        "version",
        f"proto 0x{body[_PROTO_AT]:02x}, this receiver speaks 0x{PROTO:02x}",
    )


def _damaged(chunk: bytes, zeros: int, reason: str, detail: str) -> Damaged:
    return Damaged(b"\0" * zeros + chunk + b"\0", reason, detail)
