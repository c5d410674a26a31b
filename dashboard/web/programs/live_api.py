"""Live values for programs: the newest by REST, and a stream of them as server-sent events."""

import json
import time
from collections import Counter
from collections.abc import AsyncIterator
from typing import Annotated

from fastapi import APIRouter, Depends, HTTPException, Query, Request
from fastapi.responses import StreamingResponse
from pydantic import Field

from dashboard.data.live import ESTIMATED, Live, live_aged
from dashboard.data.store import Store
from dashboard.web.front import Asker, asker, front_of, still_may
from dashboard.web.schemas import AgedOut

routes = APIRouter(prefix="/api/devices/{device}")

SignedIn = Annotated[Asker, Depends(asker)]
Estimator = Annotated[str, Query(max_length=64, description="its name; empty: the leading one")]
Three = list[float | None]
STREAMS, STREAMS_EACH = 64, 8  # at a time: of all, of one user
QUIET_S = 10.0  # without an event after which a comment says that the line still stands
RIGHTS_S = 1.0  # between two looks at rights that another process may have changed


class _Said(AgedOut):
    device: str
    estimator: str
    utc_s: float = Field(description="of the sample by its gateway's clock, s since 1970")
    age_s: float = Field(description="since it arrived, s")
    stale: bool = Field(description="too old to be the present")
    simulated: bool


class RateOut(_Said):
    omega_radps: Three = Field(description="of the body, x y z; null: not known")
    sigma_radps: Three
    sight: list[str] = Field(description="valid, ambiguous (the sign is not known) or blind")
    why: str = Field(description="why a part is not valid")
    still: bool
    alpha_radps2: Three | None
    f_mps2: Three | None
    aid: str


class AttitudeOut(_Said):
    q_nb: Three | None = Field(description="w x y z, body to north-east-down; null: not known")
    heading_known: bool
    inclination_sigma_rad: float | None


class NavOut(_Said):
    mode: str
    why: str
    latitude_deg: float | None
    longitude_deg: float | None
    height_m: float | None
    v_n_mps: Three | None
    q_nb: Three | None
    sigma_attitude_rad: Three | None
    sigma_v_n_mps: Three | None
    sigma_position_ned_m: Three | None
    fix_age_s: float | None


@routes.get("/rate", summary="The newest rate of a device; null where it is not known")
def rate(request: Request, device: str, who: SignedIn, estimator: Estimator = "") -> RateOut:
    return RateOut(**_newest(request, device, "rate", estimator))


@routes.get("/attitude", summary="The newest attitude of a device")
def attitude(
    request: Request, device: str, who: SignedIn, estimator: Estimator = ""
) -> AttitudeOut:
    return AttitudeOut(**_newest(request, device, "attitude", estimator))


@routes.get("/nav", summary="The newest navigation solution of a device")
def nav(request: Request, device: str, who: SignedIn, estimator: Estimator = "") -> NavOut:
    return NavOut(**_newest(request, device, "nav", estimator))


@routes.get(
    "/stream",
    summary="Rate, attitude and place as server-sent events",
    response_class=StreamingResponse,
    responses={200: {"content": {"text/event-stream": {}}}, 429: {"description": "too many"}},
)
async def stream(
    request: Request,
    device: str,
    who: SignedIn,
    topics: Annotated[str, Query(max_length=40, description="separated by commas")] = "rate",
    estimator: Estimator = "",
    rate_hz: Annotated[
        float, Query(gt=0.0, le=50.0, description="events per second at most")
    ] = 10.0,
) -> StreamingResponse:
    """Each event is named as its topic and holds what the GET of that topic gives; none is sent
    twice. A device that says nothing sends nothing but comments. It ends with the right to listen.
    """
    store, chosen = _store(request), tuple(dict.fromkeys(topics.split(",")))
    for topic in chosen:
        if topic not in ESTIMATED:
            raise HTTPException(422, f"topic {topic[:40]!r}: want some of {', '.join(ESTIMATED)}")
    with store.lock:
        if store.device(device) is None:
            raise HTTPException(404, "nothing has been heard of such a device")
    listeners: Counter[str] = request.app.state.listeners
    if listeners[who.name] >= STREAMS_EACH or listeners.total() >= STREAMS:
        text = f"at most {STREAMS_EACH} streams of a user and {STREAMS} in all: end one"
        raise HTTPException(429, text, {"retry-after": "5"})
    events = _events(request, store, who, device, chosen, estimator, 1.0 / rate_hz)
    return StreamingResponse(events, media_type="text/event-stream")


async def _events(
    request: Request,
    store: Store,
    who: Asker,
    device: str,
    topics: tuple[str, ...],
    estimator: str,
    period_s: float,
) -> AsyncIterator[str]:
    listeners: Counter[str] = request.app.state.listeners
    listeners[who.name] += 1
    sent: dict[str, float] = {}
    spoke = looked = due = time.monotonic()
    bell = front_of(request).gate.bell
    seen = bell.rung
    try:
        yield "retry: 2000\n\n"
        while True:
            now, rung = time.monotonic(), bell.rung
            if now - looked > RIGHTS_S or rung != seen:
                looked, seen = now, rung
                if not still_may(request, who):
                    yield 'event: end\ndata: {"why": "signed out, revoked or past its end"}\n\n'
                    return
            for topic in topics if now >= due else ():
                with store.lock:
                    found = store.device(device)
                    said = live_aged(store, found, topic, estimator) if found else None
                if said is not None and sent.get(topic) != said["utc_s"]:
                    sent[topic], spoke = said["utc_s"], now
                    yield f"event: {topic}\ndata: {json.dumps(said, allow_nan=False)}\n\n"
            if now - spoke > QUIET_S:
                spoke = now
                yield ": nothing new\n\n"
            due = due if now < due else now + period_s
            await bell.wait(seen, min(due - now, RIGHTS_S))
    finally:
        listeners[who.name] -= 1
        if not listeners[who.name]:
            del listeners[who.name]


def _store(request: Request) -> Store:
    store = front_of(request).store
    if store is None:
        raise HTTPException(503, "this dashboard has no connection to the bus")
    return store


def _newest(request: Request, device: str, topic: str, estimator: str) -> Live:
    store = _store(request)
    with store.lock:
        found = store.device(device)
        if found is None:
            raise HTTPException(404, "nothing has been heard of such a device")
        said = live_aged(store, found, topic, estimator)
        if said is not None:
            return said
        names = ", ".join(found.estimators(topic))
    whom = f" by {estimator!r}" if estimator else ""
    there = f"; there are {names}" if names else ""
    raise HTTPException(404, f"nothing has been heard of its {topic}{whom}{there}")
