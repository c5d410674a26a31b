"""What a receiver says of the satellites it sees, as whole views of the sky.

NMEA tells a sky in rounds: for each talker and signal a series of GSV sentences, counted part by
part; a series with a part missing is none. A round ends when every series has come that the last
round had, or when one comes anew. Which satellites are used stands in the GSA sentences, a group
of them for each epoch. UBX says all in one message; while it comes, GSV is left out.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

from gateway.gnss.fields import Refused
from gateway.gnss.sky_read import (
    Active,
    Identity,
    Satellite,
    View,
    active_of,
    satellites_of,
    view_of,
)

MOST_SERIES = 64  # talkers and signals that are told apart
GSA_ROUNDS = 5  # for so many rounds the last GSA sentences are true
UBX_MUTES = 10  # rounds of GSV left out after each UBX message
MOST_SATELLITES = 256  # of one sky

Series = tuple[str, str]  # talker, signal


@dataclass(frozen=True)
class Sky:
    """Satellites in view, each once."""

    talker: str  # "UBX" or "NMEA"
    satellites: tuple[Satellite, ...]


class SkyReader:
    """Messages in, skies out. Raises Refused for a message that is not believed."""

    def __init__(self) -> None:
        self._open: dict[Series, list[View]] = {}  # series that have begun
        self._begun: set[Series] = set()  # of which a first part was ever seen
        self._round: dict[Series, list[View]] = {}  # whole ones
        self._roster: set[Series] = set()
        self._active: list[Active] = []
        self._in_gsa = False
        self._gsa_age = GSA_ROUNDS
        self._muted = 0

    def ubx(self, data: bytes) -> Sky | None:
        """A UBX message; the sky it tells."""
        found = satellites_of(data)
        if found is None:
            return None
        self._muted = UBX_MUTES
        return Sky("UBX", merged(found))

    def nmea(self, name: str, line: bytes) -> Sky | None:
        """A sentence by its name; the sky that it makes whole."""
        if name == "GSA":
            if not self._in_gsa:
                self._active, self._gsa_age = [], 0
            self._in_gsa = True
            self._active.append(active_of(line))
            return None
        self._in_gsa = False
        return self._view(view_of(line)) if name == "GSV" else None

    def _view(self, view: View) -> Sky | None:
        key = view.talker, view.signal
        if key not in self._begun and len(self._begun) >= MOST_SERIES:
            raise Refused("GSV", "talker")
        if view.part == 1:
            self._begun.add(key)
            self._open[key] = [view]
        else:
            before = self._open.pop(key, [])
            if not before or (before[-1].part, before[-1].parts) != (view.part - 1, view.parts):
                if key not in self._begun:
                    return None  # we began to listen in its middle
                raise Refused("GSV", "sequence")
            self._open[key] = [*before, view]
        if view.part < view.parts:
            return None
        return self._whole(key, self._open.pop(key))

    def _whole(self, key: Series, views: list[View]) -> Sky | None:
        said = self._close() if key in self._round else None
        self._round[key] = views
        if said is None and self._roster and self._roster <= set(self._round):
            said = self._close()
        return said

    def _close(self) -> Sky | None:
        views = [view for series in self._round.values() for view in series]
        self._roster, self._round = set(self._round), {}
        known, full = self._used()
        self._gsa_age += 1
        if self._muted:
            self._muted -= 1
            return None
        found = merged(satellite for view in views for satellite in view.satellites)
        if known is None:
            return Sky("NMEA", found)
        used = (
            replace(s, used=True if s.identity in known else None if full else False) for s in found
        )
        return Sky("NMEA", tuple(used))

    def _used(self) -> tuple[set[Identity] | None, bool]:
        """Satellites in use, None where nobody says; and whether there may be more."""
        if not self._active or self._gsa_age >= GSA_ROUNDS:
            return None, False
        used = {one for active in self._active for one in active.used}
        return used, any(active.full for active in self._active)


def merged(satellites: Iterable[Satellite]) -> tuple[Satellite, ...]:
    """Each satellite once, in the order of systems and numbers: with its strongest signal."""
    found: dict[Identity, Satellite] = {}
    for one in satellites:
        before = found.get(one.identity)
        if before is None:
            if len(found) < MOST_SATELLITES:
                found[one.identity] = one
            continue
        found[one.identity] = replace(
            before,
            elevation_deg=one.elevation_deg
            if before.elevation_deg is None
            else before.elevation_deg,
            azimuth_deg=one.azimuth_deg if before.azimuth_deg is None else before.azimuth_deg,
            cn0_dbhz=max(one.cn0_dbhz or 0.0, before.cn0_dbhz or 0.0) or None,
            used=before.used or one.used,
            signals=before.signals + one.signals,
        )
    return tuple(found[key] for key in sorted(found))
