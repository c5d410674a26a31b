"""All alarms and what happened to them. Pure: what is found goes in, what changed comes out."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

from dashboard.alarms import machine
from dashboard.alarms.machine import LEVELS, Cause, Now, Point, State

HISTORY = 500  # events that are kept
RECENT_S = 600.0  # an alarm that is over is shown for so long
MOST = 1000  # alarms; of more the ones that are over go, and those too many are counted
LONGEST_SHELF_S = 7 * 86400.0
Key = tuple[str, str]  # device, id


class NoSuchAlarm(LookupError):
    """An order about an alarm that is not there; the text says so."""


@dataclass(frozen=True)
class Event:
    """Something that happened to an alarm."""

    utc_ns: int
    device: str
    id: str
    title: str
    level: str
    what: str
    who: str = ""
    text: str = ""


@dataclass
class Book:
    """The alarms by device and id, and the newest events, oldest first."""

    points: dict[Key, Point] = field(default_factory=dict)
    history: list[Event] = field(default_factory=list)
    refused: int = 0  # alarms for which there was no room
    changed: bool = False  # since it was last kept; whoever keeps it resets this
    tell: Callable[[Point], None] = lambda point: None  # called with one that was raised

    def found(self, device: str, id: str, cause: Cause, now: Now) -> None:
        """This is wrong now."""
        key = device, id
        before = self.points.get(key)
        if before is None and not self._room(now):
            self.refused += 1
            return
        before = before or Point(id, device, cause)
        point = machine.raised(before, cause, now, self._nothing_of(device, key))
        self._put(key, point)
        worse = before.active and LEVELS.index(cause.level) > LEVELS.index(before.cause.level)
        if not before.active or worse:
            self._event(point, "became worse" if before.active else "raised", now, text=cause.text)
            if point.state is not State.SHELVED:
                self.tell(point)

    def gone(self, device: str, id: str, now: Now) -> None:
        """This is not wrong now, for certain."""
        before = self.points.get((device, id))
        if before is not None:
            self._put((device, id), machine.ended(before, now))
            if before.active:
                self._event(before, "returned", now)

    def unknown(self, device: str, id: str) -> None:
        """Whether this is wrong is not known."""
        before = self.points.get((device, id))
        if before is not None and before.active:
            self._put((device, id), machine.unknown(before))

    def acknowledge(self, device: str, id: str, who: str, note: str, now: Now) -> None:
        """Raises NoSuchAlarm."""
        point = self._of(device, id)
        if not point.owed:
            by = f" by {point.acknowledged_by}" if point.acknowledged_by else ""
            raise NoSuchAlarm(f"{point.cause.title}: taken note of already{by}")
        self._put((device, id), machine.acknowledged(point, who, note, now))
        self._event(point, "acknowledged", now, who, note)

    def shelve(self, device: str, id: str, who: str, reason: str, seconds: float, now: Now) -> None:
        """Raises NoSuchAlarm, also for a time that is none."""
        point = self._of(device, id)
        if not 0.0 < seconds <= LONGEST_SHELF_S:
            raise NoSuchAlarm(
                f"shelving for {seconds:g} s: want above 0, at most {LONGEST_SHELF_S:g} (7 days)"
            )
        self._put((device, id), machine.shelved(point, who, reason, seconds, now))
        self._event(point, "shelved", now, who, f"for {seconds:g} s: {reason}".rstrip(": "))

    def unshelve(self, device: str, id: str, who: str, now: Now) -> None:
        """Raises NoSuchAlarm."""
        point = self._of(device, id)
        if point.state is not State.SHELVED:
            raise NoSuchAlarm(f"{point.cause.title}: is on no shelf")
        self._off_the_shelf(point, who, now)

    def tick(self, now: Now) -> None:
        """Shelves whose time is over, and alarms that are long over."""
        for key, point in list(self.points.items()):
            if machine.lapsed(point, now):
                self._off_the_shelf(point, "", now)
            elif self._is_over(point) and now.s - point.returned_s > RECENT_S:
                del self.points[key]
                self.changed = True

    def forget(self, device: str, id: str) -> None:
        """Nobody asks about this any more: its limit was removed."""
        if self.points.pop((device, id), None) is not None:
            self.changed = True

    def note(self, event: Event) -> None:
        """An event that is about no alarm."""
        self.history = [*self.history, event][-HISTORY:]
        self.changed = True

    def _off_the_shelf(self, point: Point, who: str, now: Now) -> None:
        key = point.device, point.id
        after = machine.unshelved(point)
        self._put(key, after)
        self._event(point, "unshelved" if who else "its shelf is over", now, who)
        if after.active:
            self.tell(after)

    def _of(self, device: str, id: str) -> Point:
        point = self.points.get((device, id))
        if point is None:
            about = f"of {device}" if device else "of the bench"
            raise NoSuchAlarm(f"there is no alarm {id[:80]!r} {about}")
        return point

    def _nothing_of(self, device: str, but: Key) -> bool:
        return not any(
            point.active for key, point in self.points.items() if key[0] == device and key != but
        )

    @staticmethod
    def _is_over(point: Point) -> bool:
        return point.state is State.NORMAL

    def _room(self, now: Now) -> bool:
        if len(self.points) < MOST:
            return True
        over = [key for key, point in self.points.items() if self._is_over(point)]
        if not over:
            return False
        del self.points[min(over, key=lambda key: self.points[key].returned_s)]
        return True

    def _put(self, key: Key, point: Point) -> None:
        before = self.points.get(key)
        self.points[key] = point
        self.changed = self.changed or before is None or _shown(before) != _shown(point)

    def _event(self, point: Point, what: str, now: Now, who: str = "", text: str = "") -> None:
        cause = point.cause
        self.note(
            Event(now.utc_ns, point.device, point.id, cause.title, cause.level, what, who, text)
        )


def _shown(point: Point) -> Point:
    """Without what changes all the time: the value that a limit was exceeded by."""
    return replace(point, cause=replace(point.cause, value=0.0, text="", limit=0.0))
