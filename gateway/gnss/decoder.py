"""A receiver's bytes to epochs: position, velocity, time of the fix.

UBX: NAV-PVT, with NAV-HPPOSLLH (millimetres) and NAV-COV of the same epoch. NMEA: GGA, RMC, GST,
VTG of the same time of day, the date from RMC or ZDA. An epoch is complete when every sentence has
come that the last epoch had; the first one, and one that lost a sentence, when the next begins. A
receiver that speaks both is heard once: UBX says more, so its NMEA is left out, unless NMEA epochs
come more often; then UBX is.

Time of the fix is the receiver's; time of arrival is the caller's business and stays apart.
"""

import calendar
import struct
from dataclasses import dataclass, field, replace
from datetime import date, timedelta

import pynmeagps
import pyubx2

from gateway.gnss.fix import DAY_NS, Fix, nmea_fix, tod_of, ubx_fix
from gateway.gnss.stream import GnssStream, RawMessage

UBX_MUTES_NMEA = 3  # NMEA epochs left out after each UBX one
UBX_USED = {b"\x01\x07", b"\x01\x14", b"\x01\x36"}
NMEA_USED = {"GGA", "RMC", "GST", "VTG", "ZDA"}


@dataclass
class _Epoch:
    """Messages of one epoch, by name."""

    key: object
    parts: dict[str, object] = field(default_factory=dict)


class GnssDecoder:
    """Bytes in, fixes out; never raises on what a receiver sends."""

    def __init__(self) -> None:
        self.stream = GnssStream()
        self.unreadable = 0  # right checksum, content that the parsers refuse
        self._ubx: _Epoch | None = None
        self._nmea: _Epoch | None = None
        self._ubx_roster: set[str] = set()
        self._nmea_roster: set[str] = set()
        self._muted = 0
        self._nmea_since_ubx = 0
        self._nmea_leads = False
        self._date: date | None = None
        self._last_tod_ns = 0

    @property
    def good(self) -> int:
        """Messages with a right checksum."""
        return self.stream.good

    @property
    def bad(self) -> int:
        """Messages with a wrong checksum, or with content that makes no sense."""
        return self.stream.bad + self.unreadable

    @property
    def idle(self) -> bool:
        """True when the next byte begins an epoch: nothing is open and nothing half received."""
        return self._ubx is None and self._nmea is None and not self.stream.pending

    def feed(self, data: bytes) -> list[Fix]:
        """Epochs completed by these bytes."""
        fixes: list[Fix] = []
        for message in self.stream.feed(data):
            try:
                fixes += self._take(message)
            except (  # whatever the two parsers raise on makers' oddities: counted, never fatal
                pynmeagps.NMEAParseError,
                pynmeagps.NMEAMessageError,
                pynmeagps.NMEATypeError,
                pyubx2.UBXParseError,
                pyubx2.UBXMessageError,
                pyubx2.UBXTypeError,
                ValueError,
                TypeError,
                AttributeError,
                KeyError,
                IndexError,
                struct.error,
                OverflowError,
            ):
                self.unreadable += 1
        return fixes

    def flush(self) -> list[Fix]:
        """Epochs still open, when nothing more will come."""
        return self._close_ubx() + self._close_nmea()

    def _take(self, message: RawMessage) -> list[Fix]:
        if message.kind == "UBX" and message.data[2:4] in UBX_USED:
            return self._take_ubx(message.data)
        if message.kind == "NMEA" and message.data[3:6].decode("latin-1") in NMEA_USED:
            return self._take_nmea(message.data)
        return []

    # --- UBX

    def _take_ubx(self, data: bytes) -> list[Fix]:
        parsed = pyubx2.UBXReader.parse(data)
        name = parsed.identity
        at = 10 if name == "NAV-HPPOSLLH" else 6
        key = struct.unpack_from("<I", data, at)[
            0
        ]  # iTOW in ms; the parser's time of day has lost them
        fixes: list[Fix] = []
        if self._ubx is None or self._ubx.key != key:
            fixes = self._close_ubx()
            self._ubx = _Epoch(key)
        self._ubx.parts[name] = parsed
        if self._ubx_roster and self._ubx_roster <= set(self._ubx.parts):
            fixes += self._close_ubx()
        return fixes

    def _close_ubx(self) -> list[Fix]:
        epoch, self._ubx = self._ubx, None
        if epoch is None:
            return []
        pvt = epoch.parts.get("NAV-PVT")
        if pvt is None:
            return []
        self._ubx_roster = set(epoch.parts)
        self._muted = UBX_MUTES_NMEA
        self._nmea_leads, self._nmea_since_ubx = self._nmea_since_ubx > 1, 0
        if self._nmea_leads:
            return []
        return [ubx_fix(pvt, epoch.parts.get("NAV-HPPOSLLH"), epoch.parts.get("NAV-COV"))]

    # --- NMEA

    def _take_nmea(self, data: bytes) -> list[Fix]:
        parsed = pynmeagps.NMEAReader.parse(data, validate=pynmeagps.VALCKSUM)
        name = parsed.msgID
        fields = data.split(b"*")[0].split(b",")
        if name == "VTG":
            key = self._nmea.key if self._nmea else None  # has no time: belongs to what is open
        else:
            key = fields[5 if name == "GST" and len(fields[1]) == 0 else 1].decode("ascii")
        if not key:
            return []
        fixes: list[Fix] = []
        if self._nmea is None or self._nmea.key != key:
            fixes = self._close_nmea()
            self._nmea = _Epoch(key)
        self._nmea.parts[name] = parsed
        if name == "ZDA" and parsed.year:
            self._date = date(int(parsed.year), int(parsed.month), int(parsed.day))
        elif name == "RMC" and isinstance(parsed.date, date):
            self._date = parsed.date
        if self._nmea_roster and self._nmea_roster <= set(self._nmea.parts):
            fixes += self._close_nmea()
        return fixes

    def _close_nmea(self) -> list[Fix]:
        epoch, self._nmea = self._nmea, None
        if epoch is None or not {"GGA", "RMC"} & set(epoch.parts):
            return []
        self._nmea_roster = set(epoch.parts)
        tod_ns = tod_of(str(epoch.key))
        if (
            not {"RMC", "ZDA"} & set(epoch.parts)
            and self._date
            and tod_ns < self._last_tod_ns - DAY_NS // 2
        ):
            self._date += timedelta(days=1)  # midnight between two sentences that carry the date
        self._last_tod_ns = tod_ns
        self._nmea_since_ubx += 1
        if self._muted and not self._nmea_leads:
            self._muted -= 1
            return []
        utc_ns = calendar.timegm(self._date.timetuple()) * 10**9 + tod_ns if self._date else 0
        fix = nmea_fix(epoch.parts)
        return [replace(fix, fix_utc_ns=utc_ns)]
