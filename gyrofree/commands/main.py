"""The command line. A command is imported when it is called: all of them at once take a second."""

import importlib
import importlib.metadata
from collections.abc import Iterator, Mapping
from typing import Annotated, Any

import typer
from typer.completion import completion_init
from typer.core import TyperGroup

from gyrofree.commands.parser import Commands, run_main

PLACES = {  # module of gyrofree.commands, and what is in it: a function or a typer app
    "export": "handover:export",
    "report": "handover:report",
    "import": "handover:import_log",
    "rerun": "handover:rerun",
    "reprocess": "reprocess:reprocess",
    "run": "run:run",
    "board": "board:board",
    "demo": "demo:demo",
    "setup": "installation.setup:setup",
    "up": "installation.up:up",
    "router": "services:router",
    "gateway": "services:gateway",
    "estimator": "services:estimator",
    "record": "services:record",
    "procedures": "services:procedures",
    "dashboard": "services:dashboard",
    "simulate": "simulate:simulate",
    "play": "demo:play",
    "replay": "replay:replay",
    "doctor": "installation.doctor:doctor",
    "log-level": "installation.log_level:log_level",
    "backup": "installation.backup:backup",
    "restore": "installation.backup:restore",
    "orders": "installation.orders:orders",
    "completion": "installation.completion:completion",
    "users": "users:app",
    "alarms": "installation.alarms:app",
    "config": "installation.config:app",
    "site": "installation.site:app",
    "certs": "installation.certs:app",
    "layout": "layout:app",
    "sessions": "sessions:app",
    "procedure": "procedure:app",
    "calibrate": "calibrate:app",
    "reproduce": "run:app",
}

LOOK = {"add_completion": False, "rich_markup_mode": None, "pretty_exceptions_enable": False}


class OnDemand(Mapping[str, Any]):
    """Commands by name, made of what stands at their places."""

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
        found = getattr(importlib.import_module(f"gyrofree.commands.{module}"), attribute)
        alone = Commands(**LOOK)
        alone.callback()(lambda: None)  # or a typer of one command is that command
        if isinstance(found, typer.Typer):
            alone.add_typer(found, name=name)
        else:
            alone.command(name)(found)
        return typer.main.get_group(alone).commands[name]


COMMANDS = OnDemand(PLACES)


class Root(TyperGroup):
    """All commands."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings | {"commands": COMMANDS})


app = Commands(
    cls=Root,
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
