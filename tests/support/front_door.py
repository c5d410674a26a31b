"""A real front door for the tests: uvicorn on a port of its own, a real small viser server behind
it.
"""

import contextlib
import functools
import re
import ssl
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import msgspec
import viser

from dashboard.service import listen, serve
from dashboard.settings import DashboardSettings
from dashboard.web.auth import Gate, UserStore, add_user
from dashboard.web.front import Front
from dashboard.web.tls.certificate import open_certificate
from dashboard.web.users import issue_link_token, write_private
from sessions.library.catalogue import Catalogue
from support.scene_socket import SceneSocket
from support.waiting import until

PASSWORDS = {"vera": "looks only 1", "otto": "operates 222", "anna": "administers 3"}
SERVICES = ("store", "desk", "replay", "jobs", "first_run", "open_labels")
ROLES = {"vera": "viewer", "otto": "operator", "anna": "admin"}


@functools.cache
def ended(client: httpx.Client, answer: httpx.Response) -> dict[str, Any]:
    """The job that an order began, once it has ended."""
    assert answer.status_code == 200, answer.text
    number = answer.json()["number"]

    def over() -> dict[str, Any] | None:
        time.sleep(0.1)  # the job wants the processor, too
        job = client.get(f"/api/jobs/{number}").json()
        return job if job["state"] in ("done", "failed") else None

    return until(over, "job", 240)


def _users() -> str:
    """A users file, made once: argon2 is slow on purpose."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "users.json"
        for name, password in PASSWORDS.items():
            add_user(path, name, password, ROLES[name])
        return path.read_text()


class Door:
    """A served Front; `ahead` moves the clock of sign-ins forward, s. Without a scene of its own it
    serves the one at port scene_at.
    """

    def __init__(
        self, folder: Path, port: int, scene: bool = True, scene_at: int = 0, **options: Any
    ) -> None:
        services = {key: options.pop(key) for key in SERVICES if key in options}
        options = {"idle_hours": 2.0} | options
        self.settings = DashboardSettings(
            port=port, users=folder / "users.json", sessions_root=folder / "sessions", **options
        )
        self.ahead = 0.0
        self.frozen = 0.0  # s since 1970; when set, time only moves by `ahead`
        if not self.settings.users.exists():  # else those of the server that was here before
            write_private(self.settings.users, _users())
        self.viser = viser.ViserServer(host="127.0.0.1", port=0, verbose=False) if scene else None
        self.front = Front(
            settings=self.settings,
            gate=self.new_gate(),
            catalogue=Catalogue(self.settings.sessions_root),
            scene_port=self.viser.get_port if self.viser else lambda: scene_at,
            certificate=open_certificate(self.settings),
            **services,
        )
        self.url = self.settings.url if self.settings.tls_key else f"http://127.0.0.1:{port}"
        self.trust = trust_in(self.settings.tls_certificate)

    def new_gate(self) -> Gate:
        """A gate as a fresh process would make it."""
        return Gate(
            self.settings,
            UserStore(self.settings.users),
            lambda: (self.frozen or time.time()) + self.ahead,
        )

    @contextlib.contextmanager
    def client(self, name: str = "") -> Iterator[httpx.Client]:
        """A browser, signed in as `name` by a link, with the CSRF header that our pages send."""
        with httpx.Client(
            base_url=self.url, timeout=30.0, headers={"origin": self.url}, verify=self.trust
        ) as client:
            if name:
                token = issue_link_token(self.settings.users, name)
                assert client.post("/login/link", data={"token": token}).status_code == 303
                client.headers["x-csrf-token"] = client.get("/api/me").json()["csrf"]
            yield client

    def scene(self, client: httpx.Client, **options: Any) -> SceneSocket:
        """The scene's WebSocket as that browser opens it."""
        cookies = "; ".join(f"{name}={value}" for name, value in client.cookies.items())
        options = {
            "origin": self.url,
            "subprotocols": [f"viser-v{viser.__version__}"],
            "max_size": None,
        } | options
        return SceneSocket(
            self.url.replace("http", "ws") + "/scene",
            additional_headers={"cookie": cookies},
            ssl=self.trust if self.settings.tls_key else None,
            open_timeout=60.0,  # a busy machine is given time
            **options,
        )


@functools.cache
def trust_in(certificate: Path | None) -> ssl.SSLContext:
    """What a browser goes by that knows this certificate."""
    return ssl.create_default_context(cafile=certificate)


@contextlib.contextmanager
def open_door(folder: Path, at: int = 0, **options: Any) -> Iterator[Door]:
    """Serve until the block ends. at: the port; 0: one that is free."""
    with listen("127.0.0.1", at) as bound:
        door = Door(folder, bound.getsockname()[1], **options)
        stop = threading.Event()
        thread = threading.Thread(target=serve, args=(door.front, bound, stop))
        thread.start()
        try:
            until(
                lambda: httpx.get(door.url + "/api/health", verify=door.trust).status_code == 200,
                "the door answers",
            )
            yield door
        finally:
            stop.set()
            thread.join(10.0)
            if door.viser:
                door.viser.stop()
        assert not thread.is_alive(), "the server did not end"


def message(kind: str, /, **fields: Any) -> bytes:
    """A message as viser's page would send it."""
    return msgspec.msgpack.encode({"type": kind} | fields)


CAMERA = {
    "wxyz": (1.0, 0.0, 0.0, 0.0),
    "position": (1.0, 2.0, 3.0),
    "fov": 1.0,
    "near": 0.1,
    "far": 10.0,
    "image_height": 100,
    "image_width": 100,
    "look_at": (0.0, 0.0, 0.0),
    "up_direction": (0.0, 0.0, 1.0),
}


def form_token(page: str) -> str:
    """The CSRF token in a page's forms."""
    found = re.search(r'name="csrf" (?:value|content)="([^"]+)"', page)
    assert found
    return found[1]
