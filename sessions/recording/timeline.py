"""One axis of time for a recording whose clocks were set while it was made.

Recordings of before carry the wall clock's steps in both of their times: `header.utc_ns` of a
gateway whose clock was set, and the receive times of a recorder whose clock was. The boards' own
clocks know nothing of it. A `Timeline` sees the messages in the order of the file and gives them
back with times that go on by the board's clock where a wall clock jumps; a recording without steps
passes through as it is, byte for byte.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

from google.protobuf.message import DecodeError

from messages.contract import gyrofree_pb2 as pb
from messages.contract.header import first_field
from messages.contract.topics import Topic, TopicError, parse
from sessions.recording.mcap_damage import Damage
from sessions.recording.mcap_index import BACK_S, PAUSE_S
from sessions.recording.mcap_log import Recorded, read

SAME_S = 2.0  # two offsets of UTC against a board's clock that differ by less are one
FORWARD_S = 5.0  # a step of the wall clock, against what the board's clock says; back: BACK_S
APART_S = 30.0  # receive time and the message's own time, against those of the first message
STANDS_S = 3.0  # receive times stand still for so long: a clock set back, and the order kept
LEVELS = 16  # offsets that are remembered, of one boot


@dataclass
class _Boot:
    """What is known of one boot of one device. Times in ns."""

    levels: list[list[int]] = field(default_factory=list)  # [UTC - device time, correction]
    device_ns: int = 0  # of the newest message
    utc_ns: int = 0


@dataclass
class _Device:
    boots: dict[int, _Boot] = field(default_factory=dict)
    corrections: list[int] = field(default_factory=lambda: [0])
    newest_ns: int = 0  # on the axis
    behind_ns: int | None = None  # receive time minus own time, of the first message
    log_ns: int = 0  # newest receive time, as recorded, and where on the axis it was reached
    moved_ns: int = 0


def straight(
    path: Path | tuple[Path, ...],
    damage: Damage | None = None,
    channels: dict[int, str] | None = None,
) -> Iterator[Recorded]:
    """What `read` gives of one file, or of several that go on with one another, with times on one
    axis. Raises OSError.
    """
    timeline = Timeline()
    for one in (path,) if isinstance(path, Path) else path:
        yield from map(timeline.place, read(one, damage, channels))


class Timeline:
    """Messages in the order of the file, with times on one axis."""

    def __init__(self) -> None:
        self._devices: dict[str, _Device] = {}
        self._topics: dict[str, tuple[str, Topic] | None] = {}
        self._last_log_ns = self._log_ns = 0  # of the message before: as recorded, on the axis
        self._log_broken = False
        self.steps = 0  # of wall clocks that were taken out

    def place(self, row: Recorded) -> Recorded:
        """The message with its times on the axis."""
        found = self._address(row.key)
        header = None if found is None else _header(found[1], row.payload)
        if found is None or header is None or not header.utc_ns:
            return self._received(row, None, 0)
        device = self._devices.setdefault(found[0], _Device())
        shift = self._correction(device, header)
        own_ns = header.utc_ns + shift
        device.newest_ns = max(device.newest_ns, own_ns)
        if shift:
            header.utc_ns = own_ns
            row = replace(row, publish_ns=own_ns, payload=_with_header(row.payload, header))
        return self._received(row, device, own_ns)

    def _address(self, key: str) -> tuple[str, Topic] | None:
        if key not in self._topics:
            try:
                address = parse(key)
                self._topics[key] = address.device, address.topic
            except TopicError:
                self._topics[key] = None
        return self._topics[key]

    def _correction(self, device: _Device, header: pb.Header) -> int:
        """What is to be added to a message's UTC."""
        if not header.device_us:
            return self._nearest(device, header.utc_ns)
        boot = device.boots.get(header.epoch)
        device_ns = header.device_us * 1000
        offset = header.utc_ns - device_ns
        if boot is None:
            boot = device.boots[header.epoch] = _Boot(
                [[offset, self._nearest(device, header.utc_ns)]]
            )
        level = min(boot.levels, key=lambda known: abs(offset - known[0]))
        if abs(offset - level[0]) > SAME_S * 1e9:
            level = self._new_level(device, boot, header.utc_ns, device_ns)
        level[0] = offset
        boot.device_ns, boot.utc_ns = device_ns, header.utc_ns + level[1]
        return level[1]

    def _new_level(self, device: _Device, boot: _Boot, utc_ns: int, device_ns: int) -> list[int]:
        """UTC and the board's clock have parted: which of them jumped?"""
        before = boot.levels[-1]
        by_board = (device_ns - boot.device_ns) * 1e-9
        by_wall = (utc_ns + before[1] - boot.utc_ns) * 1e-9
        stepped = by_wall < -BACK_S or by_wall > by_board + FORWARD_S
        correction = before[1]
        if stepped and -BACK_S <= by_board < abs(by_wall):
            correction = boot.utc_ns + device_ns - boot.device_ns - utc_ns
            device.corrections.append(correction)
            del device.corrections[1:-LEVELS]
            self.steps += 1
        boot.levels.append([utc_ns - device_ns, correction])
        del boot.levels[:-LEVELS]
        return boot.levels[-1]

    @staticmethod
    def _nearest(device: _Device, utc_ns: int) -> int:
        """The correction, of those known, that puts a message nearest to the newest one; without a
        board's clock nothing else tells.
        """
        if not device.newest_ns:
            return 0
        return min(device.corrections, key=lambda c: abs(utc_ns + c - device.newest_ns))

    def _received(self, row: Recorded, device: _Device | None, own_ns: int) -> Recorded:
        """The message with its receive time on the axis; own_ns: the message's own time there."""
        jump = row.log_ns - self._last_log_ns
        jumped = self._last_log_ns and (jump < -BACK_S * 1e9 or jump > PAUSE_S * 1e9)
        self._last_log_ns = row.log_ns
        if device is not None:
            behind = row.log_ns - own_ns
            if device.behind_ns is None:
                device.behind_ns = behind if not self._log_broken else 0
            if row.log_ns > device.log_ns:
                device.log_ns, device.moved_ns = row.log_ns, own_ns
            stands = own_ns - device.moved_ns > STANDS_S * 1e9
            apart = abs(behind - device.behind_ns) > APART_S * 1e9
            self._log_broken |= stands or bool(jumped and apart)
        if not self._log_broken:
            self._log_ns = max(self._log_ns, row.log_ns)
            return row
        at_ns = self._log_ns
        if device is not None and device.behind_ns is not None:
            at_ns = max(at_ns, own_ns + device.behind_ns)
        self._log_ns = at_ns
        return replace(row, log_ns=at_ns)


def _header(topic: Topic, payload: bytes) -> pb.Header | None:
    if "header" not in topic.type.DESCRIPTOR.fields_by_name:
        return None
    try:
        return pb.Header.FromString(first_field(payload))
    except (DecodeError, ValueError):
        return None


def _with_header(payload: bytes, header: pb.Header) -> bytes:
    """The message with another header; the fields behind it stay as they are, byte for byte."""
    old = first_field(payload)
    rest = payload[payload.index(old, 2 if old else 0) + len(old) :] if old else payload[2:]
    new = header.SerializeToString()
    return b"\x0a" + _varint(len(new)) + new + rest


def _varint(number: int) -> bytes:
    out = bytearray()
    while number > 0x7F:
        out.append(number & 0x7F | 0x80)
        number >>= 7
    out.append(number)
    return bytes(out)
