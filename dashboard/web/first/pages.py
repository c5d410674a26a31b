"""The first-run page: what `gyrofree setup` asks, in the browser. Administrators only."""

import asyncio

from fastapi import APIRouter, HTTPException, Request
from fastapi.responses import HTMLResponse, RedirectResponse, Response

from dashboard.web.auth import Role
from dashboard.web.control import ControlError
from dashboard.web.first.control import FirstRun
from dashboard.web.front import Asker, audit_of, check_role, front_of
from dashboard.web.pages import SignedIn, render, signed_form
from dashboard.web.users import UsersError, add_user

routes = APIRouter(include_in_schema=False)

# fields of the form, each an option of `gyrofree setup`
FIELDS = ("port", "baud", "name", "layout", "half-side", "pulses", "gnss-port", "gnss-baud")
PROPOSED = {
    "name": "cube",
    "layout": "cube",
    "half-side": "0.05",
    "pulses": "360",
    "gnss-baud": "38400",
}
NAMES = {"imu": "imu", "analogue": "tilt-board"}  # of a board by what its samples are


def _first_run(request: Request, who: Asker) -> FirstRun:
    check_role(who, Role.admin, request)
    found = front_of(request).first_run
    if found is None:
        raise HTTPException(409, "a board is configured already: gyrofree setup adds another")
    return found


@routes.get("/setup")
def page(request: Request, who: SignedIn) -> HTMLResponse:
    return _page(request, who, _first_run(request, who))


@routes.post("/setup")
async def act(request: Request) -> Response:
    """Field `look`: listen; `later`: go on without a board; else write what was filled in."""
    who, fields = await signed_form(request)
    first = _first_run(request, who)
    try:
        if "later" in fields:
            first.over = True
            return RedirectResponse("/", 303)
        if "look" in fields:
            await asyncio.to_thread(first.look)
            return RedirectResponse("/setup", 303)
        if fields.get("user"):
            users = front_of(request).settings.users
            await asyncio.to_thread(
                add_user, users, fields["user"], fields.get("password", ""), Role.admin
            )
            audit_of(request).done("user made, admin", who.name, detail=fields["user"])
        if fields.get("port", "").strip().startswith("file:"):
            raise ControlError("a file is no board: `gyrofree setup` in a terminal takes one")
        answers = {name: fields[name].strip() for name in FIELDS if fields.get(name, "").strip()}
        await asyncio.to_thread(first.write, answers)
    except (ControlError, UsersError) as error:
        return _page(request, who, first, fields, str(error), 422)
    return RedirectResponse("/", 303)


def _page(
    request: Request,
    who: Asker,
    first: FirstRun,
    filled: dict[str, str] | None = None,
    fault: str = "",
    status: int = 200,
) -> HTMLResponse:
    heard = first.heard or []
    return render(
        request,
        "setup.html",
        who,
        status,
        heard=heard,
        looked=first.heard is not None,
        filled=PROPOSED | _proposed(heard) | (filled or {}),
        fault=fault,
    )


def _proposed(heard: list[dict]) -> dict[str, str]:
    """What was heard fills in the form."""
    board = next((one for one in heard if one["kind"] == "board"), None)
    receiver = next((one for one in heard if one["kind"] == "receiver"), None)
    filled = {}
    if board is not None:
        filled = {"port": board["port"], "baud": str(board["baud"])}
        filled |= {"name": NAMES.get(board.get("board", ""), "cube")}
    if receiver is not None and not (board or {}).get("receiver"):
        filled |= {"gnss-port": receiver["port"], "gnss-baud": str(receiver["baud"])}
    return filled
