"""REST for what is sent from the page in pieces: a log that becomes a session, the photo of a unit;
and for a session estimated again.
"""

import shutil
from typing import Annotated, Any

from fastapi import APIRouter, HTTPException, Query, Request, Response
from pydantic import BaseModel, Field

from dashboard.web.api import Operator, SignedIn, file_of, find_session
from dashboard.web.front import Front, front_of
from dashboard.web.schemas import Line, Strict
from dashboard.web.session_api import JobOut, start_job
from dashboard.web.uploads import (
    FILES,
    Upload,
    UploadError,
    is_tachometer,
    samples_and_fixes,
    samples_and_tacho,
)
from logs.sheet import LogError, open_sheet
from logs.tables.preview import TARGETS, look, rewritten
from messages import text
from sessions.report import photo

LEAST_FREE = 256 << 20  # bytes of the disk that uploads leave to others
routes = APIRouter(prefix="/api")

LARGEST = 1 << 30  # bytes of one log
PHOTOS = (".jpg", ".jpeg", ".png")
NAMED = r"^[a-z][a-z0-9_-]{0,31}$"
ESTIMATOR_NAME = Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9_-]{0,31}$")]
SETTING = Annotated[str, Field(pattern=r"^[a-z0-9_-]+(\.[a-z0-9_-]+){0,3}$", max_length=100)]
VALUE = Annotated[Line, Field(max_length=300)]
Added = Annotated[Line, Field(min_length=1, max_length=60)]  # manifest.slug makes an id of it


class UploadOut(BaseModel):
    upload: int
    piece_bytes: int = Field(description="largest piece that is taken at once")


class LookOut(BaseModel):
    files: dict[str, dict[str, Any]] = Field(
        description="encoding, separator, decimal sign, first rows, columns with a guess"
    )
    targets: list[str] = Field(description="what a column can be meant as")


class PieceOut(BaseModel):
    bytes: int = Field(description="of this file so far")


class ImportOrder(Strict):
    device: str = Field(default="log", pattern=NAMED)
    name: Added = Field(default="import", description="added to the session's id")
    start: str = Field(default="", max_length=40, description="when it was recorded, UTC, ISO 8601")
    columns: dict[str, dict[str, str]] = Field(
        default={},
        max_length=4,
        description="by file: column -> its meaning, one of `targets` of look; absent: as named",
    )


class RerunOrder(Strict):
    estimators: list[ESTIMATOR_NAME] = Field(
        default=[], max_length=8, description="rate estimators; none: as configured"
    )
    navigators: list[ESTIMATOR_NAME] = Field(
        default=[], max_length=8, description="navigation filters; none: as configured"
    )
    settings: dict[SETTING, VALUE] = Field(
        default={},
        max_length=20,
        description="key of [estimator] -> value, as in TOML; files by name, of the library only",
    )
    name: Added = Field(default="new", description="added to the names of session and estimators")
    beside: bool = Field(default=True, description="keep the old estimates beside")


@routes.post("/imports", summary="Begin to send a log (operator)")
def begin_import(request: Request, who: Operator) -> UploadOut:
    front = front_of(request)
    return UploadOut(upload=front.uploads.begin(who.name), piece_bytes=front.settings.body_limit)


@routes.post(
    "/imports/{upload}/files/{file}", summary="The next piece of a CSV file, as it is (operator)"
)
async def take_piece(
    request: Request, upload: int, file: str, who: Operator, at: Annotated[int, Query(ge=0)] = 0
) -> PieceOut:
    """Pieces come in order: `at` is the number of bytes that went before; HTTP 409 says what is
    wanted instead.
    """
    found = _upload(front_of(request), upload, who.name)
    file = text.composed(file)  # one file, whether its umlauts come in one piece or in two
    if fault := text.file_name(file):
        raise HTTPException(422, f"file {text.plain(file, 80)}: {fault}: give it another name")
    most = photo.MOST_BYTES if file.lower().endswith(PHOTOS) else LARGEST
    if not file.lower().endswith((".csv", *PHOTOS)):
        raise HTTPException(422, f"file {text.plain(file, 80)}: want a CSV file, like imu.csv")
    body = await request.body()
    _check_room(front_of(request), found, len(body))
    with found.lock:
        path = found.folder / file
        have = path.stat().st_size if path.exists() else 0
        if not path.exists() and len(list(found.folder.iterdir())) >= FILES:
            raise HTTPException(409, f"{file}: {FILES} files are here already: begin anew")
        if at != have:
            raise HTTPException(
                409, f"{file}: {have} bytes are here, so the next piece begins there, not at {at}"
            )
        if have + len(body) > most:
            hint = ": use `gyrofree import`" if most == LARGEST else ": take it smaller"
            raise HTTPException(413, f"{file}: larger than {most >> 20} MB{hint}")
        try:
            with path.open("ab") as stream:
                stream.write(body)
            found.taken += len(body)
        except OSError as error:
            raise HTTPException(507, f"{file} cannot be kept: {error.strerror}") from None
        return PieceOut(bytes=have + len(body))


def _check_room(front: Front, found: Upload, size: int) -> None:
    """HTTP 413 for more than a user may have under way, 507 where the disk is nearly full."""
    most = front.settings.upload_bytes_per_user
    if size > front.uploads.room(found.user, most):
        front.ended["an upload over its user's quota"] += 1
        raise HTTPException(
            413, f"{found.user} has {most >> 20} MB under way: finish an upload, or begin anew"
        )
    if shutil.disk_usage(found.folder).free < LEAST_FREE:
        raise HTTPException(507, f"less than {LEAST_FREE >> 20} MB are free where uploads wait")


@routes.get("/imports/{upload}/look", summary="How the files sent are written, and their columns")
def look_at_import(request: Request, upload: int, who: SignedIn) -> LookOut:
    found = _upload(front_of(request), upload, who.name)
    files = {}
    for path in sorted(found.folder.iterdir()):
        try:
            files[path.name] = look(path)
        except (LogError, OSError) as error:
            raise HTTPException(409, _without(found, error)) from None
    return LookOut(files=files, targets=list(TARGETS))


def _without(found: Upload, error: Exception) -> str:
    """A message without the server's folders."""
    return str(error).replace(f"{found.folder}/", "")


@routes.post("/imports/{upload}/finish", summary="Make a session of the files sent (operator)")
def finish_import(request: Request, upload: int, body: ImportOrder, who: Operator) -> JobOut:
    front = front_of(request)
    found = _upload(front, upload, who.name)
    try:
        for name, columns in body.columns.items():
            path = found.folder / text.composed(name)
            if path not in list(found.folder.iterdir()):
                raise UploadError(f"{text.plain(name, 80)}: no such file was sent")
            if is_tachometer(open_sheet(path).header):
                continue  # it says more than its numbers: which direction is known
            mapped = path.with_name(".mapped")
            rewritten(path, columns, mapped)
            mapped.replace(path)
        files = sorted(found.folder.iterdir())
        turned = samples_and_tacho(files)
        samples, fixes = (turned[0], None) if turned else samples_and_fixes(files)
    except (UploadError, LogError, OSError) as error:
        raise HTTPException(409, _without(found, error)) from None
    order = ["import", str(samples), "--device", body.device, "--name", body.name]
    order += ["--gnss", str(fixes)] if fixes else []
    order += ["--tacho", str(turned[1])] if turned else []
    order += ["--start", body.start] if body.start else []
    found.reading = True
    end = {
        "makes": "session",
        "then": lambda: front.uploads.forget(upload),
        "hide": (f"{found.folder}/", f"{front.catalogue.root}/"),
    }
    try:
        return start_job(front, "import", samples.name, order, who.name, **end)
    except HTTPException:
        found.reading = False  # it can be tried again
        raise


class PhotoOrder(Strict):
    upload: int = Field(description="that the photo was sent in, alone")


class PhotoOut(BaseModel):
    sha256: str = Field(description="of the photo as it is kept, a JPEG without what cameras add")


@routes.post("/sessions/{session}/photo", summary="Keep the photo of its unit (operator)")
def keep_photo(request: Request, session: str, body: PhotoOrder, who: Operator) -> PhotoOut:
    front = front_of(request)
    find_session(front, session)
    found = _upload(front, body.upload, who.name)
    files = list(found.folder.iterdir())
    if len(files) != 1 or not files[0].name.lower().endswith(PHOTOS):
        raise HTTPException(409, "want one photo, sent before: a JPEG or PNG")
    try:
        kept = photo.keep(front.catalogue.root / session, files[0].read_bytes())
    except photo.PhotoError as error:
        raise HTTPException(422, str(error)) from None
    except OSError as error:
        raise HTTPException(507, f"the photo cannot be kept: {error.strerror}") from None
    finally:
        front.uploads.forget(body.upload)
    return PhotoOut(sha256=kept.sha256)


@routes.get("/sessions/{session}/photo", summary="The photo of its unit", response_class=Response)
def unit_photo(request: Request, session: str, who: SignedIn) -> Response:
    front = front_of(request)
    find_session(front, session)
    found = photo.read(front.catalogue.root / session)
    if found is None:
        raise HTTPException(404, f"session {session} has no photo of its unit")
    return Response(found.jpeg, media_type="image/jpeg")


def _upload(front: Front, number: int, user: str) -> Upload:
    found = front.uploads.open.get(number)  # of the user who began it
    if found is None or found.user != user or found.reading:
        raise HTTPException(404, f"no upload {number}: begin anew")
    return found


class ChoicesOut(BaseModel):
    rate: list[str]
    navigators: list[str]


@routes.get("/estimators", summary="Names that a session can be estimated again with")
def choices(request: Request, who: SignedIn) -> ChoicesOut:
    from inertial.navigation.navigation import (
        NAVIGATORS,
    )  # here: compiled code that no page waits for
    from inertial.rate.estimators import VARIANTS

    return ChoicesOut(rate=sorted(VARIANTS), navigators=sorted(NAVIGATORS))


@routes.post("/sessions/{session}/rerun", summary="Estimate it again, as a new session (operator)")
def rerun(request: Request, session: str, body: RerunOrder, who: Operator) -> JobOut:
    front = front_of(request)
    order = ["rerun", str(file_of(front, session)), "--library-only", "--name", body.name]
    order += ["--estimators", ",".join(body.estimators)] if body.estimators else []
    order += ["--navigators", ",".join(body.navigators)] if body.navigators else []
    for key, value in body.settings.items():
        order += ["--set", f"{key}={value}"]
    order += [] if body.beside else ["--instead"]
    return start_job(front, "rerun", session, order, who.name, makes="session")
