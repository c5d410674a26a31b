"""`gyrofree setup`: finds the board, asks what it cannot hear, writes gyrofree.toml."""

import json
from pathlib import Path
from typing import Annotated

import typer

from gyrofree.commands.options import say
from gyrofree.config import DEFAULT_PATH


def setup(
    config: Annotated[
        Path, typer.Option("--config", "-c", help="File to be written.")
    ] = DEFAULT_PATH,
    port: Annotated[
        str, typer.Option(help="Port of the board: a path, tcp://, rfc2217:// or file:///.")
    ] = "",
    baud: Annotated[
        int | None, typer.Option(min=1200, max=4_000_000, help="Baud; else the usual ones.")
    ] = None,
    name: Annotated[str, typer.Option(help="Name of the board, as it is called on the bus.")] = "",
    layout: Annotated[
        str, typer.Option(help="Layout of its accelerometers: a name, or a TOML file.")
    ] = "",
    half_side: Annotated[
        float | None, typer.Option(min=0.001, max=10.0, help="From centre to face, m.")
    ] = None,
    pulses: Annotated[
        int | None,
        typer.Option(min=1, max=1_000_000, help="Tachometer pulses in one turn of the table."),
    ] = None,
    gnss_port: Annotated[
        str | None, typer.Option(help="Port of a receiver of its own; '' for none.")
    ] = None,
    gnss_baud: Annotated[
        int | None, typer.Option(min=1200, max=4_000_000, help="Baud of that receiver.")
    ] = None,
    user: Annotated[
        str | None, typer.Option(help="First user, an administrator; '' for none.")
    ] = None,
    password_file: Annotated[
        str, typer.Option(help="File whose first line is the password; - is standard input.")
    ] = "",
    dashboard_port: Annotated[
        int | None, typer.Option(min=1, max=65535, help="Port of the page; as it was.")
    ] = None,
    bus_port: Annotated[
        int | None, typer.Option(min=1, max=65535, help="Port of the router; as it was.")
    ] = None,
    ports_in: Annotated[Path, typer.Option(help="Folder of the serial ports' names.")] = Path(
        "/dev/serial/by-id"
    ),
    seconds: Annotated[
        float, typer.Option(min=0.5, max=60.0, help="To listen at a port, s.")
    ] = 3.0,
    listen: Annotated[
        bool, typer.Option("--listen/--no-listen", help="Listen at the ports before asking.")
    ] = True,
    look: Annotated[
        bool, typer.Option("--look", help="Only say what speaks on which port.")
    ] = False,
    yes: Annotated[
        bool, typer.Option("--yes", "-y", help="Ask nothing: what is not given is as proposed.")
    ] = False,
    force: Annotated[
        bool,
        typer.Option(
            "--force",
            help="Change a file that holds settings already; a copy of it is kept beside it.",
        ),
    ] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print JSON on standard output; asks nothing.")
    ] = False,
) -> None:
    """Find the board, ask what cannot be heard, and write gyrofree.toml.

    Listens at every serial port, at the usual bauds, and says what speaks there. Every question is
    also an option, so that it runs without a person; without a terminal it asks nothing.
    """
    from gyrofree.setup import dialogue

    wishes = dialogue.Wishes(
        port=port,
        baud=baud,
        name=name,
        layout=layout,
        half_side_m=half_side,
        pulses_per_rev=pulses,
        gnss_port=gnss_port,
        gnss_baud=gnss_baud,
        user=user,
        password_file=password_file,
        dashboard_port=dashboard_port,
        bus_port=bus_port,
    )
    manner = dialogue.Manner(config, ports_in, seconds, listen, look, force, yes, as_json)
    result = dialogue.hold(wishes, manner)
    if as_json:
        say(json.dumps(result, indent=2))
