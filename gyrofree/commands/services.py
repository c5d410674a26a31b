"""One service each: `gyrofree router`, `gateway`, `estimator`, `record`, `procedures` and
`dashboard`.
"""

import logging
import threading
from collections.abc import Callable
from typing import Annotated, Any

import typer

from gyrofree.commands.options import (
    Config,
    Verbose,
    settings_of,
)
from gyrofree.config import ConfigError
from gyrofree.operations.attending import attended
from gyrofree.running.process import command, run_service

ROUTER_LOOK_S = 0.5

log = logging.getLogger(__name__)


def router(config: Config = None, verbose: Verbose = False) -> None:
    """Route the bus: the Zenoh session that all others connect to."""
    settings = settings_of(config)

    def body(stop: threading.Event) -> None:
        from gyrofree.running.supervisor import die_with_parent
        from gyrofree.setup.site import router_rules
        from messages.bus import timeouts
        from messages.bus.beating import Beating, tell_time
        from messages.bus.session import connected, open_router
        from messages.bus.settings import room_for_connections
        from messages.bus.turning import Loop
        from messages.bus.zenohd import Zenohd

        room_for_connections()
        rules, mesh = router_rules(settings)
        bus = settings.bus.acting_as("router")

        def serve(session: Any, wait: Callable[[Callable[[], object]], object]) -> None:
            # at a site its home tells the time; who is none asks the router
            telling = tell_time(session, bus.prefix) if bus.tls is None else None
            with Beating(session, bus):
                log.info("router listens on %s", ", ".join(settings.bus.listen))
                if mesh:
                    log.info("and calls %s", ", ".join(mesh))
                with Loop("router") as loop:

                    def look() -> None:
                        connected(session)  # answered by what routes, or not at all
                        loop.turn()

                    wait(look)
            if telling is not None:
                telling.undeclare()

        if bus.zenohd is None:
            if bus.tls is not None:
                timeouts.watch(stop)
            with open_router(bus, rules, mesh) as session:
                serve(session, lambda look: _wait(stop, look))
            return
        with Zenohd(bus, rules, mesh, stop, die_with_parent) as program:
            log.info("%s routes", bus.zenohd)
            if bus.tls is not None:
                timeouts.watch(stop, program.pid)
            serve(program.session, program.wait)

    run_service(body, verbose, attended(settings, "router"))


def _wait(stop: threading.Event, look: Callable[[], object]) -> None:
    while not stop.wait(ROUTER_LOOK_S):
        look()


def gateway(config: Config = None, verbose: Verbose = False) -> None:
    """Read the boards of [[gateway.devices]], journal every byte, publish samples."""
    settings = settings_of(config)

    from gateway import service
    from gateway.ports.keeper import Keeper
    from gyrofree.running.guardian import guard, leave_when_alone

    def body(stop: threading.Event, keeper: Keeper) -> None:
        leave_when_alone(stop)
        service.run(settings.gateway, settings.bus.acting_as("gateway"), stop, keeper)

    who = attended(settings, "gateway")
    guard(lambda keeper: run_service(lambda stop: body(stop, keeper), verbose, who))


def estimator(config: Config = None, verbose: Verbose = False) -> None:
    """Turn the samples on the bus into rate, attitude and navigation, several estimators side by
    side.
    """
    settings = settings_of(config)

    def body(stop: threading.Event) -> None:
        from estimator import service
        from estimator.choice import UnknownEstimator

        try:
            service.run(settings.estimator, settings.bus.acting_as("estimator"), stop)
        except UnknownEstimator as error:
            raise ConfigError(str(error)) from None

    run_service(body, verbose, attended(settings, "estimator"))


def record(config: Config = None, verbose: Verbose = False) -> None:
    """Write everything on the bus to MCAP files, when told to from the dashboard or from the
    start.
    """
    settings = settings_of(config)

    def body(stop: threading.Event) -> None:
        from sessions.recording import service

        # who is told of alarms, and where, is nobody's business who gets a recording
        kept = settings.model_dump(mode="json", exclude={"alarms": {"webhook", "mail"}})
        service.run(settings.recorder, settings.bus.acting_as("recorder"), stop, kept)

    run_service(body, verbose, attended(settings, "recorder"))


def procedures(config: Config = None, verbose: Verbose = False) -> None:
    """Run tests as procedures, one at a time for each device: see `gyrofree procedure`."""
    settings = settings_of(config)

    def body(stop: threading.Event) -> None:
        from sessions.procedure import service
        from sessions.procedure.driven.description import TableError

        try:
            service.run(settings.procedures, settings.bus.acting_as("procedures"), stop)
        except TableError as error:
            raise ConfigError(str(error)) from None

    run_service(body, verbose, attended(settings, "procedures"))


def dashboard(
    setup: Annotated[
        bool, typer.Option("--setup", help="Ask for the first board, while there is none.")
    ] = False,
    config: Config = None,
    verbose: Verbose = False,
) -> None:
    """Serve the web page with scene, charts, recordings and sign-in."""
    settings = settings_of(config)

    def body(stop: threading.Event) -> None:
        from dashboard import service
        from dashboard.web.control import ProcessReplay
        from dashboard.web.first.control import FirstRun
        from dashboard.web.jobs import Jobs
        from dashboard.web.tls.certificate import CertificateError
        from dashboard.web.users import UsersError
        from gyrofree.setup.site import is_afar, only_watching, place_of

        options = ["--config", str(config)] if config else []
        replayer = command("replay", "--stay", *options)
        jobs = Jobs(command(), options)
        first = FirstRun(command("setup", *options)) if setup else None
        replay = ProcessReplay(replayer)
        bus = settings.bus.acting_as("dashboard")
        watching = only_watching(settings)
        try:
            service.run(
                settings.dashboard,
                bus,
                stop,
                replay,
                jobs,
                first,
                watching,
                place_of(settings),
                is_afar(settings),
                settings.alarms if is_afar(settings) else None,
            )
        except (CertificateError, UsersError) as error:
            raise ConfigError(str(error)) from None

    run_service(body, verbose, attended(settings, "dashboard"))
