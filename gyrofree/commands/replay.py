"""`gyrofree replay`: the command line of playing a recording."""

from typing import Annotated

import typer

from gyrofree.commands.options import AsJson, Config, Speed, Verbose, settings_of
from gyrofree.running.process import EXIT_CONFIG as CONFIG
from gyrofree.running.process import fail, run_service


def replay(
    session: Annotated[
        str, typer.Argument(help="Id of a recording (`--list` shows them) or path of an MCAP file.")
    ] = "",
    speed: Speed = 1.0,
    check: Annotated[
        bool, typer.Option(help="Do not publish: run the estimators on it and compare bit for bit.")
    ] = False,
    at: Annotated[
        float, typer.Option(min=0.0, help="Begin at this second of the recording.")
    ] = 0.0,
    paused: Annotated[
        bool, typer.Option(help="Begin with a pause; the dashboard's timeline goes on.")
    ] = False,
    stay: Annotated[
        bool, typer.Option(help="Wait at the end for orders of the dashboard's timeline.")
    ] = False,
    rate: Annotated[
        list[str] | None,
        typer.Option(help="A rate estimator instead of the configured ones; may be repeated."),
    ] = None,
    overlay: Annotated[
        bool, typer.Option(help="Show the recorded estimates beside the new ones.")
    ] = False,
    listing: Annotated[bool, typer.Option("--list", help="List the recordings.")] = False,
    as_json: AsJson = False,
    config: Config = None,
    verbose: Verbose = False,
) -> None:
    """Send a recording through the bus again, or prove that it reproduces its estimates."""
    settings = settings_of(config)
    from gyrofree.running import replay as player

    if listing or not session:
        return player.show_list(settings, as_json)
    try:
        path = player.find(settings, session)
    except LookupError as error:
        raise fail(str(error)) from None
    if check:
        raise typer.Exit(player.check(settings, path, as_json))
    from estimator.choice import UnknownEstimator

    options = player.Options(speed, at, paused, stay, tuple(rate or ()), overlay)
    try:
        run_service(lambda stop: player.run(settings, path, options, stop), verbose)
    except UnknownEstimator as error:
        raise fail(str(error), CONFIG) from None
    except ValueError as error:
        raise fail(str(error)) from None
