"""REST of the live page: a person's notes on a device, what he last had on the page, and the
emergency stop of tables that are driven.
"""

import time
from typing import Annotated, Literal

from fastapi import APIRouter, Depends, HTTPException, Request
from pydantic import BaseModel, Field

from dashboard.data.alarms import drives
from dashboard.data.channels import channels
from dashboard.data.store import Store
from dashboard.web.auth import Role
from dashboard.web.front import Asker, asker, desk_of, front_of, needs, seat_of
from dashboard.web.schemas import Lines, Strict
from dashboard.web.views import LONGEST
from logs.figures.quantity import HINTS
from messages.bus.orders import OrderError
from messages.contract import gyrofree_pb2 as pb
from messages.text import plain

routes = APIRouter(prefix="/api")
SWITCH_OFF = "THE TABLE MAY STILL TURN, switch it off by hand"

SignedIn = Annotated[Asker, Depends(asker)]
Same = Annotated[Asker, Depends(needs(Role.viewer))]
Operator = Annotated[Asker, Depends(needs(Role.operator))]


class NoteIn(Strict):
    text: Lines = Field(default="", max_length=2000)
    mark: bool = Field(default=False, description="a moment, which may have no text")


class NoteOut(BaseModel):
    at_s: float | None = Field(
        description="s since the recording or the replay began; none without one"
    )
    message: str


class TableOut(BaseModel):
    device: str
    table: str = Field(description="its name")
    rate_radps: float = Field(description="that it was last said to turn at")
    silent_s: float = Field(description="since the last word of the procedures")


class StopOut(BaseModel):
    message: str


class ViewIn(Strict):
    view: str = Field(max_length=LONGEST, description="the page's link after the question mark")
    page: Literal["live", "session"] = Field(default="live", description="session: any of them")


class FlowOut(BaseModel):
    updates_hz: float = Field(description="that this browser took, over the last 10 s")
    bytes_per_s: float


class ViewOut(BaseModel):
    view: str


class NamedOut(BaseModel):
    name: str
    unit: str
    who: str = Field(description="an estimator or an instrument; of a function, what it does")


class ChannelsOut(BaseModel):
    channels: list[NamedOut] = Field(description="what an expression may name")
    functions: list[NamedOut]


@routes.get("/devices/{device}/channels", summary="What an expression over a device may name")
def named_channels(request: Request, device: str, who: SignedIn) -> ChannelsOut:
    store = front_of(request).store
    if store is None:
        raise HTTPException(503, "this dashboard has no connection to the bus")
    with store.lock:
        found = store.device(device)
        if found is None:
            raise HTTPException(404, "nothing has been heard of such a device")
        known = list(channels(found).values())
    return ChannelsOut(
        channels=[NamedOut(name=one.name, unit=one.unit, who=one.who) for one in known],
        functions=functions(),
    )


def functions() -> list[NamedOut]:
    """What an expression may call."""
    return [NamedOut(name=name, unit="", who=hint) for name, hint in HINTS.items()]


@routes.post("/devices/{device}/notes", summary="Keep a note or a mark of this moment (operator)")
def note(request: Request, device: str, body: NoteIn, who: Operator) -> NoteOut:
    front = front_of(request)
    if not body.mark and not body.text.strip():
        raise HTTPException(422, "a note wants words; a mark may be without")
    if front.store is None or front.desk is None:
        raise HTTPException(503, "this dashboard has no connection to the bus")
    with front.store.lock:
        found = front.store.device(device)
        if found is None:
            raise HTTPException(404, "nothing has been heard of such a device")
        at_ns = found.utc0_ns + int(found.t_newest * 1e9) if found.rings else time.time_ns()
        at_s = front.store.recorded_s(device)
        recorded = recording(front.store)
    kind = pb.Note.KIND_MARK if body.mark else pb.Note.KIND_NOTE
    said = pb.Note(
        header=pb.Header(device=device, utc_ns=at_ns),
        text=body.text.strip(),
        author=who.name,
        kind=kind,
        at_utc_ns=at_ns,
    )
    try:
        front.desk.note(device, said)
    except OrderError as error:
        raise HTTPException(503, f"it was not kept: {error}") from None
    what = "Mark" if body.mark else "Note"
    if at_s is None:
        return NoteOut(at_s=None, message=f"{what} shown; not kept: nothing is being recorded")
    kept = "kept" if recorded else "shown; a replay is not recorded"
    return NoteOut(at_s=at_s, message=f"{what} at {at_s:.1f} s: {kept}")


@routes.get("/tables", summary="Tables that a procedure drives now")
def tables(request: Request, who: SignedIn) -> list[TableOut]:
    store = front_of(request).store
    if store is None:
        return []
    with store.lock:
        found = [
            (store.devices[name], store.devices[name].get("procedure")) for name in store.names()
        ]
        return [
            TableOut(
                device=device.name,
                table=plain(heard.message.table),
                rate_radps=heard.message.table_radps,
                silent_s=heard.age(),
            )
            for device, heard in found
            if heard is not None and drives(heard.message)
        ]


@routes.post("/devices/{device}/stop", summary="EMERGENCY STOP of its table (operator)")
def stop(request: Request, device: str, who: Operator) -> StopOut:
    """The table stops at once and the procedure ends; HTTP 503 where that is not certain."""
    desk = desk_of(request, who)
    if desk is None:
        raise HTTPException(503, f"{SWITCH_OFF}: this dashboard has no connection to the bus")
    action = pb.ProcedureCommand.ACTION_STOP
    try:
        reply = desk.procedure(pb.ProcedureCommand(action=action, device=device, user=who.name))
    except (OrderError, ValueError) as error:
        raise HTTPException(503, f"{SWITCH_OFF}: {error}") from None
    if not reply.ok:
        raise HTTPException(503, reply.message)
    return StopOut(message=reply.message)


def recording(store: Store) -> bool:
    """Is a recording going on, as last heard?"""
    return store.recorder is not None and store.recorder.message.recording


@routes.get("/me/flow", summary="What your open scenes get, each: updates and bytes per second")
def flow(request: Request, who: SignedIn) -> list[FlowOut]:
    mine = request.app.state.flows.get(seat_of(request, who).id, [])
    rates = [one.rates() for one in list(mine)]
    return [FlowOut(updates_hz=hz, bytes_per_s=bytes_per_s) for hz, bytes_per_s in rates]


@routes.get("/me/view", summary="What you last had on the live page")
def view(request: Request, who: SignedIn) -> ViewOut:
    return ViewOut(view=front_of(request).views.of(who.name))


@routes.post("/me/view", summary="Remember what you have on the live page, or on those of sessions")
def keep_view(request: Request, body: ViewIn, who: Same) -> ViewOut:
    views = front_of(request).views
    try:
        views.keep(who.name, body.view, body.page)
    except ValueError as error:
        raise HTTPException(422, str(error)) from None
    except OSError as error:
        raise HTTPException(503, f"your view could not be kept: {error.strerror}") from None
    return ViewOut(view=views.of(who.name, body.page))
