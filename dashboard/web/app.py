"""The web application put together: guard, static files, scene, REST, pages, and how faults are
answered.
"""

from collections import Counter
from pathlib import Path

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse, RedirectResponse, Response
from fastapi.staticfiles import StaticFiles
from starlette.exceptions import HTTPException
from starlette.types import ASGIApp

from dashboard.web import (
    api,
    compare_api,
    desk_api,
    intake_api,
    pages,
    session_api,
    session_pages,
    spectrum_api,
)
from dashboard.web.accounts import pages as account_pages
from dashboard.web.accounts import provider_pages
from dashboard.web.alarms import routes as alarm_routes
from dashboard.web.command import routes as command_routes
from dashboard.web.first import pages as first_pages
from dashboard.web.frame import proxy
from dashboard.web.front import Front
from dashboard.web.guard import Guard
from dashboard.web.map import routes as map_routes
from dashboard.web.places import routes as place_routes
from dashboard.web.programs import live_api, metrics, users_page
from dashboard.web.users import UsersError
from dashboard.web.wall import routes as wall_routes

STATIC = Path(__file__).parent / "static"


def create_app(front: Front) -> ASGIApp:
    """The application behind its guard, to be served by any ASGI server."""
    app = FastAPI(
        title="gyrofree", version=pages.version(), docs_url=None, redoc_url=None, openapi_url=None
    )
    app.state.front = front
    app.state.listeners = Counter()  # user -> open streams
    app.state.flows = {}  # seat -> what its scenes get
    app.state.walls = Counter()  # user -> open wall displays
    app.mount("/static", StaticFiles(directory=STATIC), name="static")
    app.include_router(
        proxy.router(front.settings, front.gate, front.scene_port, front.open_labels, front.seats)
    )
    app.include_router(api.routes, responses={401: {"description": "not signed in"}})
    app.include_router(desk_api.routes, responses={401: {"description": "not signed in"}})
    app.include_router(live_api.routes, responses={401: {"description": "not signed in"}})
    app.include_router(map_routes.routes, responses={401: {"description": "not signed in"}})
    app.include_router(intake_api.routes, responses={401: {"description": "not signed in"}})
    app.include_router(session_api.routes, responses={401: {"description": "not signed in"}})
    app.include_router(spectrum_api.routes, responses={401: {"description": "not signed in"}})
    app.include_router(compare_api.routes, responses={401: {"description": "not signed in"}})
    app.include_router(alarm_routes.routes, responses={401: {"description": "not signed in"}})
    app.include_router(metrics.routes, responses={401: {"description": "not signed in"}})
    app.include_router(place_routes.routes, responses={401: {"description": "not signed in"}})
    app.include_router(command_routes.routes, responses={401: {"description": "not signed in"}})
    app.include_router(pages.routes)
    app.include_router(session_pages.routes)
    app.include_router(users_page.routes)
    app.include_router(wall_routes.routes)
    app.include_router(account_pages.routes)
    app.include_router(provider_pages.router(front.gate))
    app.include_router(first_pages.routes)
    app.add_exception_handler(RequestValidationError, _not_valid)
    app.add_exception_handler(HTTPException, _refused)
    app.add_exception_handler(UsersError, _users_file)
    return Guard(app, front.settings)


def _wants_page(request: Request) -> bool:
    return not request.url.path.startswith("/api/") and "text/html" in request.headers.get(
        "accept", ""
    )


def _not_valid(request: Request, error: RequestValidationError) -> Response:
    """422 without the input: NaN and infinity in it cannot be written as JSON, and it may be
    long.
    """
    faults = [
        {"at": [str(part)[:80] for part in e["loc"][:8]], "what": e["msg"][:200]}
        for e in error.errors()[:20]
    ]
    if _wants_page(request):
        return pages.error_page(
            request, 422, "; ".join(f"{'.'.join(f['at'][1:])}: {f['what']}" for f in faults)
        )
    return JSONResponse({"error": "the request is not valid", "faults": faults}, 422)


def _refused(request: Request, error: HTTPException) -> Response:
    if _wants_page(request):
        if error.status_code == 401:
            return RedirectResponse(pages.login_link(request), 303)
        text = str(error.detail)
        if error.status_code == 404 and text == "Not Found":  # the framework's own word
            text = f"There is no page {request.url.path[:80]}."
        return pages.error_page(request, error.status_code, text)
    return JSONResponse({"error": error.detail}, error.status_code, headers=error.headers)


def _users_file(request: Request, error: UsersError) -> Response:
    """The users file is damaged: nobody gets in, and whoever runs the dashboard has the reason in
    the log.
    """
    pages.log.error("%s", error)
    text = "the users file cannot be read; the dashboard's log says why"
    return (
        pages.error_page(request, 503, text)
        if _wants_page(request)
        else JSONResponse({"error": text}, 503)
    )
