"""What every request passes before any other code of ours: host, origin, body limits; and headers
on every answer.

One ASGI layer around the whole application, HTTP and WebSocket alike.
"""

import asyncio
import contextlib
import ipaddress
import json
import time
from collections.abc import Iterator
from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from dashboard.settings import DashboardSettings

SAFE_METHODS = {"GET", "HEAD", "OPTIONS"}
PAGE_CSP = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src"
    " 'self'; frame-src 'self'; form-action 'self'; base-uri 'none'; frame-ancestors 'none'"
)
# What a page of ours might be asked for by a script and needs none of.
PERMISSIONS = ", ".join(
    f"{name}=()"
    for name in (
        "accelerometer ambient-light-sensor bluetooth browsing-topics camera display-capture"
        " geolocation gyroscope hid idle-detection local-fonts magnetometer microphone midi payment"
        " serial storage-access usb window-management xr-spatial-tracking"
    ).split()
)


STILL = "still signed in"  # in a request's scope: may who asked go on to read the answer?
LOOK_S = 1.0  # between two looks at that, while a long answer is sent


class SignedOut(Exception):
    """In the middle of an answer."""


class Refused(Exception):
    """This request goes no further."""

    def __init__(self, status: int, text: str) -> None:
        super().__init__(text)
        self.status, self.text = status, text


def host_name(host: str) -> str:
    """The name or address in a Host header, without port and brackets; raises ValueError for what
    is none.
    """
    parts = urlsplit(f"//{host}")
    if (
        not parts.hostname
        or parts.netloc != host
        or "@" in host
        or "/" in host
        or "?" in host
        or "#" in host
    ):
        raise ValueError(f"{host!r} is no host")
    parts.port  # noqa: B018 - raises ValueError for a port that is no number
    return parts.hostname.lower()


def same_origin(origin: str, host: str, secure: bool) -> bool:
    """True when a browser's Origin is this server as the browser sees it (host: the Host
    header).
    """
    try:
        parts = urlsplit(origin)
    except ValueError:
        return False
    schemes = {"https"} if secure else {"http", "https"}  # https too: TLS may end in front of us
    return parts.scheme in schemes and parts.netloc.lower() == host.lower() != ""


class Guard:
    """The layer. Bodies are read here as a whole, so that a chunked one cannot pass the limit
    either.
    """

    def __init__(self, app: ASGIApp, settings: DashboardSettings) -> None:
        self._app, self._settings = app, settings
        self._hosts = {"localhost", *settings.allowed_hosts}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        with_headers = self._answering(send, scope)
        try:
            self._check(scope)
            if scope["type"] == "http":
                receive = replay_body(await self._body(scope, receive), receive)
        except Refused as refused:
            await refuse(scope, with_headers if scope["type"] == "http" else send, refused)
            return
        with contextlib.suppress(SignedOut):  # what is not complete ends with its connection
            await self._app(scope, receive, with_headers if scope["type"] == "http" else send)

    def _check(self, scope: Scope) -> None:
        headers = Headers(scope=scope)
        host = headers.get("host", "")
        try:
            name = host_name(host)
        except ValueError:
            raise Refused(400, "the Host header is missing or is no host name") from None
        if name not in self._hosts and not _is_address(
            name
        ):  # a rebound DNS name is never a bare address
            raise Refused(
                400, f"host {name[:100]!r} is not served here: add it to [dashboard] allowed_hosts"
            )
        origin = headers.get("origin")
        if scope["type"] == "websocket":
            if origin is None or not same_origin(origin, host, self._settings.secure):
                raise Refused(403, "WebSocket from another site refused")
        elif scope["method"] not in SAFE_METHODS:
            foreign = headers.get("sec-fetch-site", "same-origin") not in ("same-origin", "none")
            if foreign or (
                origin is not None and not same_origin(origin, host, self._settings.secure)
            ):
                raise Refused(403, "request from another site refused")

    async def _body(self, scope: Scope, receive: Receive) -> bytes:
        limit = self._settings.body_limit
        headers = Headers(scope=scope)
        if "content-length" in headers and "transfer-encoding" in headers:
            # a proxy that goes by the other one would take the rest for somebody's next request
            raise Refused(400, "the length of the body is said in two ways")
        length = headers.get("content-length", "0")
        if not length.isdigit() or int(length) > limit:
            raise Refused(413, f"body larger than {limit} bytes")
        body = bytearray()
        try:
            async with asyncio.timeout(self._settings.body_timeout_s):
                while True:
                    message = await receive()
                    if message["type"] == "http.disconnect":
                        return bytes(body)
                    body += message.get("body", b"")
                    if len(body) > limit:
                        raise Refused(413, f"body larger than {limit} bytes")
                    if not message.get("more_body", False):
                        return bytes(body)
        except TimeoutError:
            raise Refused(
                408, f"body not complete within {self._settings.body_timeout_s:g} s"
            ) from None

    def _answering(self, send: Send, scope: Scope) -> Send:
        """Adds our headers, and ends a long answer with the sign-in of who asked for it."""
        host = Headers(scope=scope).get("host", "")
        lasting = self._settings.secure and not host.startswith("localhost")
        due, events = time.monotonic() + LOOK_S, False

        async def wrapped(message: Message) -> None:
            nonlocal due, events
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in security_headers(lasting):
                    headers.setdefault(name, value)
                # streams of events look themselves, and say why they end
                events = headers.get("content-type", "").startswith("text/event-stream")
            elif not events and message.get("more_body") and time.monotonic() >= due:
                due = time.monotonic() + LOOK_S
                still = scope.get(STILL)
                if still is not None and not still():
                    raise SignedOut
            await send(message)

        return wrapped


def security_headers(lasting: bool) -> Iterator[tuple[str, str]]:
    """Headers of every answer that did not set its own. lasting: by https from now on, which is for
    all ports of a host: not asked of `localhost`, where others serve, too.
    """
    yield "content-security-policy", PAGE_CSP
    yield "x-content-type-options", "nosniff"
    yield "x-frame-options", "DENY"
    yield (
        "referrer-policy",
        "same-origin",
    )  # not no-referrer: that would make the Origin of our own forms "null"
    yield "cross-origin-opener-policy", "same-origin"
    yield "cross-origin-resource-policy", "same-origin"
    yield "permissions-policy", PERMISSIONS
    yield "origin-agent-cluster", "?1"
    yield "x-permitted-cross-domain-policies", "none"
    yield "cache-control", "no-store"
    if lasting:
        yield "strict-transport-security", "max-age=31536000"


def replay_body(body: bytes, receive: Receive) -> Receive:
    """A receive that gives the body again, in one piece, and then waits for the disconnect."""
    given = False

    async def again() -> Message:
        nonlocal given
        if given:
            return await receive()
        given = True
        return {"type": "http.request", "body": body, "more_body": False}

    return again


async def refuse(scope: Scope, send: Send, refused: Refused) -> None:
    """Answer and close: a client that sends too much is not read any further."""
    if scope["type"] == "websocket":
        await send({"type": "websocket.close", "code": 1008, "reason": refused.text[:120]})
        return
    body = json.dumps({"error": refused.text}).encode()
    headers = [
        (b"content-type", b"application/json"),
        (b"content-length", b"%d" % len(body)),
        (b"connection", b"close"),
    ]
    await send({"type": "http.response.start", "status": refused.status, "headers": headers})
    await send({"type": "http.response.body", "body": body})


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True
