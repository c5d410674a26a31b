"""To the identity provider and back. The way back is of the same browser, once, and leads to a page
of ours only.
"""

import hashlib
import time
from collections.abc import Callable
from typing import Annotated

from fastapi import APIRouter, HTTPException, Query, Request
from fastapi.responses import RedirectResponse, Response

from dashboard.web.accounts.provider import Attempt, Provider, ProviderError
from dashboard.web.auth import Backoff, Gate
from dashboard.web.front import address_of
from dashboard.web.pages import caller, give_cookie, own_path, render, set_cookie

ATTEMPTS = 1000  # at a time; the oldest gives way
ATTEMPTS_EACH = 50  # of one network: a flood of them pushes nobody else out
LIFE_S = 600.0
SIGN_INS = 1000  # of which the identity is kept, to end them at the provider, too


def router(gate: Gate) -> APIRouter:
    """GET /login/provider and the way back; nothing where the settings name no provider."""
    routes = APIRouter(include_in_schema=False)
    if not gate.settings.oidc_issuer:
        return routes
    provider, attempts = Provider(gate.settings), dict[str, Attempt]()
    cookie = gate.settings.cookie + "-attempt"
    identities: dict[str, str] = {}  # by the key of a sign-in, for as long as this process runs

    async def farewell(key: str) -> str:
        token = identities.pop(key, "")
        return await provider.farewell(token) if token else ""

    gate.farewell = farewell

    @routes.get("/login/provider")
    async def go(
        request: Request, wanted: Annotated[str, Query(alias="next", max_length=1600)] = "/"
    ) -> Response:
        attempt = Attempt(own_path(wanted), Backoff.network(address_of(request)))
        try:
            answer = RedirectResponse(await provider.address(attempt), 303)
        except ProviderError as error:
            raise _no(gate, request, error, 503) from None
        _remember(attempts, attempt)
        # lax: the way back begins at the provider's page, which is another site
        give_cookie(gate.settings, answer, cookie, attempt.state, LIFE_S, "lax")
        return answer

    @routes.get("/login/provider/back")
    async def back(
        request: Request,
        state: Annotated[str, Query(max_length=200)] = "",
        code: Annotated[str, Query(max_length=4000)] = "",
        error: Annotated[str, Query(max_length=200)] = "",
        iss: Annotated[str, Query(max_length=500)] = "",
    ) -> Response:
        try:
            attempt = _of_this_browser(attempts, request.cookies.get(cookie, ""), state)
            if error:
                raise ProviderError(f"the identity provider says no ({error})")
            if iss and iss != gate.settings.oidc_issuer:
                raise ProviderError("this answer is of another identity provider")
            person = await provider.person(attempt, code)
            if gate.users.get(person.name) is not None:
                raise ProviderError(f"{person.name} is a user of this dashboard's own, too")
        except ProviderError as fault:
            raise _no(gate, request, fault, 403) from None
        token = gate.begin(person.name, *_named(caller, request), role=person.role)
        identities[_digest(token)] = person.token
        while len(identities) > SIGN_INS:
            identities.pop(next(iter(identities)))
        # a page, and not a redirect: what follows from a page of ours gets the strict cookie
        page = render(request, "entered.html", None, wanted=attempt.wanted)
        page.delete_cookie(cookie, path="/", secure=gate.settings.secure, httponly=True)
        set_cookie(gate.settings, page, token)
        return page

    return routes


def _named(of: Callable[[Request], tuple[str, str]], request: Request) -> tuple[str, str, str]:
    address, agent = of(request)
    return address, "identity provider", agent


def _remember(attempts: dict[str, Attempt], new: Attempt) -> None:
    attempts[_digest(new.state)] = new
    same = [key for key, one in attempts.items() if one.network == new.network]
    for key in same[:-ATTEMPTS_EACH]:
        del attempts[key]
    while len(attempts) > ATTEMPTS:
        attempts.pop(next(iter(attempts)))


def _of_this_browser(attempts: dict[str, Attempt], held: str, state: str) -> Attempt:
    """The attempt, once; raises ProviderError."""
    attempt = attempts.pop(_digest(state), None) if state and state == held else None
    if attempt is None or time.monotonic() - attempt.began > LIFE_S:
        raise ProviderError(
            "this way back was used already, is too old, or began in another browser: sign in anew"
        )
    return attempt


def _no(gate: Gate, request: Request, error: ProviderError, status: int) -> HTTPException:
    gate.audit.refused("sign-in", "", address_of(request), f"identity provider: {error}")
    return HTTPException(status, str(error))


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
