"""What the REST interface takes and gives: SI units, times in s since 1970."""

import math
from collections.abc import Iterable
from dataclasses import asdict
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from dashboard.data.alarms import Alarm, words
from dashboard.data.device import Device
from dashboard.data.lateness import Lateness
from messages import text
from messages.contract import gyrofree_pb2 as pb
from sessions.library.catalogue import SessionInfo


class Strict(BaseModel):
    """A body: no unknown keys, no conversions (true is no number), no NaN and no infinity."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)


def _checked(lines: bool) -> AfterValidator:
    def check(given: str) -> str:
        given = text.composed(given)
        if fault := text.check(given, lines):
            raise ValueError(fault)
        return given

    return AfterValidator(check)


# what people write: nothing that acts on a page, a terminal or the reader's eye (messages.text)
Line = Annotated[str, _checked(lines=False)]
Lines = Annotated[str, _checked(lines=True)]


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
    behind_s: float = Field(description="from the arrival of samples to their estimates, s")
    skipped_s: float = Field(
        description="s of samples passed over: the machine is too slow for all"
    )
    limit_hz: float = Field(description="estimates a second at most, while it is; 0: as set")
    trouble: str = Field(description="what its process cannot do now, such as save its state")


class AlarmOut(BaseModel):
    kind: str = Field(description="axis, link, board, estimator, late, blind, contradicted ...")
    title: str
    text: str = Field(description="what was found and what to do")
    page: str = Field(description="of the live page (?p=), that shows it; empty for none")
    about: str = Field(description="which axis, filter or fault it is; may be empty")
    id: str = Field(description="stays while what is said of it changes; see /api/alarms")
    level: str = Field(description="watch, warning, critical; empty where no service judges it")
    state: str = Field(description="unacknowledged or acknowledged; likewise")
    raised_s: float = Field(description="s since 1970; 0 likewise")
    words: dict[str, str] = Field(description="words of the trade in it, with their meanings")


class LateOut(BaseModel):
    known: bool
    late: bool = Field(description="surely more than a second")
    shown: bool = Field(description="stands in the head of the page: late, or not known from afar")
    age_s: float | None = Field(description="of its newest sample by the site's clock")
    bound_s: float | None = Field(description="the most that this may be wrong by")
    clock_ahead_s: float | None = Field(description="this dashboard's clock minus the site's")
    clock_bound_s: float | None
    said: str
    details: str


class AgedOut(BaseModel):
    site_age_s: float | None = Field(
        default=None, description="how old it is by the site's clock, s; null: not known"
    )
    site_age_bound_s: float | None = Field(
        default=None, description="the most that this may be wrong by, s"
    )
    site_age_why: str = Field(default="", description="why it is not known; empty: it is")


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
    alarms: list[AlarmOut] = Field(description="what is wrong, the worst first")
    late: LateOut | None = Field(
        default=None, description="how old its picture is; null: a replay, or no samples yet"
    )


class RecordingOut(AgedOut):
    """Its age is that of what the recorder said last."""

    available: bool = Field(description="the recorder was heard of in the last seconds")
    recording: bool
    session: str
    seconds: float
    messages: int
    bytes: int
    lost: int
    message: str
    replaying: str = Field(description="id of the session being replayed, or empty")
    alarms: list[AlarmOut] = Field(description="what is wrong with the recorder")


class StartRecording(Strict):
    name: Line = Field(default="", max_length=60)
    note: Lines = Field(default="", max_length=2000)


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


def alarms_out(found: Iterable[Alarm]) -> list[AlarmOut]:
    """Alarms as JSON."""
    return [AlarmOut(**asdict(alarm), id=alarm.id, words=words(alarm)) for alarm in found]


def late_out(found: Lateness | None) -> LateOut | None:
    """An age as JSON."""
    if found is None:
        return None
    numbers = found.age_s, found.bound_s, found.clock_ahead_s, found.clock_bound_s
    age_s, bound_s, ahead_s, ahead_bound_s = (n if math.isfinite(n) else None for n in numbers)
    return LateOut(
        known=found.known,
        late=found.late,
        shown=found.shown,
        age_s=age_s,
        bound_s=bound_s,
        clock_ahead_s=ahead_s,
        clock_bound_s=ahead_bound_s,
        said=found.said,
        details=found.details,
    )


def device_out(
    device: Device,
    stale_s: float,
    found: Iterable[Alarm] = (),
    late: Lateness | None = None,
) -> DeviceOut:
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
            name=text.plain(name),
            state=text.plain(s.state),
            message=text.plain(s.message),
            us_per_sample=s.us_per_sample,
            gaps=s.gaps,
            behind_s=s.behind_s,
            skipped_s=s.skipped_s,
            limit_hz=s.limit_hz,
            trouble=text.plain(s.trouble),
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
        port=text.plain(link.port),
        message=text.plain(link.message) if heard else "no link status yet",
        sample_rate_hz=link.sample_rate_hz,
        latency_p99_s=link.latency_p99_s,
        clock_skew_ppm=link.clock_skew_ppm,
        lost_frames=link.lost_frames,
        lost_samples=link.lost_samples,
        bad_chunks=link.bad_chunks,
        reconnects=link.reconnects,
        reboots=link.reboots,
        firmware=text.plain(board.firmware),
        uid=text.plain(board.uid),
        axes=board.axes,
        estimators=estimators,
        alarms=alarms_out(found),
        late=late_out(late),
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


def recorder_fields(status: pb.RecorderStatus) -> dict[str, Any]:
    return {
        "recording": status.recording,
        "session": status.session,
        "seconds": status.seconds,
        "messages": status.messages,
        "bytes": status.bytes,
        "lost": sum(status.lost.values()),
        "message": status.message,
    }
