"""REST under /api; /api/openapi.json describes it, /api/docs shows that. SI units, times in s since
1970.
"""

from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

from fastapi import APIRouter, Depends, HTTPException, Query, Request
from fastapi.responses import FileResponse

from dashboard.data.alarms import alarms, bench_alarms
from dashboard.data.lateness import Age, lateness, said_by
from dashboard.data.live import aged
from dashboard.data.store import Store
from dashboard.web.auth import Role
from dashboard.web.control import ControlError
from dashboard.web.front import Asker, Front, asker, desk_of, front_of, needs
from dashboard.web.readings import Reading
from dashboard.web.schemas import (
    DeviceOut,
    Health,
    Me,
    RecordingOut,
    SessionOut,
    StartRecording,
    StartReplay,
    alarms_out,
    device_out,
    recorder_fields,
    session_out,
)
from messages.bus.orders import OrderError
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import RECORDER, STATUS
from messages.text import composed
from sessions.library.catalogue import SessionError, SessionInfo
from sessions.library.curves import Curves

routes = APIRouter(prefix="/api")
RECORDER_STALE_S = 5.0

SignedIn = Annotated[Asker, Depends(asker)]
Operator = Annotated[Asker, Depends(needs(Role.operator))]


def list_sessions(front: Front, text: str = "") -> list[SessionOut]:
    """Sessions whose id, device, note, source or state contains all words of `text`; newest
    first.
    """
    try:
        now = recording_out(front)
        rows = [
            session_out(info, now.session if now.recording else "")
            for info in front.catalogue.list()
        ]
    except SessionError as error:
        raise HTTPException(503, str(error)) from None
    words = composed(text).lower().split()
    return [row for row in rows if all(word in _haystack(row) for word in words)]


def _haystack(row: SessionOut) -> str:
    day = datetime.fromtimestamp(row.start_s, UTC).strftime("%Y-%m-%d")
    words = [
        row.id,
        day,
        *row.devices,
        *row.sources,
        row.note,
        row.state,
        row.title,
        *row.tags,
        row.outcome,
    ]
    return " ".join(words).lower()


def find_session(front: Front, session: str) -> SessionInfo:
    """One session; HTTP 404 for what is no id or does not exist."""
    try:
        return front.catalogue.get(session)
    except SessionError as error:
        raise HTTPException(
            404, str(error).replace(str(front.catalogue.root), "the recordings")
        ) from None


def file_of(front: Front, session: str) -> Path:
    """The MCAP file of a session; HTTP 404 when there is none, 409 when it is unreadable or still
    written.
    """
    info = find_session(front, session)
    if info.path is None:
        raise HTTPException(409, f"session {session} has no readable recording")
    if info.state == "open":
        raise HTTPException(409, f"session {session} is being recorded: stop the recording first")
    return info.path


def reading_of(front: Front, session: str) -> tuple[Curves | None, Reading | None]:
    """A session's curves as far as they are read, and the reading that goes on or failed; HTTP 404
    and 409 as file_of.
    """
    try:
        return front.readings.get(file_of(front, session))
    except OSError as error:
        raise HTTPException(409, f"session {session}: {error.strerror}") from None


def recording_out(front: Front) -> RecordingOut:
    """State of recorder and replay, as last heard."""
    replayed = front.replay.running() if front.replay else None
    out = RecordingOut(
        available=False,
        recording=False,
        session="",
        seconds=0,
        messages=0,
        bytes=0,
        lost=0,
        message="the recorder has not been heard of",
        site_age_why="the recorder has not been heard of",
        replaying=replayed.parent.name if replayed else "",
        alarms=[],
    )
    heard = front.store.recorder if front.store else None
    if front.store is not None:
        with front.store.lock:
            out.alarms = alarms_out(bench_alarms(front.store))
    if heard is None:
        return out
    age = heard.age()
    with front.store.lock:
        out = out.model_copy(update=aged(_said_at(front.store, heard.message)))
    if age > RECORDER_STALE_S:
        return out.model_copy(update={"message": f"the recorder has been silent for {age:.0f} s"})
    return out.model_copy(update={"available": True} | recorder_fields(heard.message))


def _said_at(store: Store, status: pb.RecorderStatus) -> Age:
    """How old the recorder's word is. Call under the store's lock."""
    found = (one for one in store.presence.all() if one.role == RECORDER and one.lives)
    said_s = status.header.utc_ns * 1e-9 + status.clock_offset_s  # it counts on without steps
    return said_by(store, next(found, None), RECORDER, said_s)


def order_recorder(
    request: Request, who: Asker, action: int, name: str = "", note: str = ""
) -> RecordingOut:
    """Start or stop; HTTP 503 when the recorder does not answer, 409 when it, or who has the
    command, says no.
    """
    front, desk = front_of(request), desk_of(request, who)
    if desk is None:
        raise HTTPException(503, "this dashboard has no connection to a recorder")
    try:
        command = pb.RecorderCommand(action=action, name=name, note=note, user=who.name)
        status = desk.recorder(command)
    except OrderError as error:
        raise HTTPException(409 if desk.barred() else 503, str(error)) from None
    if status.recording != (action == pb.RecorderCommand.ACTION_START):
        raise HTTPException(409, status.message or "the recorder did not do it")
    if front.store is not None:  # what it says next on the bus may take a second
        front.store.put(STATUS, "", "", status)
    return recording_out(front).model_copy(update={"available": True} | recorder_fields(status))


def start_replay(front: Front, session: str, speed: float, at_s: float = 0.0) -> RecordingOut:
    """Send a recording through the bus again; HTTP 503 where there is no replay, 409 when it cannot
    start.
    """
    path = file_of(front, session)
    if front.replay is None:
        raise HTTPException(503, f"this dashboard cannot replay; run `gyrofree replay {session}`")
    try:
        front.replay.start(path, speed, at_s)
    except ControlError as error:
        raise HTTPException(409, str(error)) from None
    return recording_out(front)


@routes.get("/health", summary="Sign of life; needs no sign-in")
def health(request: Request) -> Health:
    front = front_of(request)
    return Health(status="ok", scene=front.scene_port() > 0, bus=front.desk is not None)


@routes.get("/me", summary="The signed-in user, and the CSRF token of the sign-in")
def me(who: SignedIn) -> Me:
    return Me(user=who.name, role=who.role.name, csrf=who.session.csrf)


@routes.get("/devices", summary="All devices with the state of their line and their estimators")
def devices(request: Request, who: SignedIn) -> list[DeviceOut]:
    front = front_of(request)
    if front.store is None:
        return []
    with front.store.lock:
        found = [front.store.devices[name] for name in front.store.names()]
        return [
            device_out(
                device,
                front.settings.stale_s,
                alarms(front.store, device),
                lateness(front.store, device),
            )
            for device in found
            if device.spoken_of
        ]


@routes.get("/recording", summary="State of the recorder and of a replay")
def recording(request: Request, who: SignedIn) -> RecordingOut:
    return recording_out(front_of(request))


@routes.post("/recording/start", summary="Begin a recording (operator)")
def start_recording(request: Request, body: StartRecording, who: Operator) -> RecordingOut:
    action = pb.RecorderCommand.ACTION_START
    return order_recorder(request, who, action, body.name, body.note)


@routes.post("/recording/stop", summary="End the recording (operator)")
def stop_recording(request: Request, who: Operator) -> RecordingOut:
    return order_recorder(request, who, pb.RecorderCommand.ACTION_STOP)


@routes.get("/sessions", summary="Recorded sessions, newest first")
def sessions(
    request: Request, who: SignedIn, q: Annotated[str, Query(max_length=200)] = ""
) -> list[SessionOut]:
    return list_sessions(front_of(request), q)


@routes.get("/sessions/{session}", summary="One recorded session")
def session(request: Request, session: str, who: SignedIn) -> SessionOut:
    now = recording_out(front_of(request))
    return session_out(
        find_session(front_of(request), session), now.session if now.recording else ""
    )


@routes.get("/sessions/{session}/download", summary="Its MCAP file", response_class=FileResponse)
def download(request: Request, session: str, who: SignedIn) -> FileResponse:
    path = file_of(front_of(request), session)
    return FileResponse(path, media_type="application/octet-stream", filename=f"{session}.mcap")


@routes.post("/sessions/{session}/replay", summary="Send it through the bus again (operator)")
def replay(request: Request, session: str, body: StartReplay, who: Operator) -> RecordingOut:
    return start_replay(front_of(request), session, body.speed, body.t)


@routes.post("/replay/stop", summary="End the replay (operator)")
def stop_replay(request: Request, who: Operator) -> RecordingOut:
    front = front_of(request)
    if front.replay is not None:
        front.replay.stop()
    return recording_out(front)
