"""REST under /api; /api/openapi.json describes it, /api/docs shows that. SI units, times in s since
1970.
"""

from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any

from fastapi import APIRouter, Depends, HTTPException, Query, Request
from fastapi.responses import FileResponse
from pydantic import BaseModel, ConfigDict, Field

from dashboard.data.device import Device
from dashboard.web.auth import Role
from dashboard.web.control import ControlError
from dashboard.web.front import Asker, Front, asker, front_of, needs
from messages.bus.orders import OrderError
from messages.contract import gyrofree_pb2 as pb
from sessions.library.catalogue import SessionError, SessionInfo

routes = APIRouter(prefix="/api")
RECORDER_STALE_S = 5.0

SignedIn = Annotated[Asker, Depends(asker)]
Operator = Annotated[Asker, Depends(needs(Role.operator))]


class Strict(BaseModel):
    """A body: no unknown keys, no conversions (true is no number), no NaN and no infinity."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)


class Health(BaseModel):
    status: str
    scene: bool
    bus: bool


class Me(BaseModel):
    user: str
    role: str
    csrf: str = Field(description="to send as X-CSRF-Token with every order")


class EstimatorOut(BaseModel):
    name: str
    state: str
    message: str
    us_per_sample: float
    gaps: int


class DeviceOut(BaseModel):
    name: str
    source: str = Field(description="hardware, simulated, emulated, played or unknown")
    age_s: float = Field(description="since its last word, s")
    stale: bool
    connected: bool
    port: str
    message: str = Field(description="what is wrong and what to do; empty when all is well")
    sample_rate_hz: float
    latency_p99_s: float
    clock_skew_ppm: float
    lost_frames: int
    lost_samples: int
    bad_chunks: int
    reconnects: int
    reboots: int
    firmware: str
    uid: str
    axes: int
    estimators: list[EstimatorOut]


class RecordingOut(BaseModel):
    available: bool = Field(description="the recorder was heard of in the last seconds")
    recording: bool
    session: str
    seconds: float
    messages: int
    bytes: int
    lost: int
    message: str
    replaying: str = Field(description="id of the session being replayed, or empty")


class StartRecording(Strict):
    name: str = Field(default="", max_length=32, pattern=r"^([a-z0-9][a-z0-9_-]*)?$")
    note: str = Field(default="", max_length=2000)


class StartReplay(Strict):
    speed: float = Field(default=1.0, ge=0.1, le=100.0)
    t: float = Field(default=0.0, ge=0.0, le=1e7, description="begin at this second of it")


class SessionOut(BaseModel):
    id: str
    devices: list[str]
    sources: list[str]
    start_s: float = Field(description="s since 1970, UTC")
    seconds: float
    state: str = Field(
        description="recording, open (cut off, not recovered yet), closed, recovered or unreadable"
    )
    bytes: int
    messages: int
    lost: int
    completeness: float | None = Field(
        description="received share of what is known to have been sent, 0 to 1"
    )
    note: str
    title: str = Field(description="by people, as are tags and outcome")
    tags: list[str]
    outcome: str
    problem: str
    downloadable: bool


def device_out(device: Device, stale_s: float) -> DeviceOut:
    """One device as JSON; a device that never sent a link status has zeros and says so in
    `message`. Call under the store's lock.
    """
    heard, described = device.get("link"), device.get("board")
    link = heard.message if heard else pb.LinkStatus()
    board = described.message if described else pb.BoardInfo()
    age_s = heard.age() if heard else min(latest.age() for latest in device.latest.values())
    stale = age_s > stale_s
    source = link.header.source or board.header.source
    states = [
        (name, device.get("estimator", name).message)
        for name in sorted(device.estimators("estimator"))
    ]
    estimators = [
        EstimatorOut(
            name=name, state=s.state, message=s.message, us_per_sample=s.us_per_sample, gaps=s.gaps
        )
        for name, s in states
    ]
    return DeviceOut(
        name=device.name,
        source=pb.Source.Name(source).removeprefix("SOURCE_").lower()
        if source in pb.Source.values()
        else "unknown",
        age_s=age_s,
        stale=stale,
        connected=link.connected and not stale,
        port=link.port,
        message=link.message if heard else "no link status yet",
        sample_rate_hz=link.sample_rate_hz,
        latency_p99_s=link.latency_p99_s,
        clock_skew_ppm=link.clock_skew_ppm,
        lost_frames=link.lost_frames,
        lost_samples=link.lost_samples,
        bad_chunks=link.bad_chunks,
        reconnects=link.reconnects,
        reboots=link.reboots,
        firmware=board.firmware,
        uid=board.uid,
        axes=board.axes,
        estimators=estimators,
    )


def session_out(info: SessionInfo, recording: str = "") -> SessionOut:
    """One recorded session as JSON; `recording` is the id of the one that is being written now."""
    expected = info.messages + info.lost
    now = info.state == "open" and info.id == recording
    return SessionOut(
        id=info.id,
        devices=list(info.devices),
        sources=[
            source.lower()
            for source in info.sources
            if source != "UNKNOWN" or len(info.sources) == 1
        ],
        start_s=info.start_utc_ns / 1e9,
        seconds=info.seconds,
        state="recording" if now else info.state,
        bytes=info.bytes,
        messages=info.messages,
        lost=info.lost,
        completeness=info.messages / expected if expected else None,
        note=info.note,
        title=info.annotations.title,
        tags=info.annotations.tags,
        outcome=info.annotations.outcome,
        problem="" if now else info.problem,
        downloadable=info.path is not None and info.state != "open",
    )


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
    words = text.lower().split()
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
        replaying=replayed.parent.name if replayed else "",
    )
    heard = front.store.recorder if front.store else None
    if heard is None:
        return out
    age = heard.age()
    if age > RECORDER_STALE_S:
        return out.model_copy(update={"message": f"the recorder has been silent for {age:.0f} s"})
    return out.model_copy(update={"available": True} | _recorder_fields(heard.message))


def _recorder_fields(status: pb.RecorderStatus) -> dict[str, Any]:
    return {
        "recording": status.recording,
        "session": status.session,
        "seconds": status.seconds,
        "messages": status.messages,
        "bytes": status.bytes,
        "lost": sum(status.lost.values()),
        "message": status.message,
    }


def order_recorder(
    front: Front, action: int, user: str, name: str = "", note: str = ""
) -> RecordingOut:
    """Start or stop; HTTP 503 when the recorder does not answer, 409 when it says no."""
    if front.desk is None:
        raise HTTPException(503, "this dashboard has no connection to a recorder")
    try:
        command = pb.RecorderCommand(action=action, name=name, note=note, user=user)
        status = front.desk.recorder(command)
    except OrderError as error:
        raise HTTPException(503, str(error)) from None
    if status.recording != (action == pb.RecorderCommand.ACTION_START):
        raise HTTPException(409, status.message or "the recorder did not do it")
    return recording_out(front).model_copy(update={"available": True} | _recorder_fields(status))


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


@routes.get("/me", summary="The signed-in user and his CSRF token")
def me(who: SignedIn) -> Me:
    return Me(user=who.name, role=who.role.name, csrf=who.session.csrf)


@routes.get("/devices", summary="All devices with the state of their line and their estimators")
def devices(request: Request, who: SignedIn) -> list[DeviceOut]:
    front = front_of(request)
    if front.store is None:
        return []
    with front.store.lock:
        found = [front.store.devices[name] for name in front.store.names()]
        return [device_out(device, front.settings.stale_s) for device in found if device.spoken_of]


@routes.get("/recording", summary="State of the recorder and of a replay")
def recording(request: Request, who: SignedIn) -> RecordingOut:
    return recording_out(front_of(request))


@routes.post("/recording/start", summary="Begin a recording (operator)")
def start_recording(request: Request, body: StartRecording, who: Operator) -> RecordingOut:
    action = pb.RecorderCommand.ACTION_START
    return order_recorder(front_of(request), action, who.name, body.name, body.note)


@routes.post("/recording/stop", summary="End the recording (operator)")
def stop_recording(request: Request, who: Operator) -> RecordingOut:
    return order_recorder(front_of(request), pb.RecorderCommand.ACTION_STOP, who.name)


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
