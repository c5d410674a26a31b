"""A small identity provider with a key of its own, on the loopback, that can be told to lie."""

import contextlib
import hashlib
import socket
import threading
import time
from base64 import urlsafe_b64encode
from collections.abc import Iterator
from typing import Any
from urllib.parse import urlencode

import uvicorn
from fastapi import FastAPI, Form, Request
from fastapi.responses import JSONResponse, RedirectResponse
from joserfc import jwt
from joserfc.jwk import OctKey, RSAKey


class Lab:
    """Signs in whoever asks, as `claims` says; `lies` are other claims of the identity, `key` what
    it is signed with, `about` what it says of itself otherwise.
    """

    def __init__(self, port: int) -> None:
        self.issuer = f"http://127.0.0.1:{port}/lab"
        self.key = self.published = RSAKey.generate_key(2048, {"kid": "one"})
        self.claims: dict[str, Any] = {"preferred_username": "lena", "groups": ["operators"]}
        self.lies: dict[str, Any] = {}
        self.about: dict[str, Any] = {}
        self.header: dict[str, Any] = {}
        self.asked: list[dict[str, str]] = []
        self.left: list[str] = []  # who signed out
        self._codes: dict[str, dict[str, str]] = {}
        self.app = FastAPI()
        self._serve()

    def _serve(self) -> None:
        @self.app.get("/lab/.well-known/openid-configuration")
        def described() -> dict[str, Any]:
            return {
                "issuer": self.issuer,
                "authorization_endpoint": f"{self.issuer}/authorize",
                "token_endpoint": f"{self.issuer}/token",
                "jwks_uri": f"{self.issuer}/keys",
                "end_session_endpoint": f"{self.issuer}/leave?of=lab",
            } | self.about

        @self.app.get("/lab/keys")
        def keys() -> dict[str, Any]:
            return {"keys": [self.published.as_dict(private=False)]}

        @self.app.get("/lab/authorize")
        def authorize(request: Request) -> RedirectResponse:
            asked = dict(request.query_params)
            self.asked.append(asked)
            code = f"code-{len(self.asked)}"
            self._codes[code] = asked
            answer = {"code": code, "state": asked["state"], "iss": self.issuer}
            return RedirectResponse(f"{asked['redirect_uri']}?{urlencode(answer)}", 302)

        @self.app.get("/lab/leave", response_model=None)
        def leave(
            of: str, id_token_hint: str, client_id: str, post_logout_redirect_uri: str
        ) -> RedirectResponse | JSONResponse:
            # raises where it is not of ours
            said = jwt.decode(id_token_hint, self.published, algorithms=["RS256"])
            if of != "lab" or said.claims["aud"] != client_id:
                return JSONResponse({"error": "invalid_request"}, 400)
            self.left.append(str(said.claims["preferred_username"]))
            return RedirectResponse(post_logout_redirect_uri, 302)

        @self.app.post("/lab/token")
        def token(
            code: str = Form(), redirect_uri: str = Form(), code_verifier: str = Form()
        ) -> JSONResponse:
            asked = self._codes.pop(code, None)  # a code is good once
            challenge = urlsafe_b64encode(hashlib.sha256(code_verifier.encode()).digest())
            if (
                asked is None
                or asked["redirect_uri"] != redirect_uri
                or asked["code_challenge"] != challenge.decode().rstrip("=")
                or asked["code_challenge_method"] != "S256"
            ):
                return JSONResponse({"error": "invalid_grant"}, 400)
            return JSONResponse({"access_token": "a", "id_token": self._identity(asked)})

    def _identity(self, asked: dict[str, str]) -> str:
        now = int(time.time())
        claims = {
            "iss": self.issuer,
            "sub": "4711",
            "aud": asked["client_id"],
            "nonce": asked["nonce"],
            "iat": now,
            "exp": now + 300,
        }
        claims = {k: v for k, v in (claims | self.claims | self.lies).items() if v is not None}
        header = {"alg": "RS256", "kid": "one"} | self.header
        return jwt.encode(header, claims, self.key, algorithms=[header["alg"]])


@contextlib.contextmanager
def open_lab() -> Iterator[Lab]:
    """Served until the block ends."""
    with socket.create_server(("127.0.0.1", 0)) as bound:
        lab = Lab(bound.getsockname()[1])
        server = uvicorn.Server(uvicorn.Config(lab.app, log_config=None, lifespan="off"))
        server.capture_signals = contextlib.nullcontext  # type: ignore[method-assign]
        thread = threading.Thread(target=server.run, kwargs={"sockets": [bound]})
        thread.start()
        try:
            yield lab
        finally:
            server.should_exit = True
            thread.join(10.0)


SECRET_KEY = OctKey.generate_key(256, {"kid": "one"})
