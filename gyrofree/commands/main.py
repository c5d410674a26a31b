"""The command line. A command is imported when it is called: all of them at once take a second."""

import importlib
import importlib.metadata
from collections.abc import Iterator, Mapping
from typing import Annotated, Any

import typer
from typer.completion import completion_init
from typer.core import TyperGroup

from gyrofree.commands.parser import Commands, run_main

HERE = "gyrofree.commands"
PLACES = {
    "export": f"{HERE}.handover:export",
    "report": f"{HERE}.handover:report",
    "import": f"{HERE}.handover:import_log",
    "rerun": f"{HERE}.handover:rerun",
    "reprocess": f"{HERE}.reprocess:reprocess",
    "run": f"{HERE}.run:run",
    "board": f"{HERE}.board:board",
    "demo": f"{HERE}.demo:demo",
    "setup": f"{HERE}.installation.setup:setup",
    "up": f"{HERE}.installation.up:up",
    "router": f"{HERE}.services:router",
    "gateway": f"{HERE}.services:gateway",
    "estimator": f"{HERE}.services:estimator",
    "record": f"{HERE}.services:record",
    "procedures": f"{HERE}.services:procedures",
    "dashboard": f"{HERE}.services:dashboard",
    "simulate": f"{HERE}.simulate:simulate",
    "play": f"{HERE}.demo:play",
    "replay": f"{HERE}.replay:replay",
    "doctor": f"{HERE}.installation.doctor:doctor",
    "log-level": f"{HERE}.installation.log_level:log_level",
    "backup": f"{HERE}.installation.backup:backup",
    "restore": f"{HERE}.installation.backup:restore",
    "orders": f"{HERE}.installation.orders:orders",
    "completion": f"{HERE}.installation.completion:completion",
    "users": f"{HERE}.users:app",
    "alarms": f"{HERE}.installation.alarms:app",
    "config": f"{HERE}.installation.config:app",
    "site": f"{HERE}.installation.site:app",
    "certs": f"{HERE}.installation.certs:app",
    "layout": f"{HERE}.layout:app",
    "sessions": f"{HERE}.sessions:app",
    "procedure": f"{HERE}.procedure:app",
    "calibrate": f"{HERE}.calibrate:app",
    "reproduce": f"{HERE}.run:app",
}

LOOK = {"add_completion": False, "rich_markup_mode": None, "pretty_exceptions_enable": False}


class OnDemand(Mapping[str, Any]):
    """Commands by name; the places are `module:attribute` of a function or of a typer app."""

    def __init__(self, places: dict[str, str]) -> None:
        self._places, self._made = places, dict[str, Any]()

    def __getitem__(self, name: str) -> Any:
        if name not in self._made:
            self._made[name] = self._make(name, self._places[name])
        return self._made[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._places)

    def __len__(self) -> int:
        return len(self._places)

    @staticmethod
    def _make(name: str, place: str) -> Any:
        module, _, attribute = place.partition(":")
        found = getattr(importlib.import_module(module), attribute)
        alone = Commands(**LOOK)
        alone.callback()(lambda: None)  # or a typer of one command is that command
        if isinstance(found, typer.Typer):
            alone.add_typer(found, name=name)
        else:
            alone.command(name)(found)
        return typer.main.get_group(alone).commands[name]


def group_of(places: dict[str, str]) -> type[TyperGroup]:
    """The class of a group with these commands."""
    commands = OnDemand(places)

    class Group(TyperGroup):
        """Its commands are at their places."""

        def __init__(self, **settings: Any) -> None:
            super().__init__(**settings | {"commands": commands})

    return Group


app = Commands(
    cls=group_of(PLACES),
    no_args_is_help=True,
    help=(
        "Bench and remote eye for inertial units without gyroscopes.\n\n"
        "`gyrofree demo` shows everything on one page; the other commands are its parts."
    ),
    **LOOK,
)


def _show_version(wanted: bool) -> None:
    if wanted:
        from gyrofree.commands.options import say

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
    completion_init()  # how each shell asks
    run_main(app)
