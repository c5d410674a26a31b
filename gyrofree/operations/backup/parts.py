"""What belongs to an installation, and where its settings say that it is.

A part is made of units, each of which is restored as a whole or not at all: a session, the site's
folder, a file. A test holds this table against the model of the settings: every path in it is a
part, a named file, or left out for a reason.
"""

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from gyrofree.config import Settings

Kind = Literal["file", "family", "folder", "sessions", "files"]


class BackupError(ValueError):
    """What cannot be backed up or restored, and what to do."""


@dataclass(frozen=True)
class Part:
    """Something that is kept.

    kind: "file": one; "family": a file and all beside it whose names begin with its name; "folder":
    a folder as one unit; "sessions": a folder in which each folder is one; "files": a folder in
    which each file is one.
    """

    name: str
    kind: Kind
    path: Path
    private: bool = False  # restored so that its owner alone can read it


PATHS = {  # part -> key of the settings, kind, private
    "sessions": ("recorder.root", "sessions", False),
    "users": ("dashboard.users", "family", True),
    "site": ("bus.tls", "folder", True),
    "alarms": ("alarms.state", "file", False),
    "cards": ("estimator.cards", "files", False),
    "axes": ("estimator.axes", "files", False),
    "runs": ("procedures.root", "files", False),
    "procedures": ("procedures.folder", "files", False),
}
NAMED = (  # single files that the settings name, restored to where they were
    "dashboard.tls_certificate",
    "dashboard.tls_key",
    "dashboard.oidc_secret",
    "dashboard.oidc_ca",
    "alarms.webhook.secret_file",
    "alarms.mail.password_file",
    "estimator.calibration",
    "estimator.calibrations",
    "estimator.axis_maps",
)
LEFT_OUT = {
    "gateway.journal": "raw bytes of the last days: what was recorded is in the sessions",
    "estimator.journal": "what it needs after a crash of this machine, and no other",
    "bus.zenohd": "a program, which is installed",
    "dashboard.map": "a copy of somebody else's file",
    "dashboard.sessions_root": "recorder.root, as the page sees it",
}
SETTINGS, FILES = "settings", "files"  # the configuration itself, and what it names
NAMES = (SETTINGS, *PATHS, FILES)


def value_of(settings: Settings, key: str) -> object:
    """Of a dotted key; None where a table on its way is absent."""
    value: object = settings
    for name in key.split("."):
        value = None if value is None else getattr(value, name)
    return value


def parts_of(settings: Settings, config: Path) -> list[Part]:
    """All parts of an installation, in the order in which they are restored: what lets people in
    comes last.
    """
    found = [Part(SETTINGS, "file", config)]
    for name, (key, kind, private) in PATHS.items():
        path = value_of(settings, key)
        if path is not None:
            found.append(Part(name, kind, Path(str(path)), private))  # type: ignore[arg-type]
    return found


def named_files(settings: Settings) -> dict[str, Path]:
    """Files that the settings name, by their key."""
    found: dict[str, Path] = {}
    for key in NAMED:
        value = value_of(settings, key)
        if isinstance(value, dict):
            found |= {f"{key}.{name}": Path(path) for name, path in value.items()}
        elif value is not None:
            found[key] = Path(str(value))
    return found


def files_below(folder: Path) -> Iterator[tuple[str, os.DirEntry]]:
    """Everything in a folder but folders, by its path in it, in a fixed order; links unfollowed.
    Raises OSError.
    """
    with os.scandir(folder) as listed:
        entries = sorted(listed, key=lambda entry: entry.name)
    for entry in entries:
        if entry.is_dir(follow_symlinks=False):
            for below, found in files_below(Path(entry.path)):
                yield f"{entry.name}/{below}", found
        else:
            yield entry.name, entry
