"""A versioned TOML file of ours: written whole or not at all, read with an error that says what is
wrong with it.
"""

import codecs
import errno
import re
import stat
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import tomli_w

from inertial.whole_file import whole

T = TypeVar("T")

LARGEST = 16 * 1024**2  # bytes of a file of settings
DEEP_KEY = re.compile(r"""(?:[\w"'-]{1,64}[ \t]*\.[ \t]*){33}""")  # tomllib is quadratic in them

MARKS = (
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF16_LE, "utf-16-le"),
    (codecs.BOM_UTF16_BE, "utf-16-be"),
)


def text_of(path: Path) -> str:
    """The text of a file that an editor of any country wrote: UTF-8 with or without a byte-order
    mark, UTF-16, else Windows-1252. Raises OSError, also for what is no file, or too large for one
    that a person wrote.
    """
    path = Path(path)
    shape = stat.S_IFMT(path.stat().st_mode)
    if shape not in (stat.S_IFREG, stat.S_IFDIR):
        raise OSError(errno.EINVAL, "a pipe, a device or a socket; want a file", str(path))
    with path.open("rb") as file:
        data = file.read(LARGEST + 1)
    if len(data) > LARGEST:
        raise OSError(errno.EFBIG, f"more than {LARGEST >> 20} MB; want settings", str(path))
    for mark, encoding in MARKS:
        if data.startswith(mark):
            return data[len(mark) :].decode(encoding, errors="replace")
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError:
        return data.decode("cp1252", errors="replace")


def parsed(text: str) -> dict[str, Any]:
    """A table of TOML. Raises TOMLDecodeError, also for what nests deeper than people write."""
    if DEEP_KEY.search(text):
        raise tomllib.TOMLDecodeError("a key of more than 32 parts")
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise tomllib.TOMLDecodeError("nested too deeply") from None


def write_whole(table: dict[str, Any], path: Path) -> None:
    """Write a table; a file that is there stays as it was until the new one is complete. Raises
    OSError.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    with whole(path) as draft:
        draft.write_bytes(tomli_w.dumps(table).encode())


def read_versioned(
    path: Path,
    kind: str,
    version: int,
    parse: Callable[[dict[str, Any]], T],
    error: type[ValueError],
    remedy: str = "",
) -> T:
    """What `parse` makes of the table of a file with this `version`; `kind` in words, its last word
    is its short name.

    Raises `error` for a file that is none or is not whole, OSError for one that cannot be read.
    `remedy` is what to do about another version.
    """
    try:
        table = parsed(text_of(path))
    except tomllib.TOMLDecodeError as fault:
        raise error(f"{path}: no {kind}: {fault}") from None
    if table.get("version") != version:
        found = f"{kind.split()[-1]} version {table.get('version')!r}"
        raise error(f"{path}: {found}, this program reads {version}{remedy}")
    try:
        return parse(table)
    except (KeyError, TypeError, ValueError) as fault:
        raise error(f"{path}: not a whole {kind} ({type(fault).__name__}: {fault})") from None
