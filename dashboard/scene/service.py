"""start(): the viser server on the loopback, and the two loops that bring browsers up to date."""

import asyncio
import contextlib
import io
import logging
import socket
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from typing import Protocol

import viser

from dashboard.data.store import Store
from dashboard.desk import Desk
from dashboard.scene.shared import Shared
from dashboard.scene.style import LEFT_WIDTH, css
from dashboard.scene.view import OWN_INPUTS, View
from dashboard.scene.waking import Waking
from messages.bus.turning import Loop

log = logging.getLogger(__name__)

__all__ = ["OWN_INPUTS", "SceneError", "SceneHandle", "start"]

POSE_S = 1 / 20  # period of poses ...
POSES_PER_S = 200  # ... of as many browsers as can have it; more of them share these ...
SELDOMEST_S = 1 / 10  # ... but none waits longer for a pose, however many there are
PANEL_S = 0.4  # period of charts and tables
TURN_S = 0.5
WAKE_S = 1.0  # while nobody looks, that much is said so often
# Charts of many browsers are drawn by so many at a time, spread over so much of their period, lest
# the poses of all wait behind the charts of all.
TOGETHER = 5
SPREAD = 0.6

Seen = tuple[int, View]  # number of a browser, what it shows


class SceneSettings(Protocol):
    """What start() reads of the dashboard's settings."""

    viser_port: int  # 0 takes a free one


class SceneError(RuntimeError):
    """The scene cannot be served."""


class _Server(viser.ViserServer):
    """Anybody could ask viser for a public tunnel to this server: that door does not exist here."""

    def request_share_url(self, verbose: bool = True) -> None:
        """Refused."""

    def disconnect_share_url(self) -> None:
        """There is nothing to end."""


class SceneHandle:
    """The running scene. `port` is where viser listens; the front door sends signed-in people
    there.
    """

    def __init__(
        self, server: viser.ViserServer, store: Store, desk: Desk, watched: threading.Event
    ) -> None:
        self.port = server.get_port()
        self._server, self._store, self._desk = server, store, desk
        self._views: dict[int, View] = {}
        self._shared, self._waking = Shared(), Waking()
        self._lock = threading.Lock()
        self._stop = threading.Event()
        self._watched = watched
        server.on_client_connect(self._connected)
        server.on_client_disconnect(self._disconnected)
        self._threads = [
            threading.Thread(
                target=self._loop,
                args=(POSE_S, View.tick_scene),
                name="dashboard-poses",
                daemon=True,
            ),
            threading.Thread(
                target=self._loop,
                args=(PANEL_S, View.tick_panels, self._shared.begin),
                name="dashboard-panels",
                daemon=True,
            ),
        ]
        for thread in self._threads:
            thread.start()
        self._turning = asyncio.run_coroutine_threadsafe(self._turn(), server.get_event_loop())

    @property
    def clients(self) -> int:
        """Browsers that look."""
        with self._lock:
            return len(self._views)

    def stop(self) -> None:
        """End loops and server."""
        self._stop.set()
        self._turning.cancel()
        self._watched.set()  # wakes the loops
        for thread in self._threads:
            thread.join(timeout=5.0)
        self._server.stop()

    async def _turn(self) -> None:
        """In viser's own loop: it goes on."""
        with Loop("scene") as loop:
            while True:
                loop.turn()
                await asyncio.sleep(TURN_S)

    def _connected(self, client: viser.ClientHandle) -> None:
        self._waking.take(client)
        view = View(client, self._store, self._desk, self._shared)
        with self._lock:
            self._views[client.client_id] = view
            self._watched.set()
        log.info("browser %d looks at the scene", client.client_id)

    def _disconnected(self, client: viser.ClientHandle) -> None:
        with self._lock:
            self._views.pop(client.client_id, None)
            if not self._views:
                self._watched.clear()
        log.info("browser %d is gone", client.client_id)

    def _loop(
        self, period_s: float, tick: Callable[[View], None], begin: Callable[[], None] = int
    ) -> None:
        """Call begin once and tick for each view; nothing at all is done while nobody looks."""
        complained: set[int] = set()
        panels = tick is View.tick_panels
        with Loop("panels" if panels else "poses") as loop:
            while not self._stop.is_set():
                loop.turn()
                if not self._watched.wait(WAKE_S):
                    continue
                began = time.monotonic()
                with self._lock:
                    views = list(self._views.items())
                views = [(number, view) for number, view in views if view.pace.due(panels)]
                begin()
                for group, until_s in spread(views, SPREAD * period_s if panels else 0.0):
                    with self._waking.once():
                        for number, view in group:
                            loop.turn()
                            self._tick(tick, number, view, complained)
                    self._stop.wait(max(0.0, began + until_s - time.monotonic()))
                each_s = period_s if panels else min(len(views) / POSES_PER_S, SELDOMEST_S)
                wanted_s = max(period_s, each_s) - (time.monotonic() - began)
                self._stop.wait(max(wanted_s, period_s / 4))

    @staticmethod
    def _tick(tick: Callable[[View], None], number: int, view: View, complained: set[int]) -> None:
        """One browser's trouble must not stop the others' picture."""
        try:
            tick(view)
        except Exception:
            if number not in complained:
                log.exception("browser %d: update failed", number)
            complained.add(number)


def spread(views: list[Seen], over_s: float) -> Iterator[tuple[list[Seen], float]]:
    """Groups of a round, each with the s since its beginning that the next one waits for; without a
    time to spread over all are one group.
    """
    size = TOGETHER if over_s else max(1, len(views))
    for first in range(0, len(views), size):
        yield views[first : first + size], over_s * min(1.0, (first + size) / len(views))


def start(
    settings: SceneSettings,
    store: Store,
    desk: Desk,
    watched: threading.Event | None = None,
    host: str = "127.0.0.1",
) -> SceneHandle:
    """Serve the scene at settings.viser_port of `host`; `watched` is set while a browser looks.

    Raises SceneError when the port is taken.
    """
    # A browser may go while it is brought up to date; its view is dropped a moment later.
    warnings.filterwarnings(
        "ignore", message="Queued a .* on a closed connection", category=UserWarning
    )
    with contextlib.redirect_stdout(
        io.StringIO()
    ):  # viser prints a banner that would stand among our data
        server = _Server(
            host=host, port=settings.viser_port or _free_port(host), label="gyrofree", verbose=False
        )
    if settings.viser_port and server.get_port() != settings.viser_port:
        # viser takes the next free port without a word; the proxy would then talk to a stranger.
        server.stop()
        raise SceneError(
            f"[dashboard] viser_port {settings.viser_port}: already in use; stop the other program"
            " or set it to 0"
        )
    _dress(server)
    return SceneHandle(server, store, desk, watched or threading.Event())


def _dress(server: viser.ViserServer) -> None:
    """What a browser sees before its own view is there: our colours and a line of text, not viser's
    own controls.
    """
    server.gui.configure_theme(dark_mode=True, show_logo=False, show_share_button=False)
    server.gui.add_html(css(), order=-1.0)
    server.gui.main_panel.dock_left()
    server.gui.main_panel.set_width(LEFT_WIDTH)


def _free_port(host: str) -> int:
    with socket.socket() as probe:
        probe.bind((host, 0))
        return probe.getsockname()[1]
