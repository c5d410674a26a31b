"""`gyrofree up`: everything that a real board needs, as one command."""

import os
from pathlib import Path
from typing import Annotated

import typer

from gyrofree.commands.options import Config, say, settings_of
from gyrofree.config import DEFAULT_PATH, ConfigError
from gyrofree.operations.log_form import FORMAT
from gyrofree.running.process import EXIT_CONFIG, fail
from gyrofree.running.watch import SERVICES


def up(
    only: Annotated[
        list[str] | None,
        typer.Option(help=f"Only this service, of {', '.join(SERVICES)}; may stand often."),
    ] = None,
    without: Annotated[
        list[str] | None, typer.Option(help="Not this service; may stand often.")
    ] = None,
    systemd: Annotated[
        bool,
        typer.Option("--systemd", help="Start nothing: print a systemd unit that runs the same."),
    ] = False,
    log_format: Annotated[
        str, typer.Option(help="text, or json: one object a line; default [log] format.")
    ] = "",
    config: Config = None,
) -> None:
    """Start the services of gyrofree.toml, keep them alive, and print the page's address.

    `gyrofree setup` writes the configuration. Ctrl-C ends everything in order.
    """
    if log_format not in ("", "text", "json"):
        raise typer.BadParameter(f"{log_format!r}: want text or json", param_hint="--log-format")
    if log_format:
        os.environ[FORMAT] = log_format
    settings = settings_of(config)
    from gyrofree.running import up as running
    from gyrofree.setup.site import services

    try:
        there = services(settings)
    except ConfigError as error:
        raise fail(error, EXIT_CONFIG) from None
    chosen = _chosen(there, only or [], without or [])
    source = config or (DEFAULT_PATH if DEFAULT_PATH.exists() else None)
    if systemd:
        from gyrofree.running.systemd import unit

        arguments = [f"--only={name}" for name in only or []]
        arguments += [f"--without={name}" for name in without or []]
        arguments += [f"--log-format={log_format}"] if log_format else []
        return say(unit(source, arguments, Path.cwd()), end="")
    running.run(running.Plan(settings, source, chosen))


def _chosen(services: tuple[str, ...], only: list[str], without: list[str]) -> tuple[str, ...]:
    """The services to start, in their order; ends the command where there is none of a name."""
    for name in (*only, *without):
        if name not in services:
            raise fail(f"no service {name!r}: want one of {', '.join(services)}", EXIT_CONFIG)
    chosen = tuple(s for s in services if (not only or s in only) and s not in without)
    if not chosen:
        raise fail("--only and --without leave no service to start", EXIT_CONFIG)
    return chosen
