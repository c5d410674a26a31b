"""`gyrofree config`: what gyrofree.toml may say, what it says, and whether that is right."""

import json
from pathlib import Path
from typing import Annotated

import typer

from dashboard.web.map.archive import ArchiveError, open_archive
from gyrofree.commands.options import AsJson, Config, say, settings_of
from gyrofree.commands.parser import Commands
from gyrofree.config import DEFAULT_PATH
from gyrofree.running.process import EXIT_CONFIG, fail
from gyrofree.setup import reference, written

app = Commands(
    no_args_is_help=True,
    rich_markup_mode=None,
    help="What gyrofree.toml may say, what it says, and whether that is right.",
)


@app.command("check")
def check(as_json: AsJson = False, config: Config = None) -> None:
    """Read the configuration as the services do; every fault is a line, and exit code 2."""
    settings = settings_of(config)
    source = _source(config)
    _check_map(settings.dashboard.map, source)
    boards = {device.name: device.port for device in settings.gateway.devices}
    if as_json:
        return say(json.dumps({"file": source, "boards": boards}, indent=2))
    said = ", ".join(f"{name} on {port}" for name, port in boards.items())
    say(f"{source or 'no file, all defaults'}: right; {said or 'no board yet: gyrofree setup'}")


@app.command("show")
def show(
    everything: Annotated[
        bool, typer.Option("--all", help="Also the keys that have their default.")
    ] = False,
    as_json: AsJson = False,
    config: Config = None,
) -> None:
    """Print the settings in force, defaults filled in, as a gyrofree.toml."""
    settings = settings_of(config)
    if as_json:
        return say(json.dumps(settings.model_dump(mode="json"), indent=2))
    head = f"In force with {_source(config) or 'no file'}."
    say(written.as_toml(settings, head, everything=everything), end="")


@app.command("default")
def default() -> None:
    """Print the gyrofree.toml that is shipped: what people change, at its default."""
    say(written.shipped(), end="")


@app.command("reference")
def print_reference() -> None:
    """Print docs/configuration.md: every key with type, unit, default, range and what it does."""
    say(reference.page(), end="")


def _check_map(path: Path | None, source: str) -> None:
    """The file of map tiles, where one is named, can be used."""
    try:
        if path is not None:
            open_archive(path)
    except ArchiveError as error:
        raise fail(f"{source}: [dashboard] map = {str(path)!r}: {error}", EXIT_CONFIG) from None


def _source(config: Path | None) -> str:
    """The file that is read; empty where there is none."""
    return str(config or (DEFAULT_PATH if DEFAULT_PATH.exists() else ""))
