"""The plain pages: sign-in, the main page around the scene, sessions, users."""

import importlib.metadata
import logging
import re
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Literal
from urllib.parse import parse_qs, urlencode

import jinja2
from fastapi import APIRouter, Depends, HTTPException, Query, Request
from fastapi.responses import HTMLResponse, JSONResponse, RedirectResponse, Response

from dashboard.settings import DashboardSettings
from dashboard.web import api
from dashboard.web.auth import Role, WaitError, same_token
from dashboard.web.front import Asker, Front, address_of, asker, front_of
from dashboard.web.users import UsersError
from logs.figures.words import TERMS
from messages.text import template_value

log = logging.getLogger(__name__)

# one slash first: two, or a backslash, would be another host
OWN_PATH = re.compile(r"/(?![/\\])[A-Za-z0-9/?=&._~%+,:;@-]{0,1500}")
routes = APIRouter(include_in_schema=False)
SignedIn = Annotated[Asker, Depends(asker)]


def version() -> str:
    """Version of the installed package."""
    try:
        return importlib.metadata.version("gyrofree")
    except importlib.metadata.PackageNotFoundError:
        return "unknown"


def _bytes(size: float) -> str:
    for unit in ("B", "kB", "MB", "GB"):
        if size < 1000:
            return f"{size:.0f} {unit}" if unit == "B" or size >= 100 else f"{size:.1f} {unit}"
        size /= 1000
    return f"{size:.1f} TB"


def _duration(seconds: float) -> str:
    hours, rest = divmod(int(seconds), 3600)
    minutes, rest = divmod(rest, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"


def _utc(seconds: float) -> str:
    return (
        datetime.fromtimestamp(seconds, UTC).strftime("%Y-%m-%d %H:%M:%S")
        if seconds > 0
        else "unknown"
    )


def _count(number: int) -> str:
    """Thousands apart by a thin blank, which nobody takes for a decimal comma."""
    return f"{number:,}".replace(",", "\u202f")


_templates = jinja2.Environment(
    loader=jinja2.FileSystemLoader(Path(__file__).parent / "templates"),
    autoescape=True,
    finalize=template_value,
    undefined=jinja2.StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
)
_templates.filters |= {"bytes": _bytes, "count": _count, "duration": _duration, "utc": _utc}


def render(
    request: Request, template: str, who: Asker | None, status: int = 200, **values: object
) -> HTMLResponse:
    """A page of templates/; every page knows who looks at it and whether this is the demo."""
    front = front_of(request)
    common = {
        "who": who,
        "Role": Role,
        "demo": front.settings.demo,
        "version": version(),
        "provider": front.settings.oidc_suffix if front.settings.oidc_issuer else "",
        "path": request.url.path,
        "barred": "" if who is None else barred(front, who),
    }
    return HTMLResponse(_templates.get_template(template).render(common | values), status)


def barred(front: Front, who: Asker) -> str:
    """Why no order is this person's, wherever the command is; empty: orders are."""
    if who.role < Role.operator:
        return f"This takes the role operator; you look as {who.role.name}."
    watching = front.desk.watching if front.desk is not None else ""
    return f"{watching}." if watching else ""


def error_page(request: Request, status: int, text: str) -> HTMLResponse:
    """What went wrong, as a page."""
    try:
        found = front_of(request).gate.session_of(request)
    except UsersError:
        found = None
    who = Asker(*found) if found else None
    return render(
        request,
        "error.html",
        who,
        status,
        title=_TITLES.get(status, "This did not work"),
        text=text,
    )


_TITLES = {
    403: "Not allowed",
    404: "Not found",
    409: "Not now",
    422: "Not understood",
    503: "Not available",
}


async def _form(request: Request) -> dict[str, str]:
    """Fields of a URL-encoded form, the first of each name; the guard has limited its size."""
    try:
        fields = parse_qs(
            (await request.body()).decode(), keep_blank_values=True, max_num_fields=20
        )
    except ValueError:
        raise HTTPException(422, "this is no form") from None
    return {name: values[0] for name, values in fields.items()}


async def signed_form(request: Request) -> tuple[Asker, dict[str, str]]:
    """A form of a signed-in user; HTTP 401 and 403 when it is not."""
    who, fields = asker(request), await _form(request)
    if not same_token(fields.get("csrf", ""), who.session.csrf):
        raise HTTPException(
            403, "this form is not from the page you are signed in to: load it again"
        )
    return who, fields


def login_link(request: Request) -> str:
    """The page of the sign-in, which afterwards goes on to what was asked for."""
    path = request.url.path + (f"?{request.url.query}" if request.url.query else "")
    wanted = own_path(path) if request.method == "GET" else "/"
    return "/login" if wanted == "/" else f"/login?{urlencode({'next': wanted})}"


def own_path(path: str) -> str:
    """A path of this dashboard's own pages; "/" for whatever else is asked for."""
    pages = OWN_PATH.fullmatch(path) and not path.startswith(
        ("/login", "/logout", "/scene", "/api")
    )
    return path if pages else "/"


def caller(request: Request) -> tuple[str, str]:
    """Address, and what the browser calls itself."""
    return address_of(request), request.headers.get("user-agent", "")


def enter(request: Request, token: str, wanted: str = "/") -> RedirectResponse:
    """Set the cookie and go to the page that was asked for."""
    answer = RedirectResponse(own_path(wanted), 303)
    set_cookie(front_of(request).settings, answer, token)
    return answer


def set_cookie(settings: DashboardSettings, answer: Response, token: str) -> None:
    """The cookie of a sign-in."""
    give_cookie(settings, answer, settings.cookie, token, settings.session_hours * 3600)


def give_cookie(
    settings: DashboardSettings,
    answer: Response,
    name: str,
    value: str,
    life_s: float,
    samesite: Literal["strict", "lax"] = "strict",
) -> None:
    """A cookie that no script reads and, over TLS, no plain connection carries."""
    answer.set_cookie(
        name,
        value,
        max_age=int(life_s),
        path="/",
        secure=settings.secure,
        httponly=True,
        samesite=samesite,
    )


@routes.get("/")
def main_page(request: Request, who: SignedIn) -> Response:
    first = front_of(request).first_run
    if first is not None and not first.over and who.role >= Role.admin:
        return RedirectResponse("/setup", 303)
    return render(request, "main.html", who, view=front_of(request).views.of(who.name))


@routes.get("/login")
def login_page(
    request: Request, wanted: Annotated[str, Query(alias="next", max_length=1600)] = "/"
) -> Response:
    front = front_of(request)
    if front.gate.session_of(request) is not None:
        return RedirectResponse(own_path(wanted), 303)
    empty = not front.gate.users.all()
    return render(
        request, "login.html", None, name="", fault="", empty=empty, wanted=own_path(wanted)
    )


@routes.post("/login")
async def login(request: Request) -> Response:
    gate, fields = front_of(request).gate, await _form(request)
    name, status, headers = fields.get("name", ""), 401, {}
    try:
        token = await gate.sign_in(name, fields.get("password", ""), *caller(request))
        if token is not None:
            return enter(request, token, fields.get("next", "/"))
        fault = "Name or password is wrong."
    except WaitError as wait:
        seconds = max(1, round(wait.seconds))
        fault, status = f"Too many wrong passwords from here. Try again in {seconds} s.", 429
        headers = {"retry-after": str(seconds)}
    page = render(
        request,
        "login.html",
        None,
        status,
        name=name[:64],
        fault=fault,
        empty=not gate.users.all(),
        wanted=own_path(fields.get("next", "/")),
    )
    page.headers.update(headers)
    return page


@routes.get("/login/link")
def link_page(request: Request, token: Annotated[str, Query(max_length=200)] = "") -> Response:
    """A page with a button that posts: what only looks at a link (mail scanners, prefetch) does not
    use it up.
    """
    if front_of(request).gate.session_of(request) is not None:
        return RedirectResponse("/", 303)
    return render(request, "link.html", None, token=token)


@routes.post("/login/link")
async def link(request: Request) -> Response:
    fields = await _form(request)
    try:
        token = front_of(request).gate.redeem(fields.get("token", ""), *caller(request))
    except WaitError as wait:
        raise HTTPException(
            429, str(wait), {"retry-after": str(max(1, round(wait.seconds)))}
        ) from None
    if token is None:
        raise HTTPException(
            403,
            "this sign-in link was used already, is too old, or is not complete: ask for a new one",
        )
    return enter(request, token)


@routes.post("/logout")
async def logout(request: Request) -> Response:
    await signed_form(request)
    front = front_of(request)
    key = front.gate.key_of(request)
    front.gate.sign_out(request)
    away = await front.gate.farewell(key)
    # a page, and not a redirect: a form of ours may lead to pages of ours only
    left = render(request, "left.html", None, wanted=away) if away else None
    answer = left or RedirectResponse("/login", 303)
    answer.delete_cookie(
        front.settings.cookie,
        path="/",
        secure=front.settings.secure,
        httponly=True,
        samesite="strict",
    )
    return answer


@routes.get("/sessions")
def sessions_page(
    request: Request, who: SignedIn, q: Annotated[str, Query(max_length=200)] = ""
) -> HTMLResponse:
    front = front_of(request)
    rows = api.list_sessions(front, q)
    can_replay = front.replay is not None and not barred(front, who)
    can_import = front.jobs is not None and who.role >= Role.operator
    return render(
        request, "sessions.html", who, rows=rows, q=q, can_replay=can_replay, can_import=can_import
    )


@routes.get("/words")
def words(request: Request, who: SignedIn) -> HTMLResponse:
    """The words that stand on the pages, and what they mean."""
    return render(request, "words.html", who, terms=TERMS)


@routes.get("/api/openapi.json")
def openapi(request: Request, who: SignedIn) -> JSONResponse:
    return JSONResponse(request.app.openapi())


@routes.get("/api/docs")
def docs(request: Request, who: SignedIn) -> HTMLResponse:
    """The REST interface as a page, from the same description."""
    paths = request.app.openapi()["paths"]
    rows = [
        (verb.upper(), path, what.get("summary", ""))
        for path, verbs in paths.items()
        for verb, what in verbs.items()
    ]
    return render(request, "docs.html", who, rows=rows)
