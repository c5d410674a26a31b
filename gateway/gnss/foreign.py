"""Protocols of receivers that are not read here, known by how their packets begin: to say what is
heard where nothing is understood.
"""

import re
from collections import Counter

KNOWN = {
    "SiRF binary": re.compile(rb"\xa0\xa2[\x00-\x03]"),
    "SkyTraq binary": re.compile(rb"\xa0\xa1[\x00-\x03]"),
    "Trimble TSIP or Garmin binary": re.compile(rb"\x10[^\x10\x03][^\x10]{0,250}?\x10\x03"),
    "NovAtel binary": re.compile(rb"\xaa\x44[\x12\x13]"),
    "Septentrio SBF": re.compile(rb"\$@"),
    "CASIC binary": re.compile(rb"\xba\xce"),
    "Allystar binary": re.compile(rb"\xf1\xd9"),
    "MediaTek binary": re.compile(rb"\x04\x24"),
}
OVERLAP = 256  # bytes kept for a packet that two reads share


class Foreign:
    """Counts beginnings of packets in what no message of ours covers."""

    def __init__(self) -> None:
        self.packets: Counter[str] = Counter()
        self.bytes = 0
        self._tail = b""

    def look(self, skipped: bytes | bytearray) -> None:
        """Bytes in their order, without the messages between them."""
        if not skipped:
            return
        self.bytes += len(skipped)
        text, seen = self._tail + bytes(skipped), len(self._tail)
        for name, begin in KNOWN.items():
            self.packets[name] += sum(m.end() > seen for m in begin.finditer(text))
        self._tail = text[-OVERLAP:]
