"""The command line. Every command takes its parameters here and does its work in another module."""

import importlib.metadata
from typing import Annotated

import typer

from gyrofree.commands import calibrate, handover, layout, procedure, sessions, users
from gyrofree.commands import run as logs
from gyrofree.commands.board import board
from gyrofree.commands.demo import demo, play
from gyrofree.commands.installation import alarms, certs, config, site
from gyrofree.commands.installation.backup import backup, restore
from gyrofree.commands.installation.completion import answer_the_shell, completion
from gyrofree.commands.installation.doctor import doctor
from gyrofree.commands.installation.log_level import log_level
from gyrofree.commands.installation.orders import orders
from gyrofree.commands.installation.setup import setup
from gyrofree.commands.installation.up import up
from gyrofree.commands.installation.zenohd import zenohd_config
from gyrofree.commands.options import say
from gyrofree.commands.parser import Commands, run_main
from gyrofree.commands.replay import replay
from gyrofree.commands.services import (
    dashboard,
    estimator,
    gateway,
    procedures,
    record,
    router,
)
from gyrofree.commands.simulate import simulate

app = Commands(
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    help=(
        "Bench and remote eye for inertial units without gyroscopes.\n\n"
        "`gyrofree demo` shows everything on one page; the other commands are its parts."
    ),
)

app.add_typer(users.app, name="users")
app.add_typer(alarms.app, name="alarms")
app.add_typer(config.app, name="config")
site.app.command("zenohd-config")(zenohd_config)
app.add_typer(site.app, name="site")
app.add_typer(certs.app, name="certs")
app.add_typer(layout.app, name="layout")
app.add_typer(sessions.app, name="sessions")
app.add_typer(procedure.app, name="procedure")
handover.mount(app)
app.add_typer(calibrate.app, name="calibrate")
app.add_typer(logs.app, name="reproduce")
for command in (
    logs.run,
    board,
    demo,
    setup,
    up,
    router,
    gateway,
    estimator,
    record,
    procedures,
    dashboard,
    simulate,
    play,
    replay,
    doctor,
    log_level,
    backup,
    restore,
    orders,
    completion,
):
    app.command()(command)


def _show_version(wanted: bool) -> None:
    if wanted:
        say(f"gyrofree {importlib.metadata.version('gyrofree')}")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool,
        typer.Option("--version", help="Print the version.", callback=_show_version, is_eager=True),
    ] = False,
) -> None:
    pass


def main() -> None:
    """Entry point of `gyrofree`."""
    answer_the_shell()
    run_main(app)
