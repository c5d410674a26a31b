"""Many files and folders take their places together, or none does: also when the process is killed
in the middle.

What is new is laid ready beside its place. A plan of all moves is on the disk before that, held by
a lock while its process lives. A plan that nobody holds is of a process that was killed: whoever
comes next moves everything back.
"""

import fcntl
import json
import os
import shutil
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

from gyrofree.operations.backup.parts import BackupError
from inertial.whole_file import sync_folder

PLAN = ".gyrofree-restore.json"  # beside the configuration


@dataclass(frozen=True)
class Move:
    """One place."""

    target: str
    draft: str = ""  # what takes it; "": nothing, it becomes empty
    aside: str = ""  # where what was there waits; "": nothing was there


def swap(folder: Path, moves: list[Move], lay_ready: Callable[[], None]) -> None:
    """Carry out all moves, or none; folder: that the plan is kept in. lay_ready writes the drafts;
    what it raises is passed on. Raises BackupError, OSError; after any of these everything is as
    it was.
    """
    plan = folder / PLAN
    try:
        fd = os.open(plan, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)
    except FileExistsError:
        raise BackupError(f"{plan}: another restore is under way") from None
    with os.fdopen(fd, "w") as stream:
        fcntl.flock(stream, fcntl.LOCK_EX)
        json.dump([asdict(move) for move in moves], stream)
        stream.flush()
        os.fsync(stream.fileno())
        sync_folder(folder)
        try:
            lay_ready()
            for move in moves:
                _go(move)
        except BaseException:
            _back(moves)
            plan.unlink()
            raise
        plan.unlink()  # from here on the new state is what stands
        sync_folder(folder)
    for move in moves:
        if move.aside:
            remove(Path(move.aside))


def settle(folder: Path) -> str:
    """Bring back what a restore that was killed had moved; what was done, "" for nothing. Raises
    BackupError while one is under way, or where the plan cannot be read.
    """
    plan = folder / PLAN
    try:
        stream = plan.open("r+")
    except FileNotFoundError:
        return ""
    except OSError as error:
        raise BackupError(f"{plan}: {error.strerror}: a restore was cut off there") from None
    with stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise BackupError(f"{plan}: a restore is under way: wait until it has ended") from None
        try:
            moves = [Move(**move) for move in json.load(stream)]
        except (ValueError, TypeError):
            moves = []  # it was cut off before the first move
        try:
            _back(moves)
            plan.unlink(missing_ok=True)
        except OSError as error:
            raise BackupError(
                f"{plan}: a restore was cut off, and what was before cannot be brought back:"
                f" {error.filename}: {error.strerror}"
            ) from None
    return "a restore was cut off: everything is as it was before it" if moves else ""


def remove(path: Path) -> None:
    """A file or a folder with all that is in it, where it is there."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def _go(move: Move) -> None:
    if move.aside:
        os.rename(move.target, move.aside)
    if move.draft:
        os.rename(move.draft, move.target)
    sync_folder(Path(move.target).parent)


def _back(moves: list[Move]) -> None:
    """As it was, wherever it was cut off; may itself be cut off and done again."""
    for move in reversed(moves):
        target, draft, aside = Path(move.target), Path(move.draft), Path(move.aside)
        if move.aside and os.path.lexists(aside):
            remove(target)
            os.rename(aside, target)
        elif not move.aside and move.draft and not os.path.lexists(draft):
            remove(target)  # the draft has taken a place that was empty
        if move.draft:
            remove(draft)
