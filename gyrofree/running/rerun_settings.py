"""Settings of an estimator changed for one rerun, and what files a person at the page may name:
those of the library, by name, and no others.

Whoever may order a rerun over the network is not for that allowed to have the server open any file
of its disk. Every setting whose value is a file or folder counts, also one that is added later:
what is not in FOLDERS is refused.
"""

import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from estimator.settings import EstimatorSettings
from inertial.toml_file import parsed as parse_toml
from messages.text import file_name, plain

# settings that name a file -> the setting of the folder that such files are saved to
FOLDERS = {"calibration": "cards", "calibrations": "cards", "axis_maps": "axes"}
LARGEST = 10_000_000  # bytes of a card or an axis map; they have some kB


def from_library(configured: EstimatorSettings, changed: EstimatorSettings) -> EstimatorSettings:
    """The changed settings, with files of the library in place of their names; raises ValueError
    for any other file.
    """
    before = dict(_files((), configured.model_dump()))
    data = changed.model_dump()
    for place, value in list(_files((), data)):
        if not value or before.get(place) == value:
            continue
        if place[0] not in FOLDERS:
            raise ValueError(
                f"{'.'.join(place)}: only the configuration of the server can name it, not an order"
            )
        table = data
        for part in place[:-1]:
            table = table[part]
        table[place[-1]] = _file(getattr(configured, FOLDERS[place[0]]), str(value), place)
    return EstimatorSettings.model_validate(data)


def with_changes(settings: EstimatorSettings, changes: list[str]) -> EstimatorSettings:
    """Settings with `key=value` texts applied, values as in TOML (a bare word is a string); raises
    ValueError.
    """
    data = settings.model_dump()
    for text in changes:
        key, equals, value = (part.strip() for part in text.partition("="))
        try:
            parsed = parse_toml(f"value = {value}")["value"]
        except tomllib.TOMLDecodeError:
            parsed = value
        place, *inner = key.split(".")
        table, name = data, place
        for part in inner:
            table, name = table.get(name) if isinstance(table, dict) else None, part
        if not equals or not isinstance(table, dict) or name not in table:
            raise ValueError(
                f"--set {text!r}: want KEY=VALUE with a key of [estimator], like"
                " layout.half_side_m=0.0493"
            )
        table[name] = parsed
    try:
        return EstimatorSettings.model_validate(data)
    except ValidationError as error:
        first = error.errors()[0]
        raise ValueError(f"--set {'.'.join(map(str, first['loc']))}: {first['msg']}") from None


def _files(place: tuple[str, ...], value: Any) -> Iterator[tuple[tuple[str, ...], Any]]:
    """(where, value) of everything in the settings that is a path."""
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from _files((*place, name), inner)
    elif isinstance(value, Path) or (place and place[-1] == "file"):
        yield place, value


def _file(folder: Path, name: str, place: tuple[str, ...]) -> Path:
    """A file of the library by name; raises ValueError."""
    where, shown = ".".join(place), plain(name, 80)
    if fault := file_name(name):
        raise ValueError(f"{where} {shown}: {fault}: want the name of a file in {folder}")
    path = folder / name
    try:
        inside = path.resolve().parent == folder.resolve() and path.is_file()
        if not inside or path.stat().st_size > LARGEST:
            raise ValueError(f"{where} {shown}: no such file in {folder}")
    except OSError as error:
        raise ValueError(f"{where} {shown}: {error.strerror}") from None
    return path
