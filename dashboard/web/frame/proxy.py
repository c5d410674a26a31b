"""The scene behind sign-in: viser's page, and its WebSocket with the messages each role may send.

viser 1.1 has no login and no roles: any client can drive any widget and can ask the server to open
a public tunnel. So it listens on the loopback only and every message of a browser is looked at
here (scene_messages.py).
"""

import asyncio
import logging
import time
from collections import Counter
from collections.abc import Callable, Collection
from urllib.parse import parse_qsl, urlencode

import websockets
from fastapi import APIRouter, Request, WebSocket
from fastapi.responses import HTMLResponse, RedirectResponse, Response
from starlette.websockets import WebSocketDisconnect

from dashboard.settings import DashboardSettings
from dashboard.web.auth import Gate, Role
from dashboard.web.command.seats import Seats
from dashboard.web.frame.flow import Flow
from dashboard.web.frame.scene_messages import (
    DROPPED_QUIETLY,
    OPERATOR_MAY,
    VIEWER_MAY,
    BadMessage,
    Widgets,
    may_send,
    message_type,
    update,
)
from dashboard.web.frame.scene_page import policy, scene_page, script_hashes
from messages.text import plain

log = logging.getLogger(__name__)

FOREIGN_PARAMETERS = {
    "websocket",
    "playbackPath",
}  # they point viser's page at other servers and files
RIGHTS_S = 1.0  # between two looks at rights that another process may have changed
# A camera may follow the cube by itself, and what counts a download is no person.
BY_A_PERSON = OPERATOR_MAY.keys() - VIEWER_MAY.keys()


class Rate:
    """Allows `rate` messages per second with a burst of two seconds' worth."""

    def __init__(self, rate: float) -> None:
        self._rate, self._level, self._last = rate, 2 * rate, time.monotonic()

    def take(self) -> bool:
        """False when this message is one too many."""
        now = time.monotonic()
        self._level = min(2 * self._rate, self._level + (now - self._last) * self._rate)
        self._last = now
        self._level -= 1
        return self._level >= 0


def router(
    settings: DashboardSettings,
    gate: Gate,
    scene_port: Callable[[], int],
    open_labels: Collection[str],
    seats: Seats,
) -> APIRouter:
    """GET /scene/ and the WebSocket /scene/; scene_port gives viser's port on the loopback."""
    routes = APIRouter(include_in_schema=False)
    page, version = scene_page()
    script_hashes()  # now, not while the first browser waits
    open_scenes: Counter[str] = Counter()  # user -> scenes

    @routes.get("/scene/")
    def scene(request: Request) -> Response:
        if gate.session_of(request) is None:
            return RedirectResponse("/login", 303)
        query = parse_qsl(request.url.query, keep_blank_values=True)
        clean = [(key, value) for key, value in query if key not in FOREIGN_PARAMETERS]
        if clean != query:
            return RedirectResponse("/scene/" + (f"?{urlencode(clean)}" if clean else ""), 303)
        headers = {
            "content-security-policy": policy(request.headers["host"], settings.secure),
            "x-frame-options": "SAMEORIGIN",
            "cache-control": "private, max-age=3600",
            "etag": f'"viser-{version}"',
        }
        return HTMLResponse(page, headers=headers)

    @routes.websocket("/scene")  # viser's page drops the last slash of its own address
    @routes.websocket("/scene/")
    async def scene_socket(socket: WebSocket) -> None:
        found = gate.session_of(socket)
        if found is None:
            await socket.close(1008, "sign in first")
            return
        user = found[1].name
        if open_scenes[user] >= settings.scenes_per_user or (
            open_scenes.total() >= settings.scenes
        ):
            log.warning("%s has %d scenes open: one more refused", user, open_scenes[user])
            socket.app.state.front.ended["too many scenes"] += 1
            await socket.close(1013, "too many scenes are open: close other tabs")
            return
        open_scenes[user] += 1
        try:
            await Relay(settings, gate, socket, open_labels, seats).run(scene_port())
        finally:
            open_scenes[user] -= 1

    return routes


class Relay:
    """One browser's WebSocket joined to viser's.

    Nothing is queued here: a browser that reads slowly makes this side stop reading from viser, and
    viser then skips to the newest values. One that reads nothing for stall_s is dropped.
    """

    def __init__(
        self,
        settings: DashboardSettings,
        gate: Gate,
        socket: WebSocket,
        open_labels: Collection[str],
        seats: Seats,
    ) -> None:
        self._settings, self._gate, self._socket = settings, gate, socket
        self._widgets = Widgets(open_labels)
        self._key = gate.key_of(socket)
        self._seat = seats.of_key(self._key)
        self._rate = Rate(settings.message_rate)
        self._refused: set[str] = set()  # names said already
        self._who = "nobody"
        self._told = ""  # role and name that the scene knows of
        self._flow = Flow()

    async def run(self, port: int) -> None:
        """Until either side ends."""
        wanted = self._socket.headers.get("sec-websocket-protocol", "")
        protocol = next(
            (name.strip() for name in wanted.split(",") if name.strip().startswith("viser-v")), None
        )
        if protocol is None:
            await self._socket.close(1002, "want the subprotocol viser-v...")
            return
        try:
            scene = await websockets.connect(
                f"ws://127.0.0.1:{port}/",
                subprotocols=[websockets.Subprotocol(protocol)],
                compression=None,
                max_size=None,  # what viser sends is ours
                max_queue=2,  # so that a slow browser is felt by viser
                ping_interval=None,
                proxy=None,
            )
        except (OSError, websockets.WebSocketException) as error:
            log.error("scene at 127.0.0.1:%d does not answer: %s", port, error)
            await self._socket.close(1013, "the scene does not answer; try again")
            return
        flows: dict[str, list[Flow]] = self._socket.app.state.flows
        async with scene:
            await self._socket.accept(protocol)
            flows.setdefault(self._seat, []).append(self._flow)
            try:
                await self._join(scene)
            finally:
                flows[self._seat].remove(self._flow)
                if not flows[self._seat]:
                    del flows[self._seat]

    async def _join(self, scene: websockets.ClientConnection) -> None:
        tasks = [
            asyncio.create_task(self._to_browser(scene)),
            asyncio.create_task(self._to_scene(scene)),
            asyncio.create_task(self._watch(scene)),
        ]
        done, pending = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        for task in pending:
            task.cancel()
        await asyncio.gather(*pending, return_exceptions=True)
        code, reason = 1011, "the scene ended"
        for task in done:
            error = task.exception()
            if error is None:
                code, reason = task.result()
            elif not isinstance(
                error, websockets.ConnectionClosed | WebSocketDisconnect | RuntimeError
            ):
                log.error("scene of %s: %s: %s", self._who, type(error).__name__, error)
        try:
            async with asyncio.timeout(1.0):
                await self._socket.close(code, reason)
        except (RuntimeError, TimeoutError, WebSocketDisconnect):
            pass  # it is closed already, or takes nothing any more

    async def _to_browser(self, scene: websockets.ClientConnection) -> tuple[int, str]:
        async for message in scene:
            if isinstance(message, bytes):
                self._widgets.learn(message)
                await self._tell_role(scene)
            try:
                async with asyncio.timeout(self._settings.stall_s):
                    await self._socket.send_bytes(
                        message if isinstance(message, bytes) else message.encode()
                    )
                self._flow.add(len(message))
            except TimeoutError:
                log.warning(
                    "browser of %s took nothing for %g s: dropped",
                    self._who,
                    self._settings.stall_s,
                )
                self._count("a scene took nothing")
                return 1013, "this browser is too slow"
        return 1012, "the scene restarts"

    async def _to_scene(self, scene: websockets.ClientConnection) -> tuple[int, str]:
        while True:
            message = await self._socket.receive()
            if message["type"] == "websocket.disconnect":
                return 1000, ""
            data = message.get("bytes")
            if data is None or len(data) > self._settings.message_limit:
                self._count("a scene sent what is too large, or text")
                return 1009, f"want binary messages of at most {self._settings.message_limit} bytes"
            found = self._gate.look_up(self._key)
            if found is None:
                return 1008, "signed out"
            if not self._rate.take():
                log.warning(
                    "browser of %s sends more than %g messages/s: dropped",
                    self._who,
                    self._settings.message_rate,
                )
                self._count("a scene sent too much")
                return 1008, "too many messages"
            self._who, role = found[1].name, found[1].role
            try:
                name, fields = message_type(data)
            except BadMessage as error:
                log.warning("browser of %s: %s", self._who, error)
                self._count("a scene sent what is no message")
                return 1007, "not a message of viser's"
            if may_send(role, name, fields, self._widgets):
                self._gate.look_up(self._key, used=name in BY_A_PERSON)
                await scene.send(data)
            else:
                self._note(role, name)

    def _count(self, why: str) -> None:
        """A scene that is ended, for the page."""
        self._socket.app.state.front.ended[why] += 1

    def _note(self, role: Role, name: str) -> None:
        """Say each refused kind once per connection: a browser may repeat it at any rate."""
        if name not in self._refused and name not in DROPPED_QUIETLY and len(self._refused) < 20:
            self._refused.add(name)
            log.warning("refused %s of %s (%s) to the scene", plain(name, 64), self._who, role.name)

    async def _tell_role(self, scene: websockets.ClientConnection) -> None:
        """Let the scene know who looks: it greys what is not his, and orders bear his name."""
        found = self._gate.look_up(self._key)
        who = "" if found is None else f"{found[1].role.name} {found[1].name}\t{self._seat}"
        if who and self._widgets.role and who != self._told:
            self._told = who
            await scene.send(update(self._widgets.role, who))

    async def _watch(self, scene: websockets.ClientConnection) -> tuple[int, str]:
        """Ends the connection of a browser that was signed out, also when it sends nothing."""
        while True:
            rung = self._gate.bell.rung
            found = self._gate.look_up(self._key)
            if found is None:
                return 1008, "signed out"
            self._who = found[1].name
            await self._tell_role(scene)
            await self._gate.bell.wait(rung, RIGHTS_S)
