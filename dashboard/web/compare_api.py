"""REST and page for sessions over one another: rates, errors, angles, tracks on one axis of
time.
"""

import math
from typing import Annotated, Any

from fastapi import APIRouter, HTTPException, Query, Request
from fastapi.responses import HTMLResponse, JSONResponse, Response

from dashboard.web import api
from dashboard.web.api import SignedIn, reading_of
from dashboard.web.desk_api import ChannelsOut, NamedOut, functions
from dashboard.web.front import Front, front_of
from dashboard.web.pages import render
from dashboard.web.schemas import session_out
from logs.figures.expression import many
from logs.figures.names import line_title
from messages.text import plain
from sessions.library.annotations import read_annotations
from sessions.library.compare import METHODS, MOST, CompareError, Comparison, as_dict, compare
from sessions.library.derived import channels
from sessions.library.overlay import POINTS, drawing
from sessions.recording.manifest import SessionError

routes = APIRouter()
# lists of differences, and what in them names a line
MEANT = {"differences": ("line", "against"), "track_differences": ("track", "against")}
Ids = Annotated[
    str, Query(max_length=400, description="ids of one to four sessions, separated by commas")
]
Offsets = Annotated[
    str, Query(max_length=400, description="offsets by hand, as ID:seconds, separated by commas")
]


@routes.get("/compare", include_in_schema=False)
def compare_page(request: Request, who: SignedIn, ids: Ids = "") -> HTMLResponse:
    front = front_of(request)
    chosen = _ids(ids)
    if not chosen:
        raise HTTPException(422, "choose two to four sessions in the list of sessions")
    rows = [session_out(api.find_session(front, session)) for session in chosen]
    return render(request, "compare.html", who, rows=rows, methods=METHODS)


@routes.get(
    "/api/compare", summary="Up to four sessions aligned, their differences, and lines to draw"
)
def comparison(
    request: Request,
    who: SignedIn,
    ids: Ids,
    align: Annotated[str, Query(max_length=10)] = "auto",
    offsets: Offsets = "",
    estimator: Annotated[str, Query(max_length=32)] = "",
    begin: Annotated[
        float | None, Query(description="of the window, s on the first session's time")
    ] = None,
    end: float | None = None,
    points: Annotated[int, Query(ge=100, le=2000, description="per line")] = POINTS,
    everything: Annotated[
        bool, Query(description="all estimators, not the leading ones only")
    ] = False,
    cursors: Annotated[
        str, Query(max_length=60, description="begin_end of a stretch to be measured, s")
    ] = "",
    derived: Annotated[
        str, Query(max_length=2000, description="expressions over channels, `;` between them")
    ] = "",
) -> Response:
    """202 with the share done while a recording is still being read; 409 for sessions that cannot
    be compared.
    """
    front = front_of(request)
    chosen = _ids(ids)
    curves, done = [], []
    for session in chosen:
        found, reading = reading_of(front, session)
        if reading is not None and reading.fault:
            raise HTTPException(409, f"session {session} cannot be drawn: {reading.fault}")
        if reading is not None:
            done.append(reading.done)
        curves.append(found)
    share = min(done, default=1.0)
    ready = [one for one in curves if one is not None]
    if len(ready) < len(chosen):
        return JSONResponse({"state": "reading", "done": share}, 202)
    try:
        result = compare(ready, align, _offsets(offsets), estimator)
    except CompareError as error:
        raise HTTPException(409, str(error)) from None
    window = [value if value is None or math.isfinite(value) else None for value in (begin, end)]
    own = many(derived)
    drawn = drawing(result, window[0], window[1], points, everything, _cursors(cursors), own)
    _add_notes(front, result, drawn)
    facts = as_dict(result)
    table = {name: facts[name] for name in ("bin_s", "differences", "track_differences")}
    keys = (row[end] for name in MEANT for row in facts[name] for end in MEANT[name])
    table["titles"] = {key: line_title(key.rpartition("/")[2]) for key in keys}
    errors = [one["errors"] for one in facts["sessions"]]
    return JSONResponse(
        {"state": "reading" if done else "done", "done": share, "errors": errors} | table | drawn
    )


@routes.get("/api/sessions/{session}/channels", summary="What an expression over it may name")
def session_channels(request: Request, session: str, who: SignedIn) -> ChannelsOut:
    """Empty while the recording is still being read."""
    found, _ = reading_of(front_of(request), session)
    known = channels(found).values() if found is not None else ()
    return ChannelsOut(
        channels=[NamedOut(name=one.name, unit=one.unit, who=one.who) for one in known],
        functions=functions(),
    )


def _ids(text: str) -> list[str]:
    chosen = [part.strip() for part in text.split(",") if part.strip()]
    if len(chosen) > MOST:
        raise HTTPException(
            422, f"{len(chosen)} sessions: at most {MOST} are drawn over one another"
        )
    if len(set(chosen)) < len(chosen):
        raise HTTPException(422, "the same session twice")
    return chosen


def _cursors(text: str) -> tuple[float, float] | None:
    if not text:
        return None
    try:
        a, b = map(float, text.split("_"))
    except ValueError:
        a = b = math.nan
    if not math.isfinite(a + b):
        raise HTTPException(422, f"cursors {text[:60]!r}: want begin_end, s")
    return min(a, b), max(a, b)


def _offsets(text: str) -> dict[str, float]:
    found = {}
    for part in filter(None, text.split(",")):
        session, _, seconds = part.rpartition(":")
        try:
            found[session] = float(seconds)
        except ValueError:
            found[session] = math.nan
        if not session or not math.isfinite(found[session]):
            raise HTTPException(422, f"offset {part[:60]!r}: want ID:seconds")
    return found


def _add_notes(front: Front, result: Comparison, drawn: dict[str, Any]) -> None:
    """Remarks that were added later stand beside the recorded ones."""
    for one, out in zip(result.sessions, drawn["sessions"], strict=True):
        try:
            notes = read_annotations(front.catalogue.root / one.curves.session).notes
        except SessionError:
            notes = []
        out["marks"] += [
            {"t": note.at_s + one.offset_s, "text": note.text, "author": note.author}
            for note in notes
            if note.at_s is not None
        ]
        for mark in out["marks"]:  # also what was recorded from the bus
            mark |= {key: plain(mark[key]) for key in ("text", "author") if key in mark}
