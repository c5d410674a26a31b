"""`gyrofree log-level`: a running service logs more, or less, for a while."""

import getpass
import json
from dataclasses import asdict
from typing import Annotated

import typer

from gyrofree.commands.options import AsJson, Config, say, settings_of
from gyrofree.operations.settings import SERVICES
from gyrofree.running.process import EXIT_CONFIG, EXIT_FAILED, fail

OTHERWISE = {"record": "recorder", "site": "authority"}  # as commands are called
ROUTER_S = 5.0


def log_level(
    service: Annotated[str, typer.Argument(help=f"One of {', '.join(SERVICES)}.")],
    level: Annotated[
        str, typer.Argument(help="debug, info, warning or error; configured: as in [log] level.")
    ],
    minutes: Annotated[
        float,
        typer.Option(
            min=0.0, max=10_080.0, help="Then as configured again; 0: until the service ends."
        ),
    ] = 10.0,
    as_json: AsJson = False,
    config: Config = None,
) -> None:
    """Have a running service log more, or less, for a while.

    By an order over the bus, which takes the rights of an operator. Where there is no bus, SIGUSR1
    has a service of this machine log everything for ten minutes; a second one ends that.
    """
    from gyrofree.operations.log_level import LEVELS, ask
    from messages.bus.faults import BusUnavailable, IdentityError
    from messages.bus.session import open_client
    from messages.contract import gyrofree_pb2 as pb

    service = OTHERWISE.get(service, service)
    if service not in SERVICES:
        raise fail(f"no service {service!r}: want one of {', '.join(SERVICES)}", EXIT_CONFIG)
    if level not in (*LEVELS, "configured"):
        wanted = ", ".join((*LEVELS, "configured"))
        raise fail(f"level {level!r}: want one of {wanted}", EXIT_CONFIG)
    bus = settings_of(config).bus
    order = pb.LogLevelCommand(
        level="" if level == "configured" else level,
        seconds=60.0 * minutes,
        user=getpass.getuser()[:60],
    )
    try:
        with open_client(bus, timeout_s=ROUTER_S) as session:
            answers = ask(session, bus.prefix, service, order)
    except (BusUnavailable, IdentityError) as error:
        raise fail(error) from None
    if as_json:
        say(json.dumps([asdict(answer) for answer in answers]))
    for answer in answers if not as_json else []:
        say(answer.text)
    if not answers:
        raise fail(
            f"the {service} does not answer: it does not run, or may not be ordered from here"
            " (`gyrofree site check`)"
        )
    if not all(answer.ok for answer in answers):
        raise typer.Exit(EXIT_FAILED)
