"""REST for one recorded session: report, export, notes, tags, deletion."""

import io
import shutil
import time
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Literal

from fastapi import APIRouter, Depends, HTTPException, Request
from fastapi.responses import FileResponse, Response, StreamingResponse
from pydantic import BaseModel, Field

from dashboard.web.api import Operator, SignedIn, file_of, find_session
from dashboard.web.auth import Role
from dashboard.web.control import ControlError
from dashboard.web.front import Asker, Front, front_of, needs
from dashboard.web.jobs import Job, Jobs
from dashboard.web.schemas import Line, Lines, Strict
from sessions.library.annotations import (
    Annotations,
    SessionNote,
    add_note,
    change_annotations,
    read_annotations,
)
from sessions.library.remove import remove
from sessions.recording.manifest import SessionError

routes = APIRouter(prefix="/api")
Admin = Annotated[Asker, Depends(needs(Role.admin))]

REPORT_CSP = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; frame-ancestors 'none'"
REPORTS = {"html": "text/html; charset=utf-8", "pdf": "application/pdf", "json": "application/json"}
REPORT_FOLDER = "report"  # within the session's folder


class JobOut(BaseModel):
    number: int
    kind: str
    session: str
    state: Literal["waiting", "running", "done", "failed"]
    seconds: float
    bytes: int = Field(description="written so far")
    message: str
    made: str = Field(description="id of the session it made; empty for other jobs")


class ExportOrder(Strict):
    format: Literal["csv", "parquet", "mat", "kml", "gpx", "mcap"]
    start_s: float = Field(default=0.0, ge=0, description="s from the session's start")
    end_s: float | None = Field(default=None, ge=0)
    topics: list[Annotated[str, Field(pattern=r"^[a-z][a-z0-9_-]{0,31}$")]] = Field(
        default=[], max_length=30
    )


class NoteOrder(Strict):
    text: Lines = Field(min_length=1, max_length=2000)
    at_s: float | None = Field(default=None, ge=0)


class LabelOrder(Strict):
    title: Line | None = Field(default=None, max_length=200)
    tags: list[str] | None = Field(default=None, max_length=20)
    outcome: Literal["", "pass", "fail", "incomplete"] | None = None


def job_out(job: Job) -> JobOut:
    """A job as JSON."""
    return JobOut(
        number=job.number,
        kind=job.kind,
        session=job.session,
        state=job.state,
        seconds=job.seconds,
        bytes=job.bytes,
        message=job.message,
        made=job.made,
    )


def _jobs(front: Front) -> Jobs:
    if front.jobs is None:
        raise HTTPException(503, "this dashboard was started without a command for jobs")
    return front.jobs


def start_job(front: Front, *order, **options) -> JobOut:
    """Queue a job (jobs.Jobs.start); HTTP 409 when there are too many, 503 without a command for
    them.
    """
    try:
        return job_out(_jobs(front).start(*order, **options))
    except ControlError as error:
        raise HTTPException(409, str(error)) from None


def report_path(front: Front, session: str, form: str) -> Path:
    """Where a session's report lies once it is made; HTTP 404 for a session that does not exist."""
    find_session(front, session)
    return front.catalogue.root / session / REPORT_FOLDER / f"report.{form}"


@routes.post("/sessions/{session}/report", summary="Make the test report (operator)")
def make_report(request: Request, session: str, who: Operator) -> JobOut:
    front = front_of(request)
    path = file_of(front, session)
    return start_job(
        front, "report", session, ["report", str(path)], who.name, accept=(0, 1)
    )  # 1: a limit is broken


@routes.get(
    "/sessions/{session}/report.{form}", summary="The report, once it is made: html, pdf or json"
)
def report(request: Request, session: str, form: str, who: SignedIn) -> Response:
    path = report_path(front_of(request), session, form) if form in REPORTS else None
    if path is None or not path.is_file():
        raise HTTPException(404, f"session {session} has no report in this form yet")
    headers = {"content-security-policy": REPORT_CSP}
    if form != "html":
        headers["content-disposition"] = f'attachment; filename="report-{session}.{form}"'
    return FileResponse(path, media_type=REPORTS[form], headers=headers)


@routes.post("/sessions/{session}/export", summary="Write it in another format")
def make_export(request: Request, session: str, body: ExportOrder, who: Operator) -> JobOut:
    front = front_of(request)
    arguments = [
        "export",
        str(file_of(front, session)),
        "--format",
        body.format,
        "--from",
        repr(body.start_s),
    ]
    arguments += ["--to", repr(body.end_s)] if body.end_s is not None else []
    arguments += ["--topics", ",".join(body.topics)] if body.topics else []
    return start_job(front, f"export-{body.format}", session, arguments, who.name)


@routes.get("/jobs/{number}", summary="How far a job is")
def job(request: Request, number: int, who: SignedIn) -> JobOut:
    front = front_of(request)
    found = _known(front, number)
    if found.kind == "report" and found.state == "done":
        _guarded(lambda: _keep_report(front, found))
    return job_out(found)


@routes.get("/jobs/{number}/download", summary="Its files: the one, or all of them as a ZIP")
def job_files(request: Request, number: int, who: SignedIn) -> Response:
    found = _known(front_of(request), number)
    if found.state != "done" or not found.files:
        raise HTTPException(
            409, f"job {number} is {found.state}: {found.message or 'its files are not there yet'}"
        )
    if len(found.files) == 1:
        return FileResponse(found.files[0], filename=f"{found.session}-{found.files[0].name}")
    headers = {"content-disposition": f'attachment; filename="{found.session}-{found.kind}.zip"'}
    return StreamingResponse(zipped(found.files), media_type="application/zip", headers=headers)


def _known(front: Front, number: int) -> Job:
    found = _jobs(front).get(number)
    if found is None:
        raise HTTPException(
            404, f"no job {number}: it was forgotten, or the dashboard was started anew"
        )
    return found


def _keep_report(front: Front, job: Job) -> None:
    """A finished report moves to its session."""
    target = front.catalogue.root / job.session / REPORT_FOLDER
    with job.keeping:  # two pages may ask at once
        if job.files and target.parent.is_dir():
            target.mkdir(exist_ok=True)
            for file in job.files:
                shutil.move(file, target / file.name)


class _Pipe(io.RawIOBase):
    """A file that only collects; ZipFile writes to it, the answer takes from it."""

    def __init__(self) -> None:
        self.data = bytearray()

    def writable(self) -> bool:
        return True

    def write(self, chunk) -> int:  # bytes-like
        self.data += chunk
        return len(chunk)


def zipped(files: list[Path]) -> Iterator[bytes]:
    """A ZIP of the files, piece by piece: nothing is held in memory whole."""
    pipe = _Pipe()
    with zipfile.ZipFile(pipe, "w", zipfile.ZIP_DEFLATED) as archive:
        for file in files:
            with (
                file.open("rb") as source,
                archive.open(zipfile.ZipInfo(file.name), "w", force_zip64=True) as target,
            ):
                while chunk := source.read(1 << 20):
                    target.write(chunk)
                    yield bytes(pipe.data)
                    pipe.data.clear()
    yield bytes(pipe.data)


@routes.get("/sessions/{session}/annotations", summary="Title, tags, outcome and notes")
def annotations(request: Request, session: str, who: SignedIn) -> Annotations:
    front = front_of(request)
    find_session(front, session)
    return _guarded(lambda: read_annotations(front.catalogue.root / session))


@routes.post("/sessions/{session}/notes", summary="Add a remark (operator)")
def note(request: Request, session: str, body: NoteOrder, who: Operator) -> Annotations:
    front = front_of(request)
    find_session(front, session)
    remark = SessionNote(
        text=body.text, author=who.name, at_s=body.at_s, written_utc_ns=time.time_ns()
    )
    return _guarded(lambda: add_note(front.catalogue.root / session, remark))


@routes.post("/sessions/{session}/labels", summary="Title, tags and outcome (operator)")
def labels(request: Request, session: str, body: LabelOrder, who: Operator) -> Annotations:
    front = front_of(request)
    find_session(front, session)
    changes = {name: value for name, value in body.model_dump().items() if value is not None}
    return _guarded(
        lambda: change_annotations(
            front.catalogue.root / session, lambda was: was.model_copy(update=changes)
        )
    )


@routes.post("/sessions/{session}/delete", summary="Delete it for good (admin)")
def delete(request: Request, session: str, who: Admin) -> dict[str, int]:
    front = front_of(request)
    find_session(front, session)
    return {"freed_bytes": _guarded(lambda: remove(front.catalogue, session))}


def _guarded(work):
    """The work's result; what a session refuses becomes HTTP 409."""
    try:
        return work()
    except SessionError as error:
        raise HTTPException(409, str(error)) from None
    except OSError as error:
        raise HTTPException(
            507, f"the recordings' folder cannot be written: {error.strerror}"
        ) from None
