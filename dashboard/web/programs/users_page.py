"""The page of users and of the tokens of their programs, for admins."""

import asyncio

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse, RedirectResponse, Response

from dashboard.web.auth import Role
from dashboard.web.front import Asker, address_of, check_role, front_of
from dashboard.web.pages import SignedIn, render, signed_form
from dashboard.web.programs.tokens import WALL, issue_token, load_tokens, revoke_token
from dashboard.web.users import UsersError, add_user, remove_user, set_role
from messages.text import plain

routes = APIRouter(include_in_schema=False)


@routes.get("/users")
def users_page(request: Request, who: SignedIn) -> HTMLResponse:
    check_role(who, Role.admin, request)
    return users_with(request, who)


def users_with(
    request: Request,
    who: Asker,
    fault: str = "",
    status: int = 200,
    secret: str = "",
    wall: str = "",
) -> HTMLResponse:
    """The page, with what went wrong, or a new secret that is shown this once."""
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
        tokens=[(one, gate.tokens.uses.get(one.id)) for one in tokens if one.kind != WALL],
        walls=[one for one in tokens if one.kind == WALL],
        wall=wall,
        refused_tokens=gate.tokens.refused,
        secret=secret,
        ended=front_of(request).ended.most_common(),
        sign_ins={user.name: len(gate.sign_ins(user.name)) for user in users},
        certificate=front_of(request).certificate,
        external=sorted(gate.external().items()),
    )


@routes.post("/users")
async def change_users(request: Request) -> Response:
    """Add a user, change his role and password, or (field `remove`) remove him, (`role_only`) give
    him another role, (`end`) end his sign-ins.
    """
    who, fields = await signed_form(request)
    check_role(who, Role.admin, request)
    try:
        act = await asyncio.to_thread(_change, request, who, fields)
    except UsersError as error:
        return users_with(request, who, str(error), 422)
    gate = front_of(request).gate
    gate.audit.done(act, who.name, address_of(request), plain(fields.get("name", ""), 64))
    gate.bell.ring()
    return RedirectResponse("/users", 303)


def _change(request: Request, who: Asker, fields: dict[str, str]) -> str:
    """Do it, and say what was done; raises UsersError."""
    gate, name, role = front_of(request).gate, fields.get("name", ""), fields.get("role", "")
    path = gate.settings.users
    if name == who.name and fields.keys() & {"remove", "role_only"}:
        raise UsersError("you cannot remove yourself or change your own role: another admin can")
    if "remove" in fields:
        remove_user(path, name)
        return "user removed"
    if "end" in fields:
        for key in gate.sign_ins(name):
            gate.end(key, "ended", who.name)
        return "sign-ins of a user ended"
    if "role_only" in fields:
        set_role(path, name, role)
        return f"role {role} given"
    add_user(path, name, fields.get("password", ""), role)
    return f"user made or changed, {role}"


@routes.post("/users/tokens")
async def change_tokens(request: Request) -> Response:
    """Make an API token, which this answer alone shows, or (field `revoke`) take one back."""
    who, fields = await signed_form(request)
    check_role(who, Role.admin, request)
    gate, users_file = front_of(request).gate, front_of(request).settings.users
    try:
        if "revoke" in fields:
            gone = revoke_token(users_file, fields["revoke"])
            text = f"{gone.id} ({gone.name}) of {gone.user}"
            gate.audit.done("token revoked", who.name, address_of(request), text)
            gate.bell.ring()
            return RedirectResponse("/users", 303)
        try:
            days = float(fields.get("days", ""))
        except ValueError:
            raise UsersError("days: want a number") from None
        named = (fields.get("user", ""), fields.get("name", ""), fields.get("role", ""))
        secret, entry = issue_token(users_file, *named, days)
    except UsersError as error:
        return users_with(request, who, str(error), 422)
    text = f"{entry.id} ({entry.name}) of {entry.user}, {entry.role}"
    gate.audit.done("token made", who.name, address_of(request), text)
    return users_with(request, who, secret=secret)
