"""Cut a receiver's byte stream into UBX, NMEA and RTCM 3 messages.

Nothing is believed before its checksum: a damaged message is counted and the search goes on one
byte behind its start, so a false start costs no true message. Any cutting of the stream into reads
gives the same messages. A sentence ends with its checksum, whatever ends its line: CR, LF, both,
blanks before them, or nothing.
"""

import re
from collections import Counter
from dataclasses import dataclass

from pyubx2 import UBX_MSGIDS

from gateway.gnss.foreign import Foreign

MAX_NMEA = 1024  # bytes; the standard says 82, makers' own sentences are longer
SENTENCE_ENDS = re.compile(rb"[*\x00-\x1f$]")  # checksum, or what cannot stand in a sentence
UNCHECKED = re.compile(rb"[A-Z]{2}([A-Z]{3}),[ -~]*")
MOST_UNCHECKED = 32  # names of sentences that are told apart
MAX_UBX = 8192  # bytes of payload; longer ones are false starts

_CRC24Q = []
for _i in range(256):
    _c = _i << 16
    for _ in range(8):
        _c = (_c << 1) ^ (0x1864CFB if _c & 0x800000 else 0)
    _CRC24Q.append(_c & 0xFFFFFF)


@dataclass(frozen=True)
class RawMessage:
    """A message whose checksum is right; kind is "UBX", "NMEA" or "RTCM"."""

    kind: str
    data: bytes

    @property
    def name(self) -> str:
        """What people call it: GGA, NAV-PVT, RTCM 1005."""
        if self.kind == "UBX":
            known = UBX_MSGIDS.get(self.data[2:4], f"{self.data[2]:02X}-{self.data[3]:02X}")
            return f"UBX {known}"
        if self.kind == "RTCM":
            return f"RTCM {self.data[3] << 4 | self.data[4] >> 4}" if len(self.data) > 7 else "RTCM"
        head = self.data[1:].partition(b",")[0].partition(b"*")[0].decode("latin-1")
        name = head[:5] if head.startswith("P") else head[-3:]
        return name if name.isascii() and name.isalnum() else "nameless sentence"


def ubx_checksum(data: bytes) -> bytes:
    """The two bytes of the 8-bit Fletcher sum over class, id, length and payload."""
    a = b = 0
    for byte in data:
        a = (a + byte) & 0xFF
        b = (b + a) & 0xFF
    return bytes((a, b))


def nmea_checksum(data: bytes) -> int:
    """Exclusive or of the bytes between $ and *."""
    x = 0
    for byte in data:
        x ^= byte
    return x


def crc24q(data: bytes) -> int:
    """RTCM's 24-bit CRC."""
    crc = 0
    for byte in data:
        crc = ((crc << 8) & 0xFFFFFF) ^ _CRC24Q[(crc >> 16) ^ byte]
    return crc


class GnssStream:
    """Bytes in, messages out. Bytes in = bytes of messages + skipped + pending."""

    def __init__(self) -> None:
        self._buffer = bytearray()
        self.good = 0
        self.bad = 0
        self.skipped_bytes = 0
        self.reasons: Counter[str] = Counter()
        self.unchecked: Counter[str] = Counter()  # sentences without a checksum, by name
        self.foreign = Foreign()

    @property
    def pending(self) -> int:
        """Bytes of a message that has only begun."""
        return len(self._buffer)

    def feed(self, data: bytes) -> list[RawMessage]:
        """Messages completed by these bytes."""
        buffer = self._buffer
        buffer += data
        found: list[RawMessage] = []
        skipped = bytearray()
        at = 0
        while at < len(buffer):
            size, kind = self._measure(buffer, at)
            if size == 0:
                break  # wait for the rest
            if kind:
                found.append(RawMessage(kind, bytes(buffer[at : at + size])))
                self.good += 1
            else:
                self.skipped_bytes += size
                skipped += buffer[at : at + size]
            at += size
        del buffer[:at]
        self.foreign.look(skipped)
        return found

    def _measure(self, buffer: bytearray, at: int) -> tuple[int, str]:
        """(bytes, kind) of the message at `at`; kind "" to skip those bytes; (0, "") to wait."""
        match buffer[at]:
            case 0xB5:
                return self._ubx(buffer, at)
            case 0x24:
                return self._nmea(buffer, at)
            case 0xD3:
                return self._rtcm(buffer, at)
        starts = [i for i in (buffer.find(c, at + 1) for c in (b"\xb5", b"$", b"\xd3")) if i >= 0]
        return (min(starts) if starts else len(buffer)) - at, ""

    def _damaged(self, reason: str) -> tuple[int, str]:
        self.bad += 1
        self.reasons[reason] += 1
        return 1, ""

    def _ubx(self, buffer: bytearray, at: int) -> tuple[int, str]:
        have = len(buffer) - at
        if have < 2:
            return 0, ""
        if buffer[at + 1] != 0x62:
            return 1, ""
        if have < 6:
            return 0, ""
        length = buffer[at + 4] | buffer[at + 5] << 8
        if length > MAX_UBX:
            return self._damaged("ubx length")
        if have < length + 8:
            return 0, ""
        end = at + 6 + length
        if ubx_checksum(buffer[at + 2 : end]) != buffer[end : end + 2]:
            return self._damaged("ubx checksum")
        return length + 8, "UBX"

    def _nmea(self, buffer: bytearray, at: int) -> tuple[int, str]:
        have = len(buffer) - at
        if have > 1 and not 0x41 <= buffer[at + 1] <= 0x5A:
            return 1, ""  # a dollar sign within something else
        end = SENTENCE_ENDS.search(buffer, at + 1, at + MAX_NMEA)
        if end is None:
            return (0, "") if have < MAX_NMEA else (1, "")
        stop = end.start()
        if buffer[stop] != 0x2A:
            return self._without_checksum(bytes(buffer[at + 1 : stop]), buffer[stop] in b"\r\n")
        if len(buffer) < stop + 3:
            return 0, ""
        try:
            right = int(buffer[stop + 1 : stop + 3], 16) == nmea_checksum(buffer[at + 1 : stop])
        except ValueError:
            right = False
        if not right:
            return self._damaged("nmea checksum")
        return stop + 3 - at, "NMEA"

    def _without_checksum(self, body: bytes, whole: bool) -> tuple[int, str]:
        """A line that looks like a sentence but has no checksum is told apart from a damaged one;
        it is not believed either.
        """
        named = UNCHECKED.fullmatch(body.rstrip())
        if not whole or named is None:
            return self._damaged("nmea checksum")
        name = named[1].decode()
        few = name in self.unchecked or len(self.unchecked) < MOST_UNCHECKED
        self.unchecked[name if few else "others"] += 1
        return 1 + len(body), ""

    def _rtcm(self, buffer: bytearray, at: int) -> tuple[int, str]:
        have = len(buffer) - at
        if have > 1 and buffer[at + 1] & 0xFC:
            return 1, ""
        if have < 3:
            return 0, ""
        size = ((buffer[at + 1] & 3) << 8 | buffer[at + 2]) + 6
        if have < size:
            return 0, ""
        if crc24q(buffer[at : at + size - 3]) != int.from_bytes(
            buffer[at + size - 3 : at + size], "big"
        ):
            return 1, ""  # 0xD3 is common inside other data: no damage, only no message
        return size, "RTCM"
