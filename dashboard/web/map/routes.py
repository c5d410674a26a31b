"""REST of the map: what the file of tiles holds, ranges of its bytes, and where a device and its
filters are, or were in a recording.
"""

import re
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Depends, HTTPException, Query, Request
from fastapi.responses import JSONResponse, Response
from pydantic import BaseModel, Field

from dashboard.data.lateness import Age, lateness
from dashboard.data.live import aged
from dashboard.data.whereabouts import Known, whereabouts
from dashboard.web.api import file_of, reading_of
from dashboard.web.front import Asker, asker, front_of
from dashboard.web.map.archive import ArchiveError, open_archive, tag_of
from dashboard.web.map.recorded import sky_at, ways_of

routes = APIRouter(prefix="/api")

SignedIn = Annotated[Asker, Depends(asker)]
RANGE = re.compile(r"bytes=(\d{1,18})-(\d{1,18})")
MOST_BYTES = 8 << 20  # of one range: a directory or a tile, never more than a part of the file
ANOTHER = "the map file is another one now: load the page again"
UNHEARD = Age(float("nan"), float("nan"), "a replay, or nothing is heard")
NO_FILE = "no map file: [dashboard] map in gyrofree.toml names one"


class MapOut(BaseModel):
    state: Literal["none", "ready", "fault"]
    text: str = Field(description="why there are no tiles; empty: there are")
    kind: str = Field(default="", description="vector or raster")
    zooms: tuple[int, int] = (0, 0)
    bounds: tuple[float, float, float, float] = Field(
        default=(0.0, 0.0, 0.0, 0.0), description="west, south, east, north, deg"
    )
    tag: str = Field(default="", description="of this state of the file; `state` of its tiles")
    attribution: str = ""
    layers: list[str] = []


@routes.get("/map", summary="What the file of map tiles holds, or why there are no tiles")
def about(request: Request, who: SignedIn) -> MapOut:
    path = front_of(request).settings.map
    if path is None:
        return MapOut(state="none", text=NO_FILE)
    try:
        found = open_archive(path)
    except ArchiveError as error:
        return MapOut(state="fault", text=str(error))
    return MapOut(
        state="ready",
        text="",
        kind=found.kind,
        zooms=found.zooms,
        bounds=found.bounds,
        tag=found.tag.strip('"'),
        attribution=found.attribution,
        layers=list(found.layers),
    )


@routes.get(
    "/map/tiles",
    summary="A range of the file of map tiles (PMTiles)",
    status_code=206,
    response_class=Response,
    responses={304: {"description": "not changed"}, 416: {"description": "no such range"}},
)
def tiles(
    request: Request,
    who: SignedIn,
    state: Annotated[str, Query(max_length=64, description="tag of the file; empty: any")] = "",
) -> Response:
    path = front_of(request).settings.map
    if path is None:
        raise HTTPException(404, NO_FILE)
    try:
        size, tag = tag_of(path)
        if state and state != tag.strip('"'):
            raise HTTPException(412, ANOTHER)
        if _has(request.headers.get("if-none-match", ""), tag):
            return Response(status_code=304, headers={"etag": tag})
        first, last = _range(request.headers.get("range", ""), size)
        if request.headers.get("if-range", tag) != tag:
            raise HTTPException(412, ANOTHER)
        with path.open("rb") as file:
            file.seek(first)
            data = file.read(last - first + 1)
    except OSError as error:
        raise HTTPException(503, f"{path.name} cannot be read: {error.strerror}") from None
    if len(data) < last - first + 1:
        raise HTTPException(503, f"{path.name} became shorter while it was read")
    headers = {
        "content-range": f"bytes {first}-{last}/{size}",
        "accept-ranges": "bytes",
        "etag": tag,
        "cache-control": f"private, {'max-age=3600' if state else 'no-cache'}",
    }
    return Response(data, 206, headers, "application/octet-stream")


def _has(tags: str, tag: str) -> bool:
    return tags.strip() == "*" or tag in {one.strip().removeprefix("W/") for one in tags.split(",")}


def _range(text: str, size: int) -> tuple[int, int]:
    """First and last byte; HTTP 416 for anything but one range within the file."""
    found = RANGE.fullmatch(text.strip())
    if found is not None:
        first, last = int(found[1]), min(int(found[2]), size - 1)
        if first <= last < first + MOST_BYTES:
            return first, last
    want = f"want Range: bytes=FIRST-LAST, at most {MOST_BYTES} bytes of {size}"
    raise HTTPException(416, want, {"content-range": f"bytes */{size}"})


@routes.get(
    "/devices/{device}/map", summary="Ways, fixes and places of a device; what is new since asked"
)
def places(
    request: Request,
    device: str,
    who: SignedIn,
    have: Annotated[
        str, Query(max_length=2000, description="NAME:STATE:POINTS of ways known, by commas")
    ] = "",
    since: Annotated[float, Query(description="time of the last fix known, s")] = -1e12,
) -> dict[str, Any]:
    store = front_of(request).store
    if store is None:
        raise HTTPException(503, "this dashboard has no connection to the bus")
    with store.lock:
        found = store.device(device)
        if found is None:
            raise HTTPException(404, "nothing has been heard of such a device")
        late = lateness(store, found)
        old = UNHEARD if late is None else Age(late.age_s, late.bound_s, late.why)
        return whereabouts(found, _known(have), since) | aged(old)


def _known(text: str) -> dict[str, Known]:
    found = {}
    for part in filter(None, text.split(",")):
        name, _, rest = part.partition(":")
        state, _, points = rest.rpartition(":")
        if not points.isdigit() or len(points) > 9:
            raise HTTPException(422, f"have {part[:60]!r}: want NAME:STATE:POINTS")
        found[name] = Known(state, int(points))
    return found


@routes.get("/sessions/{session}/map", summary="Where filters and receiver were in a recording")
def recorded_places(request: Request, session: str, who: SignedIn) -> Response:
    """202 with the share done while the recording is still being read."""
    curves, reading = reading_of(front_of(request), session)
    if reading is not None and reading.fault:
        raise HTTPException(409, f"session {session} cannot be drawn: {reading.fault}")
    done = 1.0 if reading is None else reading.done
    if curves is None:
        return JSONResponse({"state": "reading", "done": done}, 202)
    state = "done" if reading is None else "reading"
    return JSONResponse({"state": state, "done": done, "ways": ways_of(curves)})


@routes.get("/sessions/{session}/sky", summary="Satellites in view at a moment of a recording")
def recorded_sky(
    request: Request,
    session: str,
    who: SignedIn,
    at_s: Annotated[float, Query(ge=0, le=1e9, description="s from the session's start")] = 0.0,
    dark: bool = False,
) -> dict[str, Any] | None:
    """None where no receiver of the recording says which satellites it sees."""
    front = front_of(request)
    path = file_of(front, session)
    try:
        return sky_at(path, at_s, dark)
    except OSError as error:
        raise HTTPException(409, f"session {session}: {error.strerror}") from None
