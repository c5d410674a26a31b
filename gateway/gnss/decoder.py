"""A receiver's bytes to epochs: position, velocity, time of the fix.

UBX messages of one time of week and NMEA sentences of one time of day, by value, are an epoch; the
date comes from RMC or ZDA. An epoch is complete when every message has come that the last epoch
had; the first one, and one that lost a message, when the next begins. A receiver that speaks both
is heard once: UBX says more, so its NMEA is left out, unless NMEA epochs come more often; then UBX
is.

Time of the fix is the receiver's; time of arrival is the caller's business and stays apart.
"""

from collections import Counter
from dataclasses import dataclass, field, replace
from datetime import date, timedelta

from gateway.gnss.fields import Refused, utc_ns_of
from gateway.gnss.fix import DAY_NS, Fix, Stamp, nmea_fix, ubx_fix
from gateway.gnss.nmea import Sentence, sentence_of
from gateway.gnss.sky import Sky, SkyReader
from gateway.gnss.stream import GnssStream, RawMessage
from gateway.gnss.ubx_read import Nav, nav_of

UBX_MUTES_NMEA = 3  # NMEA epochs left out after each UBX one
PLACES_UBX = {"NAV-PVT", "NAV-POSLLH", "NAV-HPPOSLLH", "NAV-SOL"}
PLACES_NMEA = {"GGA", "GNS", "RMC", "GLL"}
SELDOM = {"ZDA", "GSA"}  # not waited for: many receivers send them less often
GSA_EPOCHS = 50  # for so many epochs the last GSA is true
MOST_NAMES = 64  # of messages that are told apart


@dataclass
class _UbxEpoch:
    tow_ms: int
    began: Stamp
    parts: dict[str, Nav] = field(default_factory=dict)


@dataclass
class _NmeaEpoch:
    tod_ns: int
    began: Stamp
    parts: dict[str, Sentence] = field(default_factory=dict)


class GnssDecoder:
    """Bytes in, fixes out; never raises on what a receiver sends."""

    def __init__(self) -> None:
        self.stream = GnssStream()
        self.refused: Counter[str] = Counter()  # message and field: right checksum, wrong content
        self.heard: Counter[str] = Counter()  # messages with a right checksum, by name
        self.sky: Sky | None = None  # the newest; whoever takes it puts None in its place
        self._skies = SkyReader()
        self._ubx: _UbxEpoch | None = None
        self._nmea: _NmeaEpoch | None = None
        self._ubx_roster: set[str] = set()
        self._nmea_roster: set[str] = set()
        self._muted = 0
        self._nmea_since_ubx = 0
        self._nmea_leads = False
        self._date: date | None = None
        self._last_tod_ns = 0
        self._gsa: Sentence | None = None
        self._gsa_age = 0  # epochs since it came
        self._pending_since: Stamp = None  # of the message that is half received
        self._now: Stamp = None  # of the message that is looked at

    @property
    def good(self) -> int:
        """Messages with a right checksum."""
        return self.stream.good

    @property
    def unreadable(self) -> int:
        """Messages with a right checksum and a content that makes no sense."""
        return self.refused.total()

    @property
    def bad(self) -> int:
        """Messages with a wrong checksum, or with content that makes no sense."""
        return self.stream.bad + self.unreadable

    def feed(self, data: bytes, stamp: Stamp = None) -> list[Fix]:
        """Epochs completed by these bytes, each with the stamp of its own first byte."""
        fixes: list[Fix] = []
        self._now = self._pending_since if self.stream.pending else stamp
        messages = self.stream.feed(data)
        self._pending_since = stamp if messages else self._now
        for message in messages:
            try:
                fixes += self._take(message)
            except Refused as refusal:
                self.refused[refusal.text] += 1
            self._now = stamp
        return fixes

    def flush(self) -> list[Fix]:
        """Epochs still open, when nothing more will come."""
        return self._close_ubx() + self._close_nmea()

    def _take(self, message: RawMessage) -> list[Fix]:
        name = message.name
        self.heard[name if name in self.heard or len(self.heard) < MOST_NAMES else "others"] += 1
        self._look_up(message)
        if message.kind == "UBX":
            nav = nav_of(message.data)
            return [] if nav is None else self._take_ubx(nav)
        if message.kind == "NMEA":
            sentence = sentence_of(message.data)
            return [] if sentence is None else self._take_nmea(sentence)
        return []

    def _look_up(self, message: RawMessage) -> None:
        """What it says of satellites, which does not concern the fix."""
        try:
            if message.kind == "UBX":
                sky = self._skies.ubx(message.data)
            elif message.kind == "NMEA":
                sky = self._skies.nmea(message.name, message.data)
            else:
                return
        except Refused as refusal:
            self.refused[refusal.text] += 1
            return
        self.sky = sky or self.sky

    # --- UBX

    def _take_ubx(self, nav: Nav) -> list[Fix]:
        fixes: list[Fix] = []
        if self._ubx is None or self._ubx.tow_ms != nav.tow_ms:
            fixes = self._close_ubx()
            self._ubx = _UbxEpoch(nav.tow_ms, self._now)
        self._ubx.parts[nav.name] = nav
        if self._ubx_roster and self._ubx_roster <= set(self._ubx.parts):
            fixes += self._close_ubx()
        return fixes

    def _close_ubx(self) -> list[Fix]:
        epoch, self._ubx = self._ubx, None
        if epoch is None or not PLACES_UBX & set(epoch.parts):
            return []
        self._ubx_roster = set(epoch.parts) - SELDOM
        self._muted = UBX_MUTES_NMEA
        self._nmea_leads, self._nmea_since_ubx = self._nmea_since_ubx > 1, 0
        return [] if self._nmea_leads else [replace(ubx_fix(epoch.parts), began=epoch.began)]

    # --- NMEA

    def _take_nmea(self, sentence: Sentence) -> list[Fix]:
        if sentence.name == "GSA":
            self._gsa, self._gsa_age = sentence, 0
        tod_ns = sentence.tod_ns
        if tod_ns is None and sentence.place is not None:
            raise Refused(sentence.name, "without its time")
        if tod_ns is None:  # VTG and GSA have no time: they belong to what is open
            if sentence.name not in ("VTG", "GSA") or self._nmea is None:
                return []
            tod_ns = self._nmea.tod_ns
        fixes: list[Fix] = []
        if self._nmea is None or self._nmea.tod_ns != tod_ns:
            fixes = self._close_nmea()
            self._nmea = _NmeaEpoch(tod_ns, self._now)
        self._keep(self._nmea.parts, sentence)
        self._date = sentence.day or self._date
        if self._nmea_roster and self._nmea_roster <= set(self._nmea.parts):
            fixes += self._close_nmea()
        return fixes

    @staticmethod
    def _keep(parts: dict[str, Sentence], sentence: Sentence) -> None:
        """A receiver of several systems says some sentences once for each: one with a position is
        not replaced by one without.
        """
        before = parts.get(sentence.name)
        if before is None or before.place is None or sentence.place is not None:
            parts[sentence.name] = sentence

    def _close_nmea(self) -> list[Fix]:
        epoch, self._nmea = self._nmea, None
        if epoch is None or not PLACES_NMEA & set(epoch.parts):
            return []
        self._nmea_roster = set(epoch.parts) - SELDOM
        dated = any(part.day is not None for part in epoch.parts.values())
        if not dated and self._date and epoch.tod_ns < self._last_tod_ns - DAY_NS // 2:
            # midnight between two sentences that carry the date
            self._date = self._date + timedelta(days=1) if self._date < date.max else None
        self._last_tod_ns = epoch.tod_ns
        self._nmea_since_ubx += 1
        if self._muted and not self._nmea_leads:
            self._muted -= 1
            return []
        self._gsa_age += 1
        fix = nmea_fix(epoch.parts, self._gsa if self._gsa_age <= GSA_EPOCHS else None)
        utc_ns = utc_ns_of(self._date, epoch.tod_ns)
        return [replace(fix, fix_utc_ns=utc_ns, began=epoch.began)]
