"""A lab's own identity provider, by OpenID Connect: where to send people, and who came back.

Authorisation code with PKCE. authlib builds the request and judges the claims, joserfc the
signature. Of the answers of the provider nothing is believed that is not signed by a key of the
issuer that the settings name, and is for us, fresh, and of this very attempt.
"""

import logging
import secrets
import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any
from urllib.parse import urlsplit

import httpx
from authlib.common.urls import add_params_to_uri
from authlib.oauth2.rfc6749.parameters import prepare_grant_uri
from authlib.oauth2.rfc7636 import create_s256_code_challenge
from authlib.oidc.core import CodeIDToken
from joserfc import jwt
from joserfc.errors import JoseError
from joserfc.jwk import KeySet

from dashboard.settings import DashboardSettings
from dashboard.web.users import USER_NAME, Role
from messages.text import plain

ALGORITHMS = ["RS256", "PS256", "ES256", "ES384", "EdDSA", "Ed25519"]  # none of a shared secret
LEEWAY_S = 60  # between the provider's clock and ours
KEPT_S = 3600.0  # what the provider says of itself
WAIT_S = 10.0
LARGEST = 1 << 20  # bytes of an answer
LOCAL = ("127.0.0.1", "::1", "localhost")  # may be reached without TLS

log = logging.getLogger(__name__)


class ProviderError(Exception):
    """Nobody is signed in; the text is for the person who wanted to be."""


@dataclass(frozen=True)
class Attempt:
    """One way to the provider and back, of one browser."""

    wanted: str  # page to go to
    network: str = ""  # that it comes from
    state: str = field(default_factory=lambda: secrets.token_urlsafe(32))
    nonce: str = field(default_factory=lambda: secrets.token_urlsafe(32))
    verifier: str = field(default_factory=lambda: secrets.token_urlsafe(64))
    began: float = field(default_factory=time.monotonic)


@dataclass(frozen=True)
class Person:
    """Who the provider says it is, with the role that the settings give."""

    name: str
    role: Role
    token: str = field(default="", repr=False)  # the identity itself


class Provider:
    """The provider of the settings; asked when somebody wants to sign in, and not before."""

    def __init__(self, settings: DashboardSettings) -> None:
        self._settings = settings
        self._about: dict[str, Any] = {}
        self._keys = KeySet([])
        self._asked = -KEPT_S

    @property
    def back(self) -> str:
        """Where the provider sends people back to."""
        return f"{self._settings.oidc_address.rstrip('/')}/login/provider/back"

    async def address(self, attempt: Attempt) -> str:
        """The provider's page for this attempt; raises ProviderError."""
        about = await self._described()
        return prepare_grant_uri(
            about["authorization_endpoint"],
            self._settings.oidc_client,
            "code",
            self.back,
            self._settings.oidc_scope.split(),
            attempt.state,
            nonce=attempt.nonce,
            code_challenge=create_s256_code_challenge(attempt.verifier),
            code_challenge_method="S256",
        )

    async def person(self, attempt: Attempt, code: str) -> Person:
        """Who is behind a code; raises ProviderError."""
        about = await self._described()
        settings = self._settings
        form = {
            "grant_type": "authorization_code",
            "code": code,
            "redirect_uri": self.back,
            "code_verifier": attempt.verifier,
            "client_id": settings.oidc_client,
        }
        secret = _secret(settings)
        auth = httpx.BasicAuth(settings.oidc_client, secret) if secret else None
        answer = await self._ask("POST", about["token_endpoint"], data=form, auth=auth)
        token = answer.get("id_token")
        if not isinstance(token, str):
            raise ProviderError("the identity provider's answer has no identity in it")
        claims = await self._verified(token, attempt, answer.get("access_token"))
        return replace(self._of(claims), token=token)

    async def farewell(self, token: str) -> str:
        """The provider's page that ends the sign-in there, for an identity of its own; empty where
        it names none, or does not answer: here it has ended already.
        """
        try:
            about = await self._described()
            url = about.get("end_session_endpoint")
            if url is None:
                return ""
            _check_address("end_session_endpoint", url)
        except ProviderError as error:
            log.warning("signed out here only: %s", error)
            return ""
        said = {
            "id_token_hint": token,
            "client_id": self._settings.oidc_client,
            "post_logout_redirect_uri": f"{self._settings.oidc_address.rstrip('/')}/login",
        }
        return add_params_to_uri(url, list(said.items()))

    async def _verified(self, token: str, attempt: Attempt, access: object) -> CodeIDToken:
        settings = self._settings
        for fresh in (False, True):  # a key that is not known may be a new one
            await self._described(fresh)
            try:
                found = jwt.decode(token, self._keys, algorithms=ALGORITHMS)
                break
            except (JoseError, ValueError, TypeError, KeyError) as error:
                if fresh:
                    raise ProviderError(f"the identity is not signed rightly: {error}") from None
        claims = CodeIDToken(
            found.claims,
            found.header,
            {
                "iss": {"essential": True, "value": settings.oidc_issuer},
                "aud": {"essential": True, "value": settings.oidc_client},
            },
            {
                "nonce": attempt.nonce,
                "client_id": settings.oidc_client,
                "access_token": access if isinstance(access, str) else None,
            },
        )
        try:
            claims.validate(int(time.time()), LEEWAY_S)
        except (JoseError, ValueError, TypeError) as error:
            raise ProviderError(
                f"the identity is not for this page, or not for now: {plain(str(error), 200)}"
            ) from None
        return claims

    def _of(self, claims: Mapping[str, Any]) -> Person:
        settings = self._settings
        said = str(claims.get(settings.oidc_name_claim) or claims["sub"])
        name = f"{said}@{settings.oidc_suffix}"
        if not USER_NAME.fullmatch(name):
            raise ProviderError(f"{plain(said, 80)!r} cannot be a name here")
        groups = claims.get(settings.oidc_role_claim, [])
        mine = set(map(str, groups if isinstance(groups, list) else [groups]))
        for role, wanted in (
            (Role.admin, settings.oidc_admins),
            (Role.operator, settings.oidc_operators),
            (Role.viewer, settings.oidc_viewers),
        ):
            if mine & set(wanted) or "*" in wanted:
                return Person(name, role)
        raise ProviderError(
            f"{name} is known there, but {settings.oidc_role_claim} gives no role here: ask who"
            " runs the dashboard"
        )

    async def _described(self, fresh: bool = False) -> dict[str, Any]:
        """What the provider says of itself, and its keys."""
        if not fresh and time.monotonic() - self._asked < KEPT_S:
            return self._about
        issuer = self._settings.oidc_issuer
        about = await self._ask("GET", f"{issuer.rstrip('/')}/.well-known/openid-configuration")
        if about.get("issuer") != issuer:
            raise ProviderError(f"{issuer} calls itself {plain(str(about.get('issuer')), 200)}")
        wanted = ("authorization_endpoint", "token_endpoint", "jwks_uri")
        for key in wanted:
            _check_address(key, about.get(key))
        try:
            keys = KeySet.import_key_set(await self._ask("GET", about["jwks_uri"]))  # type: ignore[arg-type]
        except (JoseError, ValueError, TypeError, KeyError) as error:
            raise ProviderError(f"the identity provider's keys cannot be read: {error}") from None
        self._about, self._keys, self._asked = about, keys, time.monotonic()
        return about

    async def _ask(self, method: str, url: str, **options: Any) -> dict[str, Any]:
        trust: Any = str(self._settings.oidc_ca) if self._settings.oidc_ca else True
        try:
            async with (
                httpx.AsyncClient(verify=trust, timeout=WAIT_S, trust_env=False) as client,
                client.stream(method, url, **options) as answer,
            ):
                body = b""
                async for part in answer.aiter_bytes():
                    body += part
                    if len(body) > LARGEST:
                        raise ProviderError("the identity provider says too much")
                found = httpx.Response(answer.status_code, content=body).json()
        except (httpx.HTTPError, httpx.InvalidURL, OSError) as error:
            raise ProviderError(f"the identity provider does not answer: {error!r:.200}") from None
        except (ValueError, RecursionError):
            raise ProviderError("the identity provider does not speak JSON") from None
        if answer.status_code != 200 or not isinstance(found, dict):
            why = found.get("error", "") if isinstance(found, dict) else ""
            text = f"the identity provider says no ({answer.status_code} {plain(str(why), 80)})"
            raise ProviderError(text)
        return found


def _check_address(key: str, url: object) -> None:
    """Raises ProviderError for one that others could read."""
    parts = urlsplit(url) if isinstance(url, str) else urlsplit("")
    if parts.scheme != "https" and not (parts.scheme == "http" and parts.hostname in LOCAL):
        raise ProviderError(f"the identity provider's {key} is {plain(str(url), 200)}: want https")


def _secret(settings: DashboardSettings) -> str:
    if settings.oidc_secret is None:
        return ""
    try:
        return settings.oidc_secret.read_text(encoding="utf-8").strip()
    except (OSError, UnicodeDecodeError) as error:
        raise ProviderError(f"[dashboard] oidc_secret cannot be read: {error}") from None
