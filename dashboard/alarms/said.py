"""The book as messages of the bus."""

import math
from collections.abc import Iterable

from dashboard.alarms.book import Event
from dashboard.alarms.judge import Answer
from dashboard.alarms.machine import Now, Point, State
from dashboard.alarms.notices import Sender
from dashboard.alarms.settings import LimitSettings
from dashboard.alarms.watch import Eye
from messages.contract import gyrofree_pb2 as pb
from messages.text import plain

LEVELS = {
    "watch": pb.Alarm.LEVEL_WATCH,
    "warning": pb.Alarm.LEVEL_WARNING,
    "critical": pb.Alarm.LEVEL_CRITICAL,
}
STATES = {
    State.NORMAL: pb.Alarm.STATE_NORMAL,
    State.UNACKNOWLEDGED: pb.Alarm.STATE_UNACKNOWLEDGED,
    State.ACKNOWLEDGED: pb.Alarm.STATE_ACKNOWLEDGED,
    State.RETURNED: pb.Alarm.STATE_RETURNED,
    State.SHELVED: pb.Alarm.STATE_SHELVED,
}


def alarm(point: Point, now: Now) -> pb.Alarm:
    """One alarm."""
    cause = point.cause
    return pb.Alarm(
        id=plain(point.id, 120),
        device=point.device,
        kind=cause.kind,
        title=plain(cause.title, 150),
        text=plain(cause.text, 500),
        page=cause.page,
        level=LEVELS[cause.level],
        state=STATES[point.state],
        active=point.active,
        unknown=point.unknown,
        value=cause.value,
        limit=cause.limit,
        unit=cause.unit,
        raised_utc_ns=point.raised_ns,
        returned_utc_ns=point.returned_ns,
        acknowledged_by=point.acknowledged_by,
        acknowledged_utc_ns=point.acknowledged_ns,
        note=point.note,
        shelved_by=point.shelved_by,
        shelved_s=max(0.0, point.shelved_until_s - now.s) if point.shelved_until_s else 0.0,
        reason=point.reason,
        times=point.times,
        chattering=point.chattering,
        first_out=point.first_out,
    )


def in_order(points: Iterable[Point]) -> list[Point]:
    """The worst first: not taken note of, then active, by level, the newest first."""
    order = [State.UNACKNOWLEDGED, State.RETURNED, State.ACKNOWLEDGED, State.SHELVED, State.NORMAL]
    return sorted(
        points, key=lambda p: (order.index(p.state), -LEVELS[p.cause.level], -p.raised_ns)
    )


def limit(one: LimitSettings, fixed: bool, user: str, eyes: dict[str, Eye]) -> pb.AlarmLimit:
    """A limit, and what it says now of each device that it looks at."""
    said = pb.AlarmLimit(
        name=one.name,
        field=one.field,
        device=one.device or "",
        dead_band=one.dead_band,
        on_delay_s=one.on_delay_s,
        off_delay_s=one.off_delay_s,
        level=one.level,
        unknown=one.unknown,
        unit=one.unit,
        fixed=fixed,
        user=user,
    )
    if one.above is not None:
        said.above = one.above
    if one.below is not None:
        said.below = one.below
    seen = {name: eye for name, eye in eyes.items() if eye.judge is not None} or eyes
    said.readings.extend(reading(name, eye) for name, eye in sorted(seen.items())[:64])
    return said


def reading(device: str, eye: Eye) -> pb.AlarmLimit.Reading:
    """What a limit says of a device now."""
    known = eye.answer is not Answer.UNKNOWN and eye.judge is not None
    value = eye.judge.value if known and eye.judge is not None else math.nan
    return pb.AlarmLimit.Reading(
        device=device, value=value, unit=eye.unit, said=plain(eye.said, 300)
    )


def limit_of(said: pb.AlarmLimit) -> LimitSettings:
    """The limit that a person wants. Raises pydantic.ValidationError."""
    return LimitSettings.model_validate(
        {
            "name": said.name,
            "field": said.field,
            "device": said.device or None,
            "above": said.above if said.HasField("above") else None,
            "below": said.below if said.HasField("below") else None,
            "dead_band": said.dead_band,
            "on_delay_s": said.on_delay_s,
            "off_delay_s": said.off_delay_s,
            "level": said.level or "warning",
            "unknown": said.unknown or "say",
            "unit": said.unit,
        }
    )


def event(one: Event) -> pb.AlarmReply.Event:
    """Something that happened."""
    return pb.AlarmReply.Event(
        utc_ns=one.utc_ns,
        device=one.device,
        id=plain(one.id, 120),
        title=plain(one.title, 150),
        level=LEVELS.get(one.level, pb.Alarm.LEVEL_NONE),
        what=one.what,
        who=one.who,
        text=plain(one.text, 500),
    )


def way(sender: Sender) -> pb.AlarmReply.Way:
    """How a way out does."""
    return pb.AlarmReply.Way(
        name=sender.way.name,
        sent=sender.sent,
        waiting=sender.waiting,
        given_up=sender.given_up,
        fault=plain(sender.fault, 300),
    )


def source(heard: object) -> int:
    """Where a device's data come from, as its link says."""
    return pb.SOURCE_UNKNOWN if heard is None else heard.message.header.source  # type: ignore[attr-defined]


def steady(alarm: pb.Alarm) -> bytes:
    """What makes a message worth sending at once."""
    kept = pb.Alarm()
    kept.CopyFrom(alarm)
    kept.shelved_s = 1.0 if alarm.shelved_s else 0.0
    kept.text, kept.value = "", 0.0
    return kept.SerializeToString(deterministic=True)


def sides(limit: pb.AlarmLimit) -> str:
    """ "above 200 or below -200"."""
    sides = [f"above {limit.above:g}"] if limit.HasField("above") else []
    return " or ".join(sides + ([f"below {limit.below:g}"] if limit.HasField("below") else []))


def fault(one: object) -> str:
    """What pydantic finds wrong with a limit, in a line."""
    where = ".".join(map(str, one["loc"]))  # type: ignore[index]
    return f"{where}: {one['msg']}" if where else str(one["msg"])  # type: ignore[index]
