"""Clocks and certificates of all places, as causes of alarms."""

import datetime as dt
import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from dashboard.alarms.settings import AlarmSettings
from dashboard.data.fault import Alarm
from dashboard.data.lateness import clock
from dashboard.data.store import Store
from messages.bus import tls
from messages.bus.presence import Process
from messages.text import plain

FOLDER_S = 60.0  # between two looks at the certificates of this place
BEATS = 60  # of a process, after which its clock should have been measured
SHARE = 6  # of a short life, one part in so many is near the end: renewal begins at a third
DAY_S = 86_400.0


@dataclass
class Certificates:
    """Ends of those that this place has in its folder, and of those that processes show."""

    folder: Path | None
    _looked: float = -math.inf
    _kept: dict[str, tuple[dt.datetime, dt.datetime]] = field(default_factory=dict)

    def near_end(self, store: Store, days: float, now_s: float) -> Iterator[Alarm]:
        """Call under the store's lock; now_s: time.time()."""
        said: set[str] = set()
        for one in store.presence.all():
            ends_s = one.beat.certificate_ends_utc_ns * 1e-9
            about = f"{one.place}-{one.role}"
            if ends_s and about not in said and one.lives:
                said.add(about)
                life_s = one.beat.certificate_life_s
                yield from _near(about, f"{one.role} at {one.place}", ends_s, life_s, days, now_s)
        for role, (begins, ends) in self._own().items():
            if not any(about.endswith(f"-{role}") for about in said):
                life_s = (ends - begins).total_seconds()
                about, whose = f"own-{role}", f"{role} of this place"
                yield from _near(about, whose, ends.timestamp(), life_s, days, now_s)

    def _own(self) -> dict[str, tuple[dt.datetime, dt.datetime]]:
        if self.folder is not None and time.monotonic() - self._looked > FOLDER_S:
            self._looked = time.monotonic()
            found = {
                path.stem: tls.life(self.folder, path.stem)
                for path in sorted(self.folder.glob("*.pem"))
                if path.name != tls.TRUSTED
            }
            self._kept = {role: life for role, life in found.items() if life is not None}
        return self._kept


def _near(
    about: str, whose: str, ends_s: float, life_s: float, days: float, now_s: float
) -> Iterator[Alarm]:
    left_s, limit_s = ends_s - now_s, min(days * DAY_S, life_s / SHARE)
    if left_s > limit_s:
        return
    ends = dt.datetime.fromtimestamp(ends_s, dt.UTC).strftime("%Y-%m-%d %H:%M UTC")
    what = f"ended {ends}: who shows it is shut out" if left_s <= 0 else f"ends {ends}"
    text = (
        f"the certificate of {whose} {what}, and was not renewed by itself: does home answer?"
        " `gyrofree certs renew` there makes a new one"
    )
    title = "certificate ended" if left_s <= 0 else "certificate near its end"
    yield Alarm("certificate", title, text, "", about)


def clocks_off(store: Store, settings: AlarmSettings) -> Iterator[Alarm]:
    """Clocks that differ from the site's, or that nobody can compare. Call under the store's
    lock.
    """
    running = [one for one in store.presence.all() if one.lives and one.beats]
    for place in sorted({one.place for one in running}):
        there = [one for one in running if one.place == place]
        known = [one for one in there if math.isfinite(one.beat.clock_ahead_s)]
        worst = max(known, key=_surely, default=None)
        if worst is not None and _surely(worst) > settings.clock_limit_s:
            said = clock(worst.beat.clock_ahead_s, worst.beat.clock_bound_s)
            text = (
                f"the clock of {worst.role} at {place} is {plain(said)} against the site's: see"
                " that it is kept by NTP"
            )
            yield Alarm("clock", f"clock off at {place}", text, "", place)
        elif not known and len({one.place for one in running}) > 1:
            if min(one.beat.header.sequence for one in there) > BEATS:
                text = (
                    "its offset to the site's clock cannot be measured: home's `gyrofree site"
                    " serve` does not answer, so no age of a picture is known there"
                )
                yield Alarm("clock", f"clock of {place} not known", text, "", place)


def _surely(one: Process) -> float:
    """The offset that is left when its bound is taken off, s."""
    return abs(one.beat.clock_ahead_s) - one.beat.clock_bound_s
