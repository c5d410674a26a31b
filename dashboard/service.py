"""The dashboard process: the scene on the loopback, the web application on the one exposed port."""

import asyncio
import contextlib
import errno
import logging
import socket
import threading
import time
from collections.abc import Callable
from typing import Any

import uvicorn

from dashboard.alarms.own_place import OwnPlace, shown
from dashboard.alarms.settings import AlarmSettings
from dashboard.data.fault import Alarm
from dashboard.data.feed import Feed
from dashboard.data.store import Store
from dashboard.desk import Desk
from dashboard.settings import DashboardSettings
from dashboard.web.accounts.audit import Audit
from dashboard.web.app import create_app
from dashboard.web.auth import Gate
from dashboard.web.connections import Connections
from dashboard.web.control import Replay
from dashboard.web.first.control import FirstRun
from dashboard.web.front import Front
from dashboard.web.jobs import Jobs
from dashboard.web.map.archive import ArchiveError, open_archive
from dashboard.web.tls.certificate import open_certificate
from dashboard.web.users import UserStore, load_users
from messages.bus.beating import Beating
from messages.bus.session import BusSettings, open_client
from messages.bus.turning import Loop
from messages.contract import gyrofree_pb2 as pb
from sessions.library.catalogue import Catalogue

log = logging.getLogger(__name__)

SAY_S = 10.0  # between two words that no file is left
STOP_LOOK_S = 0.1  # s between two looks at the stop event
# Bytes of a connection that wait in the kernel, which would take 4 MB: one that takes nothing is
# noticed by what waits here.
SEND_BYTES = 1 << 19
BACKLOG = 512  # connections that wait to be taken; a flood must not fill it
HEAD_LIMIT = 32_768  # bytes of the head of one request
GRACE_S = 1  # s, for answers under way when the process ends


class PortTaken(OSError):
    """The port is somebody else's; never replaced by another one silently."""

    def __str__(self) -> str:
        return str(self.strerror)


class _Server(uvicorn.Server):
    """uvicorn without its own signal handlers: the process has a stop event for that."""

    @contextlib.contextmanager
    def capture_signals(self) -> Any:
        yield


class NoFiles:
    """Said once in a while where no file is left for another connection: asyncio would log a
    traceback for each place of the backlog, every second.
    """

    def __init__(self) -> None:
        self._said = -SAY_S

    def __call__(self, loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        """What the event loop does with a fault that nobody waits for."""
        error = context.get("exception")
        if isinstance(error, ValueError) and "_start_serving" in context.get("message", ""):
            return  # a second later it would listen again at what has been closed since
        if not isinstance(error, OSError) or error.errno not in (errno.EMFILE, errno.ENFILE):
            loop.default_exception_handler(context)
        elif time.monotonic() - self._said >= SAY_S:
            self._said = time.monotonic()
            log.error(
                "no file is left for another connection (%s): others wait; raise the limit"
                " (LimitNOFILE), or lower [dashboard] connections",
                error.strerror,
            )


def listen(host: str, port: int) -> socket.socket:
    """The bound socket of the dashboard; raises PortTaken, or OSError for an address this machine
    does not have.
    """
    try:
        family, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        bound = socket.socket(family, socket.SOCK_STREAM)
    except OSError as error:
        raise OSError(error.errno, f"[dashboard] host {host!r}: {error.strerror}") from None
    bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    bound.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BYTES)
    try:
        bound.bind(address)
        bound.listen(BACKLOG)
    except OSError as error:
        bound.close()
        if error.errno == errno.EADDRINUSE:
            text = (
                f"[dashboard] port {port} of {host} is taken: end what uses it (`ss -ltnp`), or set"
                " another port"
            )
            raise PortTaken(error.errno, text) from None
        raise OSError(error.errno, f"[dashboard] {host}:{port}: {error.strerror}") from None
    return bound


def serve(front: Front, bound: socket.socket, stop: threading.Event) -> None:
    """Serve the web application on a bound socket until `stop` is set."""
    settings = front.settings
    connections = Connections(settings, front.ended)
    config = uvicorn.Config(
        create_app(front),
        log_config=None,
        log_level="warning",  # our own line says where the dashboard is
        access_log=False,  # it would write the tokens of sign-in links
        ws_max_size=settings.message_limit,
        ws_per_message_deflate=False,  # the scene is compressed already
        ws_max_queue=16,
        proxy_headers=bool(settings.trusted_proxies),
        forwarded_allow_ips=settings.trusted_proxies or None,
        timeout_graceful_shutdown=GRACE_S,
        http=connections.protocol(front.certificate),  # type: ignore[arg-type]
        ws=connections.sockets(),
        h11_max_incomplete_event_size=HEAD_LIMIT,
        timeout_keep_alive=15,
        backlog=BACKLOG,
        server_header=False,
        lifespan="off",
    )
    server = _Server(config)

    async def until_stopped() -> None:
        asyncio.get_running_loop().set_exception_handler(NoFiles())
        serving = asyncio.create_task(server.serve(sockets=[bound]))
        with Loop("web server") as loop:
            while not stop.is_set() and not serving.done():
                loop.turn()
                if front.certificate is not None:
                    front.certificate.look()
                await asyncio.sleep(STOP_LOOK_S)
        server.should_exit = True
        await serving

    asyncio.run(until_stopped())


def _look_at_map(settings: DashboardSettings) -> None:
    try:
        if settings.map is not None:
            open_archive(settings.map)
    except ArchiveError as error:
        log.warning("[dashboard] map: %s; the map is a plain grid", error)


def audited(audit: Audit) -> Callable[[pb.OrderGiven], None]:
    """What writes an order and what came of it into the log of acts."""

    def tell(one: pb.OrderGiven) -> None:
        done = one.outcome == pb.OrderGiven.OUTCOME_DONE
        what = f"order to {one.whom}{f' of {one.device}' if one.device else ''}: {one.what}"
        detail = f"{one.text} (after {one.seconds:.2f} s)"
        (audit.done if done else audit.refused)(what, one.user, "", detail)

    return tell


def _own_place(
    store: Store, settings: DashboardSettings, bus: BusSettings, alarms: AlarmSettings | None
) -> contextlib.AbstractContextManager[None]:
    """Shows what is wrong with this place where nobody else of it says so."""
    if alarms is None:
        return contextlib.nullcontext()
    own = OwnPlace(store.presence, alarms, settings.sessions_root, bus.tls)

    def show(found: list[Alarm]) -> None:
        store.own_faults = found

    return shown(own, show)


def run(
    settings: DashboardSettings,
    bus: BusSettings,
    stop: threading.Event,
    replay: Replay | None = None,
    jobs: Jobs | None = None,
    first_run: FirstRun | None = None,
    watching: str = "",
    place: str = "",
    afar: bool = False,
    alarms: AlarmSettings | None = None,
) -> None:
    """The dashboard until `stop` is set.

    `replay` starts replays for the sessions page (control.ProcessReplay); without it the page has
    no such button. `jobs` makes reports and exports in the background; `first_run` asks an
    administrator for the first board. `watching`: why nobody here may give orders. `place`: of a
    site, this one. `afar`: the boards are at another place, over a link that may be slow.
    `alarms`: what is one, where no service of alarms runs at this place. Raises
    PortTaken when the port or viser's is in use, CertificateError, UsersError for a damaged users
    file, BusUnavailable when it is stopped before a router answers.
    """
    from dashboard.scene import (
        service as scene,
    )  # here: viser takes a second to import, a taken port should not wait

    certificate = open_certificate(settings)
    with listen(settings.host, settings.port) as bound:
        if not load_users(settings.users):
            log.warning(
                "%s has no users: nobody can sign in; add one with `gyrofree users add`",
                settings.users,
            )
        if not settings.secure and settings.host not in ("127.0.0.1", "::1", "localhost"):
            log.warning(
                "serving %s without TLS: passwords cross the network readable; see docs",
                settings.url,
            )
        _look_at_map(settings)
        with open_client(bus, stop) as session:
            store = Store(settings.devices, settings.history_bytes)
            desk, watched = Desk(session, bus.prefix, watching, place), threading.Event()
            try:
                handle = scene.start(settings, store, desk, watched)
            except scene.SceneError as error:
                raise PortTaken(errno.EADDRINUSE, str(error)) from None
            live = settings.live if afar else "full"
            feed = Feed(session, bus.prefix, store, watched, live=live, highest=settings.preview_hz)
            front = Front(
                settings=settings,
                gate=Gate(settings, UserStore(settings.users)),
                catalogue=Catalogue(settings.sessions_root),
                scene_port=lambda: handle.port,
                certificate=certificate,
                store=store,
                desk=desk,
                replay=replay,
                jobs=jobs,
                first_run=first_run,
                open_labels=scene.OWN_INPUTS,
            )
            desk.told = audited(front.gate.audit)
            keeping = threading.Thread(
                target=desk.keep, args=(stop, front.seats.alive), daemon=True
            )
            keeping.start()
            log.info("dashboard at %s", settings.url)
            try:
                with (
                    Beating(session, bus, viewers=front.lookers.by_role),
                    _own_place(store, settings, bus, alarms),
                ):
                    serve(front, bound, stop)
            finally:
                if replay is not None:
                    replay.stop()
                if jobs is not None:
                    jobs.close()
                front.readings.close()
                front.uploads.close()
                handle.stop()
                feed.stop()
