"""From a backup into an installation: everything is checked, then laid ready, then put in place."""

import hashlib
import os
import secrets
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from gyrofree.config import ConfigError, Settings, check, load
from gyrofree.operations.backup.archive import Archive, Entry
from gyrofree.operations.backup.parts import (
    FILES,
    SETTINGS,
    BackupError,
    Part,
    files_below,
    named_files,
    parts_of,
)
from gyrofree.operations.backup.swap import Move, swap
from inertial.toml_file import parsed
from inertial.whole_file import sync_folder
from sessions.recording.manifest import NUMBER

Progress = Callable[[int], None]


@dataclass
class Unit:
    """What takes its place as a whole: a file, or a folder with its files."""

    part: str
    target: Path
    private: bool
    root: Path  # below which no link is followed
    family: Part | None = None  # that it is a member of
    files: dict[str, Entry] = field(default_factory=dict)  # by path in it; "": it is a file

    @property
    def is_file(self) -> bool:
        return "" in self.files


def settings_for(archive: Archive, config: Path) -> Settings:
    """By which the places are found: those of this installation, else those in the backup, whose
    paths must then stay in the working folder. Raises BackupError, ConfigError.
    """
    if config.exists():
        return load(config)
    entry = next((e for e in archive.contents.entries if e.part == SETTINGS), None)
    if entry is None:
        return Settings()
    try:
        text = archive.content(entry).decode()
        settings = check(parsed(text), "the backup's gyrofree.toml", text)
    except (ConfigError, ValueError) as error:
        raise BackupError(f"the backup's gyrofree.toml cannot be used here: {error}") from None
    paths = {part.name: part.path for part in parts_of(settings, config) if part.name != SETTINGS}
    for key, path in (paths | named_files(settings)).items():
        if path.is_absolute() or ".." in path.parts:
            raise BackupError(
                f"the backup's settings lead out of this folder ({key}: {path}): put a"
                " gyrofree.toml here first that says where everything belongs, or restore with"
                " --only"
            )
    return settings


def units_of(archive: Archive, settings: Settings, config: Path, only: set[str]) -> list[Unit]:
    """What is in the backup, with its places. Raises BackupError."""
    parts = {part.name: part for part in parts_of(settings, config)}
    named = named_files(settings)
    found: dict[Path, Unit] = {}
    for entry in archive.contents.entries:
        if only and entry.part not in only:
            continue
        if entry.part == FILES:
            target, private, part = named.get(entry.unit), True, None
            if target is None or entry.path:
                raise BackupError(
                    f"the backup has the file of {entry.unit}, which the settings do not name;"
                    " restore the settings first, or use --only"
                )
            below = ""
        else:
            part = parts.get(entry.part)
            if part is None:
                raise BackupError(
                    f"the backup has {entry.part}, for which the settings here have no place;"
                    " set it ([bus] tls for a site), or use --only"
                )
            target, below = _place(part, entry)
            private = part.private
        root = part.path if part is not None else target.parent
        family = part if part is not None and part.kind == "family" else None
        unit = found.setdefault(target, Unit(entry.part, target, private, root, family))
        unit.files[below] = entry
    for unit in found.values():
        if unit.is_file and len(unit.files) > 1:
            raise BackupError(f"the backup has {unit.target} as a file and as a folder")
    return list(found.values())


def _place(part: Part, entry: Entry) -> tuple[Path, str]:
    """Place of a unit, and the path of the file in it. Raises BackupError where the part has no
    such.
    """
    unit, path = entry.unit, entry.path
    if part.kind == "file" and not unit and not path:
        return part.path, ""
    if part.kind == "family" and unit.startswith(part.path.name) and "/" not in unit:
        return part.path.with_name(unit), path
    if part.kind == "folder" and not unit and path:
        return part.path, path
    if part.kind == "sessions" and unit and "/" not in unit:
        return part.path / unit, path
    if part.kind == "files" and unit and not path:
        return part.path / unit, ""
    raise BackupError(f"the backup names {entry.name!r}, which {part.name} cannot have here")


def restore(
    archive: Archive, units: list[Unit], config: Path, overwrite: bool, progress: Progress
) -> list[Unit]:
    """Put the units in their places; what was put there. What is there already with the same
    content stays. Raises BackupError, OSError; the installation is then as it was.
    """
    wanted = [unit for unit in units if not _stands(unit)]
    superfluous = _superfluous(units)
    there = [unit.target for unit in wanted if os.path.lexists(unit.target)] + superfluous
    there = [path for path in there if path.name != NUMBER]
    if there and not overwrite:
        names = ", ".join(map(str, there[:5]))
        more = f" and {len(there) - 5} more" if len(there) > 5 else ""
        raise BackupError(
            f"there already, with other content: {names}{more}; --overwrite replaces them, --only"
            " restores some parts"
        )
    archive.verify((entry for unit in units for entry in unit.files.values()), progress)
    mark = secrets.token_hex(4)
    moves = [_move(unit.target, mark, draft=True) for unit in wanted]
    moves += [_move(path, mark, draft=False) for path in superfluous]
    made: list[Path] = []

    def lay_ready() -> None:
        for unit, move in zip(wanted, moves, strict=False):
            made.extend(_folders(unit))
            _lay_ready(archive, unit, Path(move.draft), progress)

    try:
        swap(config.absolute().parent, moves, lay_ready)
    except BaseException:
        for folder in reversed(made):
            folder.rmdir()
        raise
    return wanted


def _stands(unit: Unit) -> bool:
    """Is a unit there with this very content? The number of the newest session is never lowered."""
    if unit.is_file:
        if unit.part == "sessions" and unit.target.name == NUMBER and unit.target.is_file():
            return True
        return _equal(unit.target, unit.files[""])
    if unit.target.is_symlink() or not unit.target.is_dir():
        return False
    if {below for below, _ in files_below(unit.target)} != unit.files.keys():
        return False
    return all(_equal(unit.target / below, entry) for below, entry in unit.files.items())


def _equal(path: Path, entry: Entry) -> bool:
    if path.is_symlink() or not path.is_file() or path.stat().st_size != entry.size:
        return False
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest() == entry.sha256


def _superfluous(units: list[Unit]) -> list[Path]:
    """What belongs to a family that the backup has, and is not in it: it would let people in."""
    found = set()
    for part in {unit.family for unit in units if unit.family is not None}:
        targets = {unit.target for unit in units}
        there = part.path.parent.glob(f"{part.path.name}*") if part.path.parent.is_dir() else []
        found |= {path for path in there if path not in targets}
    return sorted(found)


def _folders(unit: Unit) -> list[Path]:
    """Make the folders that a unit lies in; those that were made, the outer one first. Raises
    BackupError where one is a link that somebody put there.
    """
    parent = unit.target.parent
    for folder in (parent, *parent.parents):
        if folder == unit.root or unit.root not in folder.parents:
            break
        if folder.is_symlink():
            raise BackupError(f"{folder} is a link: nothing is restored through it")
    missing = [folder for folder in (parent, *parent.parents) if not folder.exists()]
    for folder in reversed(missing):
        folder.mkdir(mode=0o700 if unit.private else 0o755)
    return missing[::-1]


def _move(target: Path, mark: str, draft: bool) -> Move:
    """Of a place; what is new and what was there wait beside it."""
    there = os.path.lexists(target)
    beside = f".{target.name}.{mark}"
    return Move(
        str(target.absolute()),
        str(target.absolute().with_name(f"{beside}.restored")) if draft else "",
        str(target.absolute().with_name(f"{beside}.before")) if there else "",
    )


def _lay_ready(archive: Archive, unit: Unit, draft: Path, progress: Progress) -> None:
    """Write a unit under another name, on the disk when this returns."""
    if unit.is_file:
        _write(archive, unit.files[""], draft, unit.private, progress)
        return
    folders = {draft}
    draft.mkdir(mode=0o700)
    for below, entry in unit.files.items():
        path = draft / below
        path.parent.mkdir(parents=True, exist_ok=True)
        folders |= {folder for folder in path.parents if draft in (folder, *folder.parents)}
        _write(archive, entry, path, unit.private, progress)
    if not unit.private:
        for folder in folders:
            folder.chmod(0o755)
    for folder in folders:
        sync_folder(folder)


def _write(archive: Archive, entry: Entry, path: Path, private: bool, progress: Progress) -> None:
    mode = entry.mode & (0o600 if private else 0o755) | 0o600
    fd = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW, 0o600)
    with os.fdopen(fd, "wb") as stream:
        archive.copy(entry, stream, progress)
        stream.flush()
        os.fchmod(stream.fileno(), mode)
        os.fsync(stream.fileno())
