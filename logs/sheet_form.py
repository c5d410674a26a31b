"""How a CSV file is written, found from its beginning: encoding, header, separators."""

import codecs
import csv
from collections.abc import Sequence
from pathlib import Path

from inertial.toml_file import MARKS

FIRST_LOOK = 1 << 16  # bytes in which the header must stand
SEPARATORS = {",": "comma", ";": "semicolon", "\t": "tab", "|": "bar"}
COMMENTS = ("#", "%", "//")
MISSING = ["", "NA", "N/A", "na", "nan", "NaN", "NAN", "null", "-"]


class LogError(ValueError):
    """A log that cannot be used; names file, line and column, and says what was wanted."""


def printable(text: str, most: int = 60) -> str:
    """Words of a file as a message may show them: no control characters, not too long."""
    shown = "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in text[:most])
    return shown + (" ..." if len(text) > most else "")


def header_line(lines: Sequence[str]) -> int:
    """Number of the first line that is neither empty nor a comment; 0 without one."""
    texts = (line.strip() for line in lines)
    return next((k for k, s in enumerate(texts, 1) if s and not s.startswith(COMMENTS)), 0)


def decoded(path: Path, data: bytes, more: bool) -> tuple[str, str]:
    """Encoding and text of the beginning of a file; `more` follows."""
    for mark, encoding in MARKS:
        if data.startswith(mark):
            name = "utf-8-sig" if encoding == "utf-8" else "utf-16"
            text = codecs.getincrementaldecoder(encoding)("replace").decode(data[len(mark) :])
            return name, text
    if b"\0" in data:
        for encoding, zeros in (("utf-16-le", data[1::2]), ("utf-16-be", data[0::2])):
            if zeros and zeros.count(0) > 0.4 * len(zeros):
                return encoding, codecs.getincrementaldecoder(encoding)("replace").decode(data)
        raise LogError(f"{path}: not a text file (it holds zero bytes); want CSV")
    if more and b"\n" not in data and b"\r" not in data:
        raise LogError(f"{path}:1: a line of more than {FIRST_LOOK >> 10} kB; want CSV")
    try:
        return "utf-8", codecs.getincrementaldecoder("utf-8")().decode(data, final=not more)
    except UnicodeDecodeError:
        return "cp1252", data.decode("cp1252", errors="replace")


def decimal_of(lines: Sequence[str], separator: str) -> str:
    """The decimal sign: a comma where cells between other separators have one."""
    if separator == ",":
        return "."
    for line in lines[:20]:
        for cell in next(csv.reader([line], delimiter=separator), []):
            if "," in cell and is_number(cell, ","):
                return ","
    return "."


def count(line: str, separator: str) -> int:
    """Separators outside of quotes."""
    return (
        sum(part.count(separator) for part in line.split('"')[0::2])
        if '"' in line
        else (line.count(separator))
    )


def is_number(cell: str, decimal: str) -> bool:
    try:
        float(cell.strip().strip('"').replace(decimal, "."))
    except ValueError:
        return False
    return True
