"""The page of places, and REST of it: who is there, whose clock is off, who looks."""

from typing import Annotated

from fastapi import APIRouter, Depends, HTTPException, Request
from fastapi.responses import HTMLResponse
from pydantic import BaseModel, Field

from dashboard.data.lateness import Lateness, lateness
from dashboard.data.places import people_said, places
from dashboard.data.store import Store
from dashboard.web.front import Asker, asker, front_of
from dashboard.web.pages import render
from dashboard.web.schemas import LateOut, late_out

routes = APIRouter()

SignedIn = Annotated[Asker, Depends(asker)]


class ServiceOut(BaseModel):
    role: str
    name: str = Field(description="among those of its place")
    state: str = Field(description="running, hung, frozen, gone, ended, or not known")
    state_said: str = Field(description="the same, and for how long, where that is a fault")
    since_s: float | None = Field(description="that it began, s since 1970; null: not said")
    silent_s: float = Field(description="since its last beat, of two a second")
    loop: str = Field(description="its loop that stands longest, for what it may; empty: unknown")
    doing: str = Field(description="what that loop's turn is for, where it says so")
    turn_ago_s: float | None = Field(description="since the last turn of it; null: unknown")
    turn_most_s: float | None = Field(description="what a turn may take; beyond it is hung")
    devices: list[str] = Field(description="boards that it has")
    waits: list[str] = Field(description="of these, those that another gateway publishes")
    clock_ahead_s: float | None = Field(description="its clock minus the site's; null: unknown")
    clock_bound_s: float | None = Field(description="the most that this may be wrong by")
    clock: str = Field(description="the same in words")
    certificate_ends_s: float | None
    version: str


class PlaceOut(BaseModel):
    name: str
    own: bool = Field(description="the place of this dashboard")
    state: str = Field(description="the worst of its services, or out of reach")
    people: dict[str, int] = Field(description="who look at its pages, by role")
    people_said: str
    devices: list[str]
    services: list[ServiceOut]


class BoardOut(BaseModel):
    name: str
    gateway: str = Field(description="the place whose gateway publishes it; empty: none is known")
    twins: str = Field(description="gateways that want it, where there are several; else empty")
    late: LateOut | None = Field(description="how old its picture is; null: nothing is heard")


class PlacesOut(BaseModel):
    sees: bool = Field(description="whether it can be told now who is there")
    places: list[PlaceOut]
    boards: list[BoardOut]


@routes.get("/places", include_in_schema=False)
def page(request: Request, who: SignedIn) -> HTMLResponse:
    return render(request, "places.html", who)


@routes.get("/api/places", summary="Who is there: places, services, boards, and how many look")
def all_places(request: Request, who: SignedIn) -> PlacesOut:
    store = front_of(request).store
    if store is None:
        raise HTTPException(503, "this dashboard has no connection to the bus")
    with store.lock:
        found = [
            PlaceOut(**one, people_said=people_said(one["people"], one["state"]))
            for one in places(store.presence)
        ]
        return PlacesOut(sees=store.presence.sees, places=found, boards=_boards(store))


def _boards(store: Store) -> list[BoardOut]:
    """Those that are heard, and those that a gateway says it has."""
    presence, twins = store.presence, store.presence.twins()
    live = {name for name, one in store.devices.items() if lateness(store, one) is not None}
    named = {device for one in presence.all() for device in one.beat.devices}
    boards = []
    for name in sorted(live | named | set(twins)):
        gateway, device = presence.gateway_of(name), store.devices.get(name)
        late: Lateness | None = None if device is None else lateness(store, device)
        boards.append(
            BoardOut(
                name=name,
                gateway="" if gateway is None else gateway.place,
                twins=twins.get(name, ""),
                late=late_out(late),
            )
        )
    return boards
