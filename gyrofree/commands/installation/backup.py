"""`gyrofree backup` and `gyrofree restore`."""

import json
import sys
import time
from pathlib import Path
from typing import Annotated

import typer

from gyrofree.commands.options import AsJson, Config, say, settings_of
from gyrofree.commands.parser import output_file
from gyrofree.config import DEFAULT_PATH, ConfigError
from gyrofree.operations.backup.parts import NAMES, BackupError, named_files, parts_of
from gyrofree.running.process import EXIT_CONFIG, fail

EVERY_S = 2.0  # s between two lines of progress
Only = Annotated[
    list[str] | None,
    typer.Option(help=f"Only this part, of {', '.join(NAMES)}; may stand often."),
]


def backup(
    out: Annotated[
        Path, typer.Argument(help="Archive to write.", callback=output_file(makes=False))
    ],
    only: Only = None,
    as_json: AsJson = False,
    config: Config = None,
) -> None:
    """Keep sessions, users, site, settings, alarms and calibrations in one file.

    Services may run: what is being recorded is taken up to its last whole record. The file can let
    people in as the installation does: its rights are 0600. `unzip -l` lists it.
    """
    from gyrofree.operations.backup.archive import write
    from gyrofree.operations.backup.collecting import collect

    chosen, settings = _chosen(only), settings_of(config)
    parts = parts_of(settings, config or DEFAULT_PATH)
    named = named_files(settings)
    try:
        found = collect(
            [part for part in parts if not chosen or part.name in chosen],
            named if not chosen or "files" in chosen else {},
            _Progress("reading"),
        )
        contents = write(out, found, _Progress("writing"))
    except BackupError as error:
        raise fail(error) from None
    if as_json:
        return say(contents.model_dump_json(indent=1))
    size = sum(entry.size for entry in contents.entries)
    for entry in contents.entries:
        if entry.note:
            say(f"{entry.name}: {entry.note}")
    for name, why in contents.left_out.items():
        say(f"{name}: left out: {why}")
    say(f"{out}: {len(contents.entries)} files, {size / 1e6:.1f} MB, each with its sha256")


def restore(
    archive: Annotated[Path, typer.Argument(help="Made by `gyrofree backup`.")],
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace what is there with other content.")
    ] = False,
    contents: Annotated[
        bool, typer.Option("--list", help="Check every file against its sha256; restore nothing.")
    ] = False,
    only: Only = None,
    as_json: AsJson = False,
    config: Config = None,
) -> None:
    """Bring back what a backup holds: all of it, or nothing where anything is wrong.

    To where gyrofree.toml here says that things are; without one, by that of the backup. Stop the
    services first.
    """
    from gyrofree.operations.backup import restoring
    from gyrofree.operations.backup.archive import opened

    chosen, place = _chosen(only), config or DEFAULT_PATH
    try:
        with opened(archive) as found:
            if contents:
                found.verify(found.contents.entries, _Progress("checking"))
                return _list(found.contents, as_json)
            _settled(place)
            settings = restoring.settings_for(found, place)
            _nobody_runs(settings)
            units = restoring.units_of(found, settings, place, chosen)
            progress = _Progress("restoring")
            done = restoring.restore(found, units, place, overwrite, progress)
    except BackupError as error:
        raise fail(error) from None
    except ConfigError as error:
        raise fail(error, EXIT_CONFIG) from None
    if as_json:
        rows = [{"part": unit.part, "path": str(unit.target)} for unit in done]
        return say(json.dumps({"restored": rows, "unchanged": len(units) - len(done)}))
    say(f"{len(done)} restored, {len(units) - len(done)} were there already; `gyrofree doctor`")


def _list(contents, as_json: bool) -> None:  # noqa: ANN001
    if as_json:
        return say(contents.model_dump_json(indent=1))
    for entry in contents.entries:
        note = f"  ({entry.note})" if entry.note else ""
        say(f"{entry.sha256}  {entry.size:>12}  {entry.name}{note}")
    for name, why in contents.left_out.items():
        say(f"left out: {name}: {why}")
    say(f"made {contents.made} by gyrofree {contents.version}; every file is as its sha256 says")


def _settled(place: Path) -> None:
    from gyrofree.operations.backup.swap import settle

    if said := settle(place.absolute().parent):
        say(said, file=sys.stderr)


def _nobody_runs(settings) -> None:  # noqa: ANN001
    """Services that run would write into what is replaced."""
    from gyrofree.running.doctor import port_taken

    host, _, port = settings.bus.listen[0].partition("/")[2].rpartition(":")
    web = settings.dashboard
    for name, at, number in (("bus", host.strip("[]"), int(port)), ("page", web.host, web.port)):
        if port_taken(at, number):
            raise fail(
                f"the {name} answers at {at}:{number}: stop the services first, such as by"
                " `systemctl stop gyrofree`"
            )


def _chosen(only: list[str] | None) -> set[str]:
    for name in only or []:
        if name not in NAMES:
            raise fail(f"no part {name!r}: want one of {', '.join(NAMES)}", EXIT_CONFIG)
    return set(only or [])


class _Progress:
    """A line on standard error every two seconds, where it takes long."""

    def __init__(self, what: str) -> None:
        self._what, self._bytes, self._said = what, 0, time.monotonic()

    def __call__(self, count: int) -> None:
        self._bytes += count
        if time.monotonic() - self._said > EVERY_S:
            self._said = time.monotonic()
            say(f"{self._what}: {self._bytes / 1e6:.0f} MB", file=sys.stderr)
