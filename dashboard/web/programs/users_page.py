"""The page of users and of the tokens of their programs, for admins."""

import logging

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse, RedirectResponse, Response

from dashboard.web.auth import Role
from dashboard.web.front import Asker, check_role, front_of
from dashboard.web.pages import SignedIn, render, signed_form
from dashboard.web.programs.tokens import issue_token, load_tokens, revoke_token
from dashboard.web.users import UsersError, add_user, remove_user

log = logging.getLogger(__name__)

routes = APIRouter(include_in_schema=False)


@routes.get("/users")
def users_page(request: Request, who: SignedIn) -> HTMLResponse:
    check_role(who, Role.admin, request)
    return _users(request, who)


def _users(
    request: Request, who: Asker, fault: str = "", status: int = 200, secret: str = ""
) -> HTMLResponse:
    gate = front_of(request).gate
    users = sorted(gate.users.all().values(), key=lambda user: user.name)
    tokens = sorted(load_tokens(gate.settings.users).values(), key=lambda one: one.created)
    return render(
        request,
        "users.html",
        who,
        status,
        users=users,
        roles=[role.name for role in Role],
        fault=fault,
        tokens=[(one, gate.tokens.uses.get(one.id)) for one in tokens],
        refused_tokens=gate.tokens.refused,
        secret=secret,
        ended=front_of(request).ended.most_common(),
    )


@routes.post("/users")
async def change_users(request: Request) -> Response:
    """Add a user, change his role and password, or (field `remove`) remove him."""
    who, fields = await signed_form(request)
    check_role(who, Role.admin, request)
    settings, name = front_of(request).settings, fields.get("name", "")
    try:
        if "remove" in fields:
            if name == who.name:
                raise UsersError("you cannot remove yourself: another admin can")
            remove_user(settings.users, name)
        else:
            add_user(settings.users, name, fields.get("password", ""), fields.get("role", ""))
    except UsersError as error:
        return _users(request, who, str(error), 422)
    return RedirectResponse("/users", 303)


@routes.post("/users/tokens")
async def change_tokens(request: Request) -> Response:
    """Make an API token, which this answer alone shows, or (field `revoke`) take one back."""
    who, fields = await signed_form(request)
    check_role(who, Role.admin, request)
    users_file = front_of(request).settings.users
    try:
        if "revoke" in fields:
            gone = revoke_token(users_file, fields["revoke"])
            log.info("%s revoked token %s (%s) of %s", who.name, gone.id, gone.name, gone.user)
            return RedirectResponse("/users", 303)
        try:
            days = float(fields.get("days", ""))
        except ValueError:
            raise UsersError("days: want a number") from None
        named = (fields.get("user", ""), fields.get("name", ""), fields.get("role", ""))
        secret, entry = issue_token(users_file, *named, days)
    except UsersError as error:
        return _users(request, who, str(error), 422)
    log.info("%s made token %s (%s) of %s", who.name, entry.id, entry.role, entry.user)
    return _users(request, who, secret=secret)
