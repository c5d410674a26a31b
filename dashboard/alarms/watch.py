"""Limits and faults, looked at again and again; what they come to goes into the book."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

from dashboard.alarms import health
from dashboard.alarms.book import Book
from dashboard.alarms.fields import Path as FieldPath
from dashboard.alarms.fields import Sampled, parsed, sampled
from dashboard.alarms.judge import Answer, Bounds, Judge, Turn
from dashboard.alarms.machine import Cause, Now
from dashboard.alarms.places import Certificates
from dashboard.alarms.settings import AlarmSettings, LimitSettings
from dashboard.data.channels import Channel, channels
from dashboard.data.device import Device
from dashboard.data.store import Store
from logs.figures.expression import Expression
from logs.figures.units import spelt, unit
from messages.contract.topics import REPLAY_SUFFIX
from messages.text import plain

LIMIT = "limit"  # kind of these alarms, and the beginning of their ids
UNKNOWN_S = 2.0  # a value that is not known for so long is an alarm where that is asked for


def limit_id(name: str) -> str:
    """Of the alarm of a limit."""
    return f"{LIMIT}-{name}"


@dataclass
class Eye:
    """One limit on one device."""

    limit: LimitSettings
    what: FieldPath | Expression
    judge: Judge | None = None
    generation: int = 0
    newest: float = -math.inf  # s on the device's axis
    unit: str = ""
    why: str = ""  # nothing is known, and this is the reason
    blind_since: float | None = None  # elapsed s

    def look(self, device: Device, named: dict[str, Channel], was_active: bool) -> list[Turn]:
        """Take the samples that are new; what the answer turned to, in order."""
        if device.generation != self.generation:
            self.generation, self.newest = device.generation, -math.inf
            begun = self.judge.forget() if self.judge is not None else []
        else:
            begun = []
        after = self.newest if math.isfinite(self.newest) else device.t_newest - 1.0
        found = sampled(device, self.what, after, time.monotonic(), named)
        self.why = found.why or self._wrong_unit(found)
        if self.why:
            return begun + (self.judge.forget() if self.judge is not None else [])
        self.unit = found.unit or self.limit.unit
        if not len(found.t):
            return begun
        if self.judge is None:
            limit = self.limit
            delays = limit.on_delay_s, limit.off_delay_s
            bounds = Bounds(limit.above, limit.below, limit.dead_band, *delays, found.gap_s)
            self.judge = Judge(bounds, was_active)
        self.newest = float(found.t[-1])
        return begun + self.judge.take(found.t, found.y)

    def _wrong_unit(self, found: Sampled) -> str:
        meant = self.limit.unit
        if not meant or not found.unit or spelt(unit(meant)) == found.unit:
            return ""
        return f"its unit is {found.unit}, and the limit is meant in {meant}"

    @property
    def answer(self) -> Answer:
        """Now."""
        return Answer.UNKNOWN if self.why or self.judge is None else self.judge.answer

    @property
    def said(self) -> str:
        """For people."""
        if self.why:
            return self.why
        if self.answer is Answer.UNKNOWN:
            return "not known: blind, ambiguous, or not said"
        return "beyond" if self.answer is Answer.BEYOND else "ok"

    def cause(self, value: float) -> Cause:
        """Of an alarm by this value."""
        limit, bounds = self.limit, Bounds(self.limit.above, self.limit.below)
        crossed = bounds.crossed(value)
        side = "above" if crossed == limit.above else "below"
        unit_ = f" {self.unit}" if self.unit else ""
        if math.isnan(value):
            text = f"{plain(limit.field)} is not known: {self.why or self.said}"
            return Cause(LIMIT, f"{limit.name}: not known", text, limit.level, "", unit=self.unit)
        text = f"{plain(limit.field)} = {value:.5g}{unit_}, {side} {crossed:g}{unit_}"
        title = f"{limit.name} {side} {crossed:g}{unit_}"
        return Cause(LIMIT, title, text, limit.level, "", value, crossed, self.unit)


@dataclass
class Watch:
    """All that is looked at. Call `look` a few times a second."""

    store: Store
    settings: AlarmSettings
    recordings: Path
    book: Book
    certificates: Certificates | None = None
    only: Callable[[str], bool] = bool  # which faults of the bench, by their ids; any
    limits: dict[str, LimitSettings] = field(default_factory=dict)
    eyes: dict[tuple[str, str], Eye] = field(default_factory=dict)  # limit, device
    _turning: dict[tuple[str, str], float] = field(default_factory=dict)  # since, elapsed s

    def set_limit(self, limit: LimitSettings) -> None:
        """Add a limit, or put it in the place of the one of its name. Raises ExpressionError."""
        parsed(limit.field)
        self.drop_eyes(limit.name)
        self.limits[limit.name] = limit

    def remove_limit(self, name: str) -> None:
        """And its alarms."""
        del self.limits[name]
        self.drop_eyes(name)
        for device, id in list(self.book.points):
            if id == limit_id(name):
                self.book.forget(device, id)

    def drop_eyes(self, name: str) -> None:
        """Begin anew with a limit."""
        for key in [key for key in self.eyes if key[0] == name]:
            del self.eyes[key]

    def look(self, now: Now) -> None:
        """Once."""
        with self.store.lock:
            at = time.monotonic()
            names = [n for n in self.store.names() if not n.endswith(REPLAY_SUFFIX)]
            for name in names:
                device = self.store.devices[name]
                if device.spoken_of or device.rings:
                    self._health(name, health.of_device(self.store, device, self.settings, at), now)
                    if self.limits:
                        self._limits(device, now)
            bench = health.of_bench(
                self.store, self.settings, self.recordings, at, self.certificates
            )
        ours = {id: cause for id, cause in bench.causes.items() if self.only(id)}
        self._health("", replace(bench, causes=ours), now)
        for device, id in [key for key in self.book.points if key[0] and key[0] not in names]:
            self.book.unknown(device, id)
        for (_, device), eye in self.eyes.items():
            if device not in names:
                eye.why = f"{device} has not been heard"
        self.book.tick(now)

    def _health(self, device: str, found: health.Found, now: Now) -> None:
        """Faults that stay are alarms, those that stay away are over: a flicker is neither."""
        points = self.book.points
        mine = {
            key[1]: point
            for key, point in points.items()
            if key[0] == device and point.cause.kind != LIMIT
        }
        for id, cause in found.causes.items():
            active = id in mine and mine[id].active
            delay_s = 0.0 if id in found.lasted else self.settings.on_delay_s
            if active or self._has_lasted(device, id, delay_s, now):
                self.book.found(device, id, cause, now)
                self._turning.pop((device, id), None)
        for id, point in mine.items():
            if id in found.causes:
                continue
            if point.cause.kind not in found.looked_at:
                self.book.unknown(device, id)
                self._turning.pop((device, id), None)
            elif point.active and self._has_lasted(device, id, self.settings.off_delay_s, now):
                self.book.gone(device, id, now)
                self._turning.pop((device, id), None)
        for key in [k for k in self._turning if k[0] == device]:
            if key[1] not in found.causes and not (key[1] in mine and mine[key[1]].active):
                del self._turning[key]

    def _has_lasted(self, device: str, id: str, delay_s: float, now: Now) -> bool:
        return now.s - self._turning.setdefault((device, id), now.s) >= delay_s

    def _limits(self, device: Device, now: Now) -> None:
        named = channels(device)
        for limit in self.limits.values():
            if limit.device in (None, device.name):
                key = limit.name, device.name
                if key not in self.eyes:
                    self.eyes[key] = Eye(limit, parsed(limit.field))
                self._one(self.eyes[key], device, named, now)

    def _one(self, eye: Eye, device: Device, named: dict[str, Channel], now: Now) -> None:
        id = limit_id(eye.limit.name)
        point = self.book.points.get((device.name, id))
        was_active = point is not None and point.active
        for turn in eye.look(device, named, was_active):
            if turn.answer is Answer.BEYOND:
                self.book.found(device.name, id, eye.cause(turn.value), now)
            elif turn.answer is Answer.OK:
                self.book.gone(device.name, id, now)
        if eye.answer is not Answer.UNKNOWN:
            eye.blind_since = None
            return
        eye.blind_since = now.s if eye.blind_since is None else eye.blind_since
        self.book.unknown(device.name, id)
        wanted = eye.limit.unknown == "alarm" and self._has_field(eye, device)
        if wanted and now.s - eye.blind_since >= max(UNKNOWN_S, eye.limit.on_delay_s):
            if not (point is not None and point.active):
                self.book.found(device.name, id, eye.cause(math.nan), now)

    @staticmethod
    def _has_field(eye: Eye, device: Device) -> bool:
        """A limit on every device is not about those that have no such field."""
        return eye.limit.device == device.name or eye.judge is not None
