"""What speaks on a line: bytes in, a verdict out. No port, no clock.

A frame of ours or a receiver's message is believed by its checksum, so that noise and wrong bauds
are not taken for one. Text is told by being printable; what is left is noise.
"""

import re
from collections import Counter
from dataclasses import dataclass, field

from firmware_protocol.codec import Deframer, Frame
from firmware_protocol.frames import Acc12, Adc, Gps, Hello, Imu6, Tacho
from firmware_protocol.spec import SPEC
from gateway.gnss.stream import GnssStream
from messages.text import plain

BOARDS = {entry["id"]: entry["text"] for entry in SPEC.raw["board"]}
KINDS = {Acc12: "cube", Imu6: "imu", Adc: "analogue"}
LEAST_FOREIGN = 4  # packets; their beginnings are two bytes that noise has too
BYTES_OF_FOREIGN = 2000  # at most, between two of them
TEXT_KEPT = 4096  # bytes
PRINTABLE = re.compile(rb"[\t\r\n\x20-\x7e]")
MOSTLY = 0.95  # share of printable bytes in a text
LINE = 60  # characters of a line that is shown

BOARD, RECEIVER, TEXT, OTHER, NOISE, SILENCE = (
    "board",
    "receiver",
    "text",
    "other",
    "noise",
    "silence",
)
SANE = (BOARD, RECEIVER, TEXT, OTHER)


@dataclass
class Board:
    """What the frames of a board have said."""

    hello: Hello | None = None
    kind: str = ""  # cube, imu or analogue, by its sample frames; empty before the first
    axes: int = 0
    period_s: float = 0.0
    samples: int = 0
    pulses: int = 0
    receiver: GnssStream = field(default_factory=GnssStream)
    messages: Counter = field(default_factory=Counter)  # of that receiver, by name

    def take(self, frame: Frame) -> None:
        """One frame whose checksum is right."""
        match frame.payload:
            case Hello() as hello:
                self.hello = hello
            case Acc12() | Imu6() | Adc() as rows:
                self.kind, self.period_s = KINDS[type(rows)], rows.period_ns * 1e-9
                self.samples += len(rows.counts)
                self.axes = max([self.axes, *map(len, rows.counts)])
            case Tacho() as pulses:
                self.pulses += len(pulses.offsets_10ns)
            case Gps() as gps:
                self.messages.update(m.name for m in self.receiver.feed(gps.data))

    @property
    def said(self) -> str:
        """In words."""
        hello, parts = self.hello, []
        if hello is None:
            parts.append("a board that has not said who it is")
        else:
            name = BOARDS.get(hello.board_id, f"board of the unknown kind {hello.board_id}")
            version = ".".join(map(str, hello.version))
            parts.append(f"{name}, firmware {version} {plain(hello.firmware_text, 40)}".rstrip())
        parts.append(self._samples())
        parts.append(
            f"{self.pulses} tachometer pulses" if self.pulses else "no tachometer pulse so far"
        )
        if self.messages:
            parts.append(f"a receiver inside ({_names(self.messages)})")
        return "; ".join(parts)

    def _samples(self) -> str:
        if not self.samples:
            return "no samples"
        rate = f"{1.0 / self.period_s:.6g} Hz" if self.period_s else "unknown rate"
        what = {
            "cube": f"{self.axes} accelerometer axes",
            "imu": "accelerometers and gyroscopes, 6 axes",
            "analogue": f"{self.axes} analogue inputs",
        }[self.kind]
        return f"{what}, {rate}"


class Ear:
    """Listens to one line at one baud."""

    def __init__(self) -> None:
        self.bytes = 0
        self.frames = 0
        self.other_version = 0  # frames of another major version of the wire
        self.board = Board()
        self.messages: Counter[str] = Counter()  # of a receiver, by name
        self._deframer, self._stream = Deframer(), GnssStream()
        self._text = b""

    def feed(self, data: bytes) -> None:
        """Bytes in their order."""
        self.bytes += len(data)
        for event in self._deframer.feed(data):
            if isinstance(event, Frame):
                self.frames += 1
                self.board.take(event)
            else:
                self.other_version += event.reason == "version"
        self.messages.update(message.name for message in self._stream.feed(data))
        self._text = (self._text + data)[-TEXT_KEPT:]

    @property
    def kind(self) -> str:
        """BOARD, RECEIVER, TEXT, OTHER (known, not read here), NOISE or SILENCE."""
        if self.frames:
            return BOARD
        if self.messages:
            return RECEIVER
        if self.other_version or self._foreign:
            return OTHER
        if self._lines:
            return TEXT
        return NOISE if self.bytes else SILENCE

    @property
    def said(self) -> str:
        """In words."""
        match self.kind:
            case "board":
                return self.board.said
            case "receiver":
                return f"a GNSS receiver ({_names(self.messages)})"
            case "other" if self.other_version:
                return "a board that speaks another version of the wire: update its firmware"
            case "other":
                return f"a receiver that speaks {self._foreign}, which is not read here"
            case "text":
                return f"lines of text of another logger, such as {self._lines[0]!r}"
            case "noise":
                return f"{self.bytes} bytes that make no sense"
        return "silence"

    @property
    def _foreign(self) -> str:
        most = self._stream.foreign.packets.most_common(1)
        if not most or most[0][1] < max(LEAST_FOREIGN, self.bytes / BYTES_OF_FOREIGN):
            return ""
        return most[0][0]

    @property
    def _lines(self) -> list[str]:
        """Whole lines, where what comes is text; the first and last may be cut and are left out."""
        good = len(PRINTABLE.findall(self._text))
        if not self._text or good < MOSTLY * len(self._text):
            return []
        lines = re.split(rb"[\r\n]+", self._text)[1:-1]
        return [plain(line.decode("latin-1"), LINE) for line in lines if line.strip()]


def _names(found: Counter) -> str:
    return ", ".join(name for name, _ in found.most_common(6))
