"""Options that several commands share."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TextIO

import typer
from rich.console import Console
from rich.table import Table
from rich.text import Text

from gyrofree.config import DEFAULT_PATH, ConfigError, Settings, load_or_default
from gyrofree.operations.backup.parts import BackupError
from gyrofree.operations.backup.swap import settle
from gyrofree.running.process import EXIT_CONFIG, fail
from messages.text import printed

if TYPE_CHECKING:
    from sessions.library.catalogue import Catalogue

Config = Annotated[
    Path | None,
    typer.Option(
        "--config", "-c", help="Configuration file; default ./gyrofree.toml if it is there."
    ),
]
Verbose = Annotated[bool, typer.Option("--verbose", "-v", help="Log details too.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON on standard output.")]
SessionId = Annotated[
    str, typer.Argument(help="Id of a session; `gyrofree sessions list` shows them.")
]
SessionOrFile = Annotated[str, typer.Argument(help="Id of a session, or path of an MCAP file.")]
LARGEST_SEED = 2**32 - 1
Speed = Annotated[float, typer.Option(min=0.1, max=100.0, help="Seconds of the log per second.")]


UnitsAsNamed = Annotated[
    bool,
    typer.Option(
        "--units-as-named", help="Take numbers that look like another unit for what they are named."
    ),
]


def settings_of(path: Path | None) -> Settings:
    """The configuration a command was given; ends the command with one line per fault. What a
    restore that was killed had moved is brought back first.
    """
    try:
        if said := settle((path or DEFAULT_PATH).absolute().parent):
            say(said, file=sys.stderr)
        return load_or_default(path)
    except (ConfigError, BackupError) as error:
        raise fail(error, EXIT_CONFIG) from None


def catalogue_of(settings: Settings) -> "Catalogue":
    """The sessions of this configuration."""
    from sessions.library.catalogue import Catalogue

    return Catalogue(Path(settings.recorder.root))


def nothing_in(root: Path, search: str = "") -> str:
    """What is said instead of an empty table of sessions."""
    kept = "" if search else "; make demo keeps its own: --config var/demo/gyrofree.toml"
    return f"no session in {root}{f' has {search!r}' if search else ''}{kept}"


def file_of(settings: Settings, session: str) -> Path:
    """MCAP file of an id or path; ends the command where there is none."""
    from gyrofree.running import replay

    try:
        return replay.find(settings, session)
    except LookupError as error:
        raise fail(error) from None


def session_name(name: str) -> str:
    """A name that a person gives a session; one that cannot be ends the command."""
    from sessions.recording.manifest import name_fault  # here: help should not wait for it

    if fault := name_fault(name):
        raise typer.BadParameter(fault)
    return name


def say(*parts: object, sep: str = " ", end: str = "\n", file: TextIO | None = None) -> None:
    """print(), for texts that may come from outside: see messages.text."""
    print(*map(printed, parts), sep=sep, end=end, file=file)


class Terminal(Console):
    """Shows texts as they stand: what is in a cell neither moves the cursor nor is markup."""

    def render_str(self, text: str, **options: Any) -> Text:
        return super().render_str(printed(text), **options | {"markup": False, "emoji": False})


def console_of(width: int = 160) -> Console:
    """Standard output; `width` characters where that is a file or a pipe, which has no width of its
    own.
    """
    return Terminal(file=sys.stdout, width=None if sys.stdout.isatty() else width)


def show_table(table: Table, width: int = 160) -> None:
    """On standard output."""
    console_of(width).print(table)


Fault = Annotated[
    list[str] | None,
    typer.Option(
        help="Spoil an axis of the simulated cube, as a21:stuck@12 or a13:swapped=a21@12-20."
    ),
]


def faults_of(texts: list[str] | None) -> tuple:
    """Faults of the simulated cube's axes; one that cannot be ends the command."""
    if not texts:
        return ()
    from inertial.layouts.catalogue import CUBE
    from inertial.simulation.faults import FaultError, parse

    try:
        return tuple(parse(text, CUBE(0.05).axis_names) for text in texts)
    except FaultError as error:
        raise fail(error, EXIT_CONFIG) from None
