"""The folder of a place: its name, its peers, and the files that prove who it is.

A place is one installation of a site: the lab with the boards, which is the site's home and keeps
its authority, or an office that watches. All files of keys are readable by their owner alone.
"""

import contextlib
import json
import os
import shutil
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Literal, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from inertial.whole_file import put_in_place, sync_folder
from messages.bus.tls import NEXT, key_of
from messages.contract.names import Name

Seat = Literal["viewer", "operator"]  # what the people of another place may do here

PLACE = "place.json"
M = TypeVar("M", bound=BaseModel)


class SiteError(ValueError):
    """What is wrong with a site's files or with what was asked, and what to do."""


class Peer(BaseModel):
    """Another place of the same site, as this one knows it."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    place: Name
    seat: Seat
    address: str  # of its router, "tls/host:port"; empty: it comes to us

    @property
    def hosts(self) -> tuple[str, ...]:
        """The name of its router's machine, which its certificates carry; none where it comes."""
        host = self.address.partition("/")[2].rpartition(":")[0].strip("[]")
        return (host,) if host else ()


class Place(BaseModel):
    """Who this installation is."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    site: Name  # also the first part of every bus key
    place: Name
    home: Name  # the place with the authority
    seat: Seat = "operator"  # what its people may do
    peers: tuple[Peer, ...] = ()

    @property
    def at_home(self) -> bool:
        """Is this the place that keeps the authority?"""
        return self.place == self.home


def load_place(folder: Path) -> Place:
    """The place of a folder; raises SiteError."""
    path = folder / PLACE
    try:
        return Place.model_validate_json(path.read_bytes())
    except FileNotFoundError:
        raise SiteError(
            f"{path} is not there: `gyrofree site init NAME` makes a site, `gyrofree site join`"
            " joins one"
        ) from None
    except OSError as error:
        raise SiteError(f"{path}: {error.strerror}") from None
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"]) or "the file"
        raise SiteError(
            f"{path}: {where}: {first['msg']}; restore it from a backup, or begin anew in an empty"
            " folder"
        ) from None


def save_place(folder: Path, place: Place) -> None:
    """Write it as a whole."""
    text = json.dumps(place.model_dump(mode="json"), indent=1) + "\n"
    write(folder / PLACE, text.encode(), 0o644)


def load_list(path: Path, model: type[M], remedy: str) -> list[M]:
    """The entries of a book; none where it was not begun. Raises SiteError, which ends with the
    remedy.
    """
    try:
        return [model.model_validate(each) for each in json.loads(path.read_bytes())]
    except FileNotFoundError:
        return []
    except (OSError, ValueError, TypeError, ValidationError) as error:
        raise SiteError(f"{path}: cannot be read: {str(error).splitlines()[0]}; {remedy}") from None


def save_list(path: Path, entries: Iterable[BaseModel]) -> None:
    """Write a book as a whole."""
    text = json.dumps([each.model_dump(mode="json") for each in entries], indent=1)
    write(path, text.encode() + b"\n")


def write_identity(folder: Path, role: str, key: bytes, certificate: bytes) -> None:
    """Write key and certificate of a role, both PEM: cut off anywhere, the old pair or the new one
    is there as a whole (messages.bus.tls.key_of).
    """
    write(folder / f"{role}.key{NEXT}", key)
    write(folder / f"{role}.pem", certificate, 0o644)
    key_of(folder, role)  # a service that begins in this moment may do it first
    sync_folder(folder)


@contextlib.contextmanager
def new_folder(folder: Path) -> Iterator[Path]:
    """A folder to be filled, which takes its place when it is whole, and not at all when that
    fails. Raises SiteError where there is something already.
    """
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise SiteError(f"{folder} has something in it: choose another folder")
    folder.parent.mkdir(parents=True, exist_ok=True)
    draft = folder.with_name(f"{folder.name}.{os.getpid()}.draft")
    draft.mkdir(mode=0o700)
    try:
        yield draft
        os.rename(draft, folder)
    finally:
        shutil.rmtree(draft, ignore_errors=True)


def write(path: Path, content: bytes, mode: int = 0o600) -> None:
    """Write a file as a whole: it is the old one or the new one, whatever happens meanwhile."""
    path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
    draft = path.with_name(path.name + ".draft")
    draft.unlink(missing_ok=True)
    try:
        with os.fdopen(os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode), "wb") as stream:
            stream.write(content)
            stream.flush()
            os.fsync(stream.fileno())
        put_in_place(draft, path)
        sync_folder(path.parent)
    finally:
        draft.unlink(missing_ok=True)
