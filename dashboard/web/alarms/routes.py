"""The page of alarms, and REST of it: what is wrong, who took note, the limits.

What is done goes as an order to the service `gyrofree alarms`; whether a page is open changes
nothing.
"""

import math
from typing import Annotated, Any

from fastapi import APIRouter, Depends, HTTPException, Request
from fastapi.responses import HTMLResponse
from pydantic import BaseModel, Field

from dashboard.alarms.settings import LEVELS
from dashboard.data.alarms import words_in
from dashboard.web.alarms.watched import WATCHED, watched
from dashboard.web.auth import Role
from dashboard.web.front import Asker, asker, desk_of, front_of, needs
from dashboard.web.pages import render
from dashboard.web.schemas import Line, Lines, Strict
from messages.bus.orders import NoAnswer, OrderError
from messages.contract import gyrofree_pb2 as pb
from messages.text import plain

routes = APIRouter()

SignedIn = Annotated[Asker, Depends(asker)]
Operator = Annotated[Asker, Depends(needs(Role.operator))]


class About(Strict):
    device: Line = Field(default="", max_length=32, description="empty: of the bench")
    id: Line = Field(min_length=1, max_length=128)


class Acknowledge(About):
    note: Lines = Field(default="", max_length=500)


class Shelve(About):
    seconds: float = Field(gt=0, le=604_800, description="at most seven days")
    reason: Lines = Field(default="", max_length=500)


class LimitIn(Strict):
    name: Line = Field(min_length=1, max_length=32)
    field: Line = Field(min_length=1, max_length=200)
    device: Line = Field(default="", max_length=32, description="empty: every one that has it")
    above: float | None = None
    below: float | None = None
    dead_band: float = Field(default=0.0, ge=0)
    on_delay_s: float = Field(default=0.0, ge=0, le=86_400)
    off_delay_s: float = Field(default=0.0, ge=0, le=86_400)
    level: Line = Field(default="warning", max_length=16)
    unknown: Line = Field(default="say", max_length=16)
    unit: Line = Field(default="", max_length=16)


class RemoveLimit(Strict):
    name: Line = Field(min_length=1, max_length=32)


class Point(BaseModel):
    id: str
    device: str = Field(description="empty: of the bench")
    kind: str
    title: str
    text: str
    page: str
    level: str
    state: str = Field(description="normal, unacknowledged, acknowledged, returned or shelved")
    active: bool
    unknown: bool = Field(description="whether it is there is not known now")
    value: float | None
    limit: float | None
    unit: str
    raised_s: float | None = Field(description="s since 1970")
    returned_s: float | None
    acknowledged_by: str
    acknowledged_s: float | None
    note: str
    shelved_by: str
    shelved_s: float = Field(description="that it stays on the shelf")
    reason: str
    times: int
    chattering: bool
    first_out: bool
    words: dict[str, str]


class ReadingOut(BaseModel):
    device: str
    value: float | None
    unit: str
    said: str


class LimitOut(BaseModel):
    name: str
    field: str
    device: str
    above: float | None
    below: float | None
    dead_band: float
    on_delay_s: float
    off_delay_s: float
    level: str
    unknown: str
    unit: str
    fixed: bool = Field(description="stands in gyrofree.toml, and is changed there")
    user: str
    readings: list[ReadingOut]


class EventOut(BaseModel):
    at_s: float = Field(description="s since 1970")
    device: str
    id: str
    title: str
    level: str
    what: str
    who: str
    text: str


class WayOut(BaseModel):
    name: str
    sent: int
    waiting: int
    given_up: int
    fault: str


class AlarmsOut(BaseModel):
    message: str
    trouble: str
    alarms: list[Point]
    limits: list[LimitOut]
    history: list[EventOut] = Field(description="newest first")
    ways: list[WayOut] = Field(description="how notices leave the bench")
    part: bool = Field(
        default=False, description="of a place that may only watch: the alarms are all there is"
    )


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _at(utc_ns: int) -> float | None:
    return utc_ns / 1e9 if utc_ns else None


def level_of(level: int) -> str:
    """Its word; empty for none."""
    return dict(enumerate(LEVELS, 1)).get(level, "")


def state_of(state: int) -> str:
    """Its word."""
    names = pb.Alarm.State.keys()
    return names[state].removeprefix("STATE_").lower() if 0 <= state < len(names) else "normal"


def point_out(one: pb.Alarm) -> Point:
    """One alarm as JSON."""
    title, text = plain(one.title), plain(one.text, 1000)
    return Point(
        id=plain(one.id),
        device=one.device,
        kind=plain(one.kind),
        title=title,
        text=text,
        page=one.page,
        level=level_of(one.level),
        state=state_of(one.state),
        active=one.active,
        unknown=one.unknown,
        value=_known(one.value),
        limit=_known(one.limit),
        unit=plain(one.unit),
        raised_s=_at(one.raised_utc_ns),
        returned_s=_at(one.returned_utc_ns),
        acknowledged_by=plain(one.acknowledged_by),
        acknowledged_s=_at(one.acknowledged_utc_ns),
        note=one.note,
        shelved_by=plain(one.shelved_by),
        shelved_s=one.shelved_s,
        reason=one.reason,
        times=one.times,
        chattering=one.chattering,
        first_out=one.first_out,
        words=words_in(one.kind, title, text),
    )


def _limit_out(one: pb.AlarmLimit) -> LimitOut:
    return LimitOut(
        name=one.name,
        field=plain(one.field, 300),
        device=one.device,
        above=one.above if one.HasField("above") else None,
        below=one.below if one.HasField("below") else None,
        dead_band=one.dead_band,
        on_delay_s=one.on_delay_s,
        off_delay_s=one.off_delay_s,
        level=one.level,
        unknown=one.unknown,
        unit=one.unit,
        fixed=one.fixed,
        user=plain(one.user),
        readings=[
            ReadingOut(device=r.device, value=_known(r.value), unit=r.unit, said=plain(r.said, 500))
            for r in one.readings
        ],
    )


def _out(reply: pb.AlarmReply) -> AlarmsOut:
    return AlarmsOut(
        message=plain(reply.message, 2000),
        trouble=plain(reply.trouble, 500),
        alarms=[point_out(one) for one in reply.alarms],
        limits=[_limit_out(one) for one in reply.limits],
        history=[
            EventOut(
                at_s=one.utc_ns / 1e9,
                device=one.device,
                id=plain(one.id),
                title=plain(one.title),
                level=level_of(one.level),
                what=plain(one.what),
                who=plain(one.who),
                text=plain(one.text, 1000),
            )
            for one in reply.history
        ],
        ways=[
            WayOut(
                name=plain(one.name),
                sent=one.sent,
                waiting=one.waiting,
                given_up=one.given_up,
                fault=plain(one.fault, 500),
            )
            for one in reply.ways
        ],
    )


def _order(request: Request, action: int, who: Asker, **fields: Any) -> AlarmsOut:
    """HTTP 503 where the service does not answer, 409 where it says no."""
    desk = desk_of(request, who)
    if desk is None:
        raise HTTPException(503, "this dashboard has no connection to the bus")
    try:
        command = pb.AlarmCommand(action=action, user=who.name[:60], **fields)
        reply = desk.alarms(command)
    except NoAnswer as error:
        raise HTTPException(503, str(error)) from None
    except OrderError as error:
        raise HTTPException(409, str(error)) from None
    if not reply.ok:
        raise HTTPException(409, plain(reply.message or "the alarms did not do it", 1000))
    return _out(reply)


@routes.get("/alarms", include_in_schema=False)
def page(request: Request, who: SignedIn) -> HTMLResponse:
    return render(request, "alarms.html", who, levels=LEVELS)


@routes.get("/api/alarms", summary="Alarms, limits and what happened to them")
def alarms(request: Request, who: SignedIn) -> AlarmsOut:
    front = front_of(request)
    if front.store is None or front.desk is None or not front.desk.watching:
        return _order(request, pb.AlarmCommand.ACTION_LIST, who)
    with front.store.lock:
        found, trouble = watched(front.store)
        points = [point_out(one) for one in found]
    return AlarmsOut(
        message=WATCHED, trouble=trouble, alarms=points, limits=[], history=[], ways=[], part=True
    )


@routes.post("/api/alarms/acknowledge", summary="Take note of an alarm (operator)")
def acknowledge(request: Request, body: Acknowledge, who: Operator) -> AlarmsOut:
    action = pb.AlarmCommand.ACTION_ACKNOWLEDGE
    return _order(request, action, who, device=body.device, id=body.id, text=body.note)


@routes.post("/api/alarms/shelve", summary="Silence an alarm for a while (operator)")
def shelve(request: Request, body: Shelve, who: Operator) -> AlarmsOut:
    action, fields = pb.AlarmCommand.ACTION_SHELVE, {"text": body.reason, "seconds": body.seconds}
    return _order(request, action, who, device=body.device, id=body.id, **fields)


@routes.post("/api/alarms/unshelve", summary="End the silence of an alarm (operator)")
def unshelve(request: Request, body: About, who: Operator) -> AlarmsOut:
    action = pb.AlarmCommand.ACTION_UNSHELVE
    return _order(request, action, who, device=body.device, id=body.id)


@routes.post("/api/alarms/limits", summary="Set a limit, or change one of its name (operator)")
def set_limit(request: Request, body: LimitIn, who: Operator) -> AlarmsOut:
    limit = pb.AlarmLimit(**body.model_dump(exclude_none=True))
    return _order(request, pb.AlarmCommand.ACTION_SET_LIMIT, who, limit=limit)


@routes.post("/api/alarms/limits/remove", summary="Remove a limit and its alarms (operator)")
def remove_limit(request: Request, body: RemoveLimit, who: Operator) -> AlarmsOut:
    return _order(request, pb.AlarmCommand.ACTION_REMOVE_LIMIT, who, id=body.name)


@routes.post("/api/alarms/test", summary="Send a notice through every way out (operator)")
def test(request: Request, who: Operator) -> AlarmsOut:
    return _order(request, pb.AlarmCommand.ACTION_TEST, who)
