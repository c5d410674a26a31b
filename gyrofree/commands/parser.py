"""What every command has in common: outputs are looked at before the work begins, and what the
system refuses in the middle of it is one line and an exit code.
"""

import errno
import io
import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import typer
from typer.core import TyperCommand

from gyrofree.running.process import EXIT_CONFIG, EXIT_FAILED, ending, fail
from messages.text import reason

ROOMS = frozenset(  # an error of theirs is a sentence for people
    "dashboard estimator firmware_protocol gateway gyrofree inertial logs messages sessions"
    " sites".split()
)
PICTURES = (".png", ".svg", ".pdf")
Look = Callable[[Path | None], Path | None]


def output_file(*endings: str, makes: bool = False) -> Look:
    """For the callback of an option: a file, or a device or pipe. endings: the name must have one
    of these; none: any. makes: the command makes its folder, too.
    """

    def fault(path: Path) -> str:
        if path.is_dir():
            return f"{path} is a folder: name a file in it"
        if endings and path.suffix.lower() not in endings:
            return f"{path}: want a file that ends in {' or '.join(endings)}"
        if path.exists() and not os.access(path, os.W_OK):
            return f"{path} may not be written: choose another file"
        if path.exists() and not path.is_file():
            return ""
        folder = _fault_of_new_folder if makes else _fault_of_folder
        return folder(path.parent) or _fault_of_name(path)

    return _look(fault, "file")


def output_link() -> Look:
    """For the callback of an option: a name at which a pseudo-terminal is to be found, in a
    folder that is made where it is absent.
    """

    def fault(path: Path) -> str:
        if path.is_dir():
            return f"{path} is a folder: name a link in it"
        return _fault_of_new_folder(path.parent) or _fault_of_name(path)

    return _look(fault, "link")


def output_folder() -> Look:
    """For the callback of an option: a folder, which is made where it is absent."""
    return _look(_fault_of_new_folder, "folder")


def _look(fault_of: Callable[[Path], str], kind: str) -> Look:
    """A callback that refuses what cannot be written, before any work."""

    def look(value: Path | None) -> Path | None:
        if value is None:
            return None
        if value == Path():
            raise typer.BadParameter("is empty, or this folder: want the path of what is written")
        try:
            fault = fault_of(value)
        except OSError as error:
            fault = reason(error)
        if fault:
            raise typer.BadParameter(fault)
        return value

    look.writes = kind  # type: ignore[attr-defined]
    return look


def output_kind(parameter: Any) -> str:
    """ "file", "link" or "folder" for a parameter that names what is written, else ""."""
    return getattr(parameter.callback, "writes", "")


def _fault_of_new_folder(path: Path) -> str:
    there = path
    while not there.exists() and there != there.parent:
        if fault := _fault_of_name(there):
            return fault
        there = there.parent
    if not there.is_dir():
        return f"{there} is a file: name a folder"
    return _fault_of_folder(there)


def _fault_of_folder(folder: Path) -> str:
    if not folder.is_dir():
        if folder.exists():
            return f"{folder} is no folder: choose another"
        return f"folder {folder} is not there: make it, or choose another"
    if not os.access(folder, os.W_OK | os.X_OK):
        return f"folder {folder} may not be written: choose another"
    return ""


def _fault_of_name(path: Path) -> str:
    try:
        os.lstat(path)
    except (FileNotFoundError, NotADirectoryError):
        pass
    except OSError as error:
        if error.errno == errno.ENAMETOOLONG:
            return f"the name {path.name[:40]}... has {len(os.fsencode(path.name))} bytes: too long"
        raise
    return ""


class Command(TyperCommand):
    """A command whose outputs are none of its inputs, and whose faults are told."""

    def invoke(self, ctx: typer.Context) -> Any:
        """Run it."""
        inputs = list(_paths(self, ctx, outputs=False))
        for option, output in _paths(self, ctx, outputs=True):
            for name, given in inputs:
                if _same(given, output):
                    raise fail(
                        f"{option} {output}: is also the input {name}, which stays as it is;"
                        " choose another file",
                        EXIT_CONFIG,
                    )
        try:
            return super().invoke(ctx)
        except OSError as error:
            if error.errno == errno.EPIPE:
                raise  # who read our output has had enough
            raise fail(error, EXIT_FAILED) from None
        except Exception as error:
            if type(error).__module__.partition(".")[0] not in ROOMS:
                raise
            raise fail(error, EXIT_FAILED) from None


class Commands(typer.Typer):
    """Commands of that kind."""

    def command(self, name: str | None = None, **settings: Any) -> Any:
        """As typer's."""
        settings.setdefault("cls", Command)
        return super().command(name, **settings)


def _paths(command: Command, ctx: typer.Context, outputs: bool) -> Iterator[tuple[str, Path]]:
    """Parameters that name, or may name, what is written, or what is read."""
    for parameter in command.params:
        if bool(output_kind(parameter)) is outputs:
            value = ctx.params.get(parameter.name or "")
            for one in value if isinstance(value, list | tuple) else [value]:
                if isinstance(one, str | Path) and str(one):
                    yield parameter.opts[0], Path(one)


def _same(given: Path, output: Path) -> bool:
    try:
        return any(
            one.samefile(output)
            for one in (given, given / "imu.csv", given / "gnss.csv", given / "recording.mcap")
            if one.is_file()
        )
    except (OSError, ValueError):
        return False


def run_main(app: Any) -> None:
    """Run the command line with three standard streams, whatever the caller closed, and say what
    standard output could not take.
    """
    _have_streams()
    code: Any = 0
    try:
        try:
            app()
        except SystemExit as end:
            code = end.code
        sys.stdout.flush()
    except OSError as error:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # or the interpreter tries once more
        if not code and error.errno != errno.EPIPE:
            fail(error)
        code = code or EXIT_FAILED
    ending(code)
    raise SystemExit(code)


def _have_streams() -> None:
    """A stream that is closed leads nowhere; and no file takes its number."""
    for number in (0, 1, 2):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
    sys.stdin = sys.stdin or open(0, closefd=False)
    sys.stderr = sys.stderr or open(2, "w", closefd=False)
    was = sys.stdout
    sys.stdout = io.TextIOWrapper(
        io.BufferedWriter(_StandardOutput(1, "w", closefd=False)),
        encoding=was.encoding if was else None,
        errors=was.errors if was else None,
        line_buffering=bool(was and was.line_buffering),
    )


class _StandardOutput(io.FileIO):
    """Says its name where it cannot be written."""

    def write(self, data: Any) -> Any:
        """As the base's."""
        try:
            return super().write(data)
        except OSError as error:
            error.filename = "standard output"
            raise
