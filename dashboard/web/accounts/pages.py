"""The pages of one's own sign-ins and password, and, for admins, of who did what."""

import asyncio
import time
from typing import Annotated

from fastapi import APIRouter, HTTPException, Query, Request
from fastapi.responses import HTMLResponse, RedirectResponse, Response

from dashboard.web.auth import Role, WaitError
from dashboard.web.front import Asker, check_role, front_of
from dashboard.web.pages import SignedIn, caller, enter, render, signed_form
from dashboard.web.users import UsersError, set_password
from messages.clock import Moment

routes = APIRouter(include_in_schema=False)

MOST = 300  # entries of the audit log that are shown
SHORT = 16  # characters of a sign-in's key, which is a hash; enough to tell ten apart


@routes.get("/account")
def account_page(request: Request, who: SignedIn) -> HTMLResponse:
    return _account(request, who)


def _account(request: Request, who: Asker, fault: str = "", status: int = 200) -> HTMLResponse:
    gate = front_of(request).gate
    mine = [
        (key[:SHORT], one, _began_s(one.moment, one.created))
        for key, one in gate.sign_ins(who.name).items()
    ]
    return render(
        request,
        "account.html",
        who,
        status,
        mine=mine,
        current=gate.key_of(request)[:SHORT],
        fault=fault,
        hours=f"{gate.settings.session_hours:g}",
        idle=f"{gate.settings.idle_hours:g}",
    )


def _began_s(moment: list[str | int], otherwise: float) -> float:
    """By the wall clock of now, s since 1970."""
    began = Moment.of(moment)
    return otherwise if began is None else time.time() - began.age_s


@routes.post("/account/end")
async def end(request: Request) -> Response:
    """End one sign-in of one's own (field `key`), or `others`."""
    who, fields = await signed_form(request)
    gate, wanted = front_of(request).gate, fields.get("key", "")
    for key in gate.sign_ins(who.name):
        others = wanted == "others" and key != gate.key_of(request)
        if others or key[:SHORT] == wanted:
            gate.end(key, "ended", who.name)
    return RedirectResponse("/account", 303)


@routes.post("/account/password")
async def change_password(request: Request) -> Response:
    """The old one is asked for, and every sign-in under it ends; this browser gets a new one."""
    who, fields = await signed_form(request)
    gate, (address, agent) = front_of(request).gate, caller(request)
    try:
        if await gate.verified(who.name, fields.get("old", ""), address) is None:
            return _account(request, who, "The old password is wrong.", 422)
        if fields.get("new") != fields.get("again"):
            return _account(request, who, "The new passwords differ.", 422)
        if fields.get("new") == fields.get("old"):
            return _account(request, who, "The new password is the old one.", 422)
        new = fields.get("new", "")
        await asyncio.to_thread(set_password, gate.settings.users, who.name, new)
    except WaitError as wait:
        seconds = max(1, round(wait.seconds))
        raise HTTPException(429, str(wait), {"retry-after": str(seconds)}) from None
    except UsersError as error:
        return _account(request, who, str(error), 422)
    gate.audit.done("password changed", who.name, address)
    gate.bell.ring()
    return enter(request, gate.begin(who.name, address, "new password", agent), "/account")


@routes.get("/audit")
def audit_page(
    request: Request, who: SignedIn, q: Annotated[str, Query(max_length=200)] = ""
) -> HTMLResponse:
    check_role(who, Role.admin, request)
    audit = front_of(request).gate.audit
    entries = audit.newest(MOST, q)
    return render(
        request,
        "audit.html",
        who,
        q=q,
        entries=entries,
        lost=audit.lost,
        damaged=audit.damaged,
        most=MOST,
        file=audit.path,
    )
