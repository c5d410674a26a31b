"""/wall: the page, the stream that feeds it, and how a display comes in and is shut out.

An admin makes a link; the display that opens it keeps its token as a cookie, which is good for
nothing but these routes. It ends when it is revoked, with its days, or with its user; to be idle
does not end it. The page itself is the same for everybody, so that one that was shut out, or whose
dashboard is down, says so and comes back by itself.
"""

import base64
import hashlib
import json
import time
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Annotated

from fastapi import APIRouter, HTTPException, Query, Request
from fastapi.responses import JSONResponse, Response, StreamingResponse

from dashboard.web.auth import Role, SignIn, WaitError
from dashboard.web.front import Asker, Front, address_of, check_role, front_of
from dashboard.web.guard import PAGE_CSP
from dashboard.web.pages import SignedIn, give_cookie, render, signed_form, version
from dashboard.web.programs.tokens import WALL, issue_token, revoke_token
from dashboard.web.programs.users_page import users_with
from dashboard.web.schemas import Line, Strict
from dashboard.web.users import UsersError
from dashboard.web.wall.said import chosen, commanding, moving, state
from messages.text import plain

routes = APIRouter(include_in_schema=False)

FILES = Path(__file__).parents[1] / "static" / "wall"
PAGE = Path(__file__).parents[1] / "templates" / "wall.html"
POSES_S, STATE_S = 0.1, 1.0  # between two poses, two states
MOST = 64  # displays at a time
DAY_S = 86_400.0


# Part of the page itself, as the files beside it may not come where a dashboard is just ending or
# beginning: where one of them failed, or wall.js ceased to beat, the page is loaded once more, and
# only when it is there.
GUARD = """
let failed = false;
addEventListener("error", (event) => { failed ||= event.target !== window; }, true);
setInterval(async () => {
  if (!failed && performance.now() - (window.wallBeat ?? 0) < 30000) return;
  try {
    const answer = await fetch(location.href, { cache: "no-store" });
    if (answer.ok && (await answer.text()).includes("data-build")) location.reload();
  } catch { /* not yet */ }
}, 3000);
"""
GUARD_HASH = base64.b64encode(hashlib.sha256(GUARD.encode()).digest()).decode()
WALL_CSP = PAGE_CSP.replace("script-src 'self'", f"script-src 'self' 'sha256-{GUARD_HASH}'")


def build() -> str:
    """Changes with what a display has loaded: then it loads anew."""
    digest = hashlib.sha256(version().encode() + GUARD.encode())
    for path in (PAGE, *sorted(FILES.iterdir())):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


BUILD = build()


class Token(Strict):
    token: Line


def cookie_of(front: Front) -> str:
    """Name of the cookie of a display."""
    return f"{front.settings.cookie}-wall"


def onlooker(request: Request) -> Asker:
    """A display by its token, or a person by his sign-in; HTTP 401 for nobody."""
    front = front_of(request)
    found = front.gate.session_of(request)
    if found is not None:
        return Asker(*found)
    secret = request.cookies.get(cookie_of(front), "")
    display = front.gate.tokens.find(secret, WALL) if secret else None
    if display is None:
        raise HTTPException(401, "this display is not signed in: an admin makes a link for it")
    token, user = display
    return Asker(SignIn(user.name, "", token.created, token.created), user, token.id)


@routes.get("/wall")
def wall(request: Request) -> Response:
    page = render(request, "wall.html", None, build=BUILD, guard=GUARD)
    page.headers["content-security-policy"] = WALL_CSP
    return page


@routes.get("/wall/open")
def door(request: Request) -> Response:
    """What a display's link opens: the token stands behind the #, which no log ever sees."""
    return wall(request)


@routes.post("/wall/open")
def enter(request: Request, body: Token) -> JSONResponse:
    """Keep the token as a cookie; HTTP 403 for one that is none."""
    front = front_of(request)
    try:
        front.gate.backoff.attempt(address_of(request), "wall display")
    except WaitError as wait:
        raise HTTPException(429, str(wait), {"retry-after": str(round(wait.seconds) + 1)}) from None
    found = front.gate.tokens.find(body.token, WALL)
    if found is None:
        front.gate.audit.refused("wall display", "", address_of(request), "unknown or revoked")
        raise HTTPException(403, "this link is unknown, revoked or past its end")
    front.gate.backoff.forgive(address_of(request), "wall display")
    token, user = found
    front.gate.audit.done("wall display", user.name, address_of(request), token.name)
    answer = JSONResponse({"display": token.name})
    life_s = max(1.0, token.ends - time.time())
    give_cookie(front.settings, answer, cookie_of(front), body.token, life_s)
    return answer


@routes.get("/wall/stream")
async def stream(
    request: Request, device: Annotated[str, Query(max_length=64)] = ""
) -> StreamingResponse:
    """Poses ten times a second and the state once, as server-sent events."""
    who, front = onlooker(request), front_of(request)
    if front.store is None:
        raise HTTPException(503, "this dashboard has no connection to the bus")
    walls = request.app.state.walls
    if walls.total() >= MOST:
        raise HTTPException(429, f"{MOST} displays are open: close one", {"retry-after": "30"})
    return StreamingResponse(_events(request, front, who, device), media_type="text/event-stream")


async def _events(request: Request, front: Front, who: Asker, device: str) -> AsyncIterator[str]:
    walls, bell, store = request.app.state.walls, front.gate.bell, front.store
    assert store is not None  # looked at by who begins this
    walls[who.name] += 1
    due, seen = 0.0, -1
    try:
        yield "retry: 2000\n\n"
        while True:
            now, rung = time.monotonic(), bell.rung
            if now >= due or rung != seen:
                due, seen = now + STATE_S, rung
                try:
                    onlooker(request)
                except (HTTPException, UsersError):
                    yield _event("end", {"why": "this display is not signed in any more"})
                    return
                with store.lock:
                    said = state(store, device, front.settings.stale_s)
                status = front.desk.status if front.desk is not None else None
                more = {"build": BUILD, "at_s": time.time(), "command": commanding(status)}
                yield _event("state", said | more)
            with store.lock:
                found = chosen(store, device)
                pose = None if found is None else moving(found)
            if pose is not None:
                yield _event("pose", pose)
            await bell.wait(seen, POSES_S)
    finally:
        walls[who.name] -= 1
        if not walls[who.name]:
            del walls[who.name]


def _event(name: str, said: dict) -> str:
    return f"event: {name}\ndata: {json.dumps(said, allow_nan=False)}\n\n"


@routes.post("/users/walls")
async def change_walls(request: Request, who: SignedIn) -> Response:
    """Make the link of a display, which this answer alone shows, or (field `revoke`) end one."""
    who, fields = await signed_form(request)
    check_role(who, Role.admin, request)
    gate, address = front_of(request).gate, address_of(request)
    path = gate.settings.users
    try:
        if "revoke" in fields:
            gone = revoke_token(path, fields["revoke"])
            gate.audit.done("wall display ended", who.name, address, f"{gone.id} ({gone.name})")
            gate.bell.ring()
            return users_with(request, who)
        try:
            days = float(fields.get("days", ""))
        except ValueError:
            raise UsersError("days: want a number") from None
        secret, one = issue_token(path, who.name, fields.get("name", ""), "viewer", days, WALL)
    except UsersError as error:
        return users_with(request, who, str(error), 422)
    gate.audit.done("wall display made", who.name, address, f"{one.id} ({plain(one.name)})")
    host = request.headers.get("host", "")
    scheme = "https" if front_of(request).settings.secure else "http"
    return users_with(request, who, wall=f"{scheme}://{host}/wall/open#{secret}")
