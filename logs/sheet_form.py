"""How a CSV file is written, found from its beginning: encoding, header, separators. And its bytes:
what is no file of text is named, one that grows is read as it was found.
"""

import codecs
import csv
import io
import re
import stat
from collections.abc import Iterator, Sequence
from pathlib import Path

from inertial.toml_file import MARKS

FIRST_LOOK = 1 << 16  # bytes in which the header must stand
SEPARATORS = {",": "comma", ";": "semicolon", "\t": "tab", "|": "bar"}
COMMENTS = ("#", "%", "//")
MISSING = ["", "NA", "N/A", "na", "nan", "NaN", "NAN", "null", "NULL", "None", "-", "--"]
LINE = 1 << 20  # bytes of the longest line, read at once
SHAPES = {
    stat.S_IFDIR: "a folder",
    stat.S_IFIFO: "a pipe",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
    stat.S_IFSOCK: "a socket",
}
FORMS = (  # how other files begin, and what to do about them
    (b"\x1f\x8b", "compressed by gzip: unpack it (gunzip)"),
    (b"\x28\xb5\x2f\xfd", "compressed by zstd: unpack it (unzstd)"),
    (b"\xfd7zXZ", "compressed by xz: unpack it (unxz)"),
    (b"BZh", "compressed by bzip2: unpack it (bunzip2)"),
    (b"PK\x03\x04", "a ZIP archive or a workbook: save its sheet as CSV"),
    (b"\xd0\xcf\x11\xe0", "a workbook: save its sheet as CSV"),
    (b"\x89MCAP", "a recording (MCAP): give its path to export, report or rerun"),
    (b"%PDF", "a PDF"),
    (b"MATLAB 5.0", "a MATLAB file: save its arrays as CSV"),
)


TOLD_SEPARATOR = re.compile(r'"?sep=(.)"?[,;\t|]*', re.IGNORECASE)
ISO_TIME = re.compile(
    r"\d{4}-\d{2}-\d{2}[T ]\d{2}:\d{2}(?::\d{2}(?:\.\d{1,9})?)?(Z|[+-]\d{2}(?::?\d{2})?)?"
)
THOUSANDS = re.compile(r"[+-]?\d{1,3}([.,' \u00a0\u202f])\d{3}(\1\d{3})*([.,]\d*)?")
OWN = ("utc_s", "sequence", "device_us")  # columns that tell an export of ours
OWN_NAMES = {  # of our exports, as logs name them
    "utc_s": "t_s",
    "latitude_deg": "lat_deg",
    "longitude_deg": "lon_deg",
    "omega_radps": "tacho_rad_s",
    **{f"f_b_mps2_{axis}": f"f{axis}_mps2" for axis in "xyz"},
    **{f"omega_ib_b_radps_{axis}": f"w{axis}_radps" for axis in "xyz"},
    **{f"v_n_mps_{axis}": f"v{axis}_mps" for axis in "ned"},
    **{f"position_sigma_ned_m_{a}": f"sd_{b}_m" for a, b in zip("ned", "neu", strict=True)},
}


class LogError(ValueError):
    """A log that cannot be used; names file, line and column, and says what was wanted."""


def printable(text: str, most: int = 60) -> str:
    """Words of a file as a message may show them: no control characters, not too long."""
    shown = "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in text[:most])
    return shown + (" ..." if len(text) > most else "")


def header_line(lines: Sequence[str]) -> int:
    """Number of the first line that is neither empty nor a comment nor a spreadsheet's word on the
    separator; 0 without one.
    """
    for number, line in enumerate(lines, 1):
        text = line.strip()
        if text and not text.startswith(COMMENTS) and not _told(line):
            return number
    return 0


def _told(line: str) -> str:
    """The separator of a line `sep=;`; "" for any other line."""
    found = TOLD_SEPARATOR.fullmatch(line.strip(" \r\n"))
    return found[1] if found else ""


def separator_of(lines: Sequence[str], header: str) -> str:
    """The separator of columns: the one that a line `sep=;` above the header tells, else the most
    frequent of the header's.
    """
    told = next((sign for line in lines if (sign := _told(line)) in SEPARATORS), "")
    return told or max(SEPARATORS, key=lambda s: count(header, s))


def iso_time(cell: str) -> str:
    """How a time is written: "Z" for ISO 8601 with its zone, "T" without, "" for another way."""
    found = ISO_TIME.fullmatch(cell.strip().strip('"'))
    return "" if found is None else "Z" if found[1] else "T"


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
    if decimal != "." and "." in cell:
        return False
    try:
        float(cell.strip().strip('"').replace(decimal, "."))
    except ValueError:
        return False
    return True


def first_bytes(path: Path, most: int) -> tuple[int, bytes]:
    """Size of a file and its beginning. Raises LogError for what is no file of text, OSError."""
    shape = stat.S_IFMT(path.stat().st_mode)
    if shape != stat.S_IFREG:
        raise LogError(f"{path}: {SHAPES.get(shape, 'not a file')}; want a CSV file")
    with path.open("rb") as file:
        size = file.seek(0, io.SEEK_END)
        file.seek(0)
        data = file.read(min(most, size))
    for mark, what in FORMS:
        if data.startswith(mark):
            raise LogError(f"{path}: this is {what}; want CSV")
    return len(data) if len(data) < most else size, data


class _Part(io.RawIOBase):
    """The first bytes of a file, whatever is written behind them meanwhile."""

    def __init__(self, path: Path, size: int) -> None:
        self._file, self._left = path.open("rb", buffering=0), size

    def readable(self) -> bool:
        return True

    def readinto(self, buffer) -> int:
        wanted = memoryview(buffer)[: self._left]
        got = self._file.readinto(wanted) or 0
        self._left -= got
        return got

    def close(self) -> None:
        self._file.close()
        super().close()


def opened(path: Path, size: int) -> io.BufferedReader:
    """The first `size` bytes of a file as a stream."""
    return io.BufferedReader(_Part(path, size), LINE)


class Lines:
    """Lines of a file, front to end, none of them longer than LINE."""

    def __init__(self, path: Path, size: int, encoding: str) -> None:
        self._text = io.TextIOWrapper(opened(path, size), encoding=encoding, errors="replace")
        self._number, self._line = 0, ""

    def __iter__(self) -> Iterator[str]:
        while line := self._next():
            yield line

    def line(self, number: int) -> str:
        """Line `number`, from 1, which must not fall from call to call; empty behind the end."""
        while self._number < number and self._next():
            pass
        return self._line if self._number == number else ""

    def _next(self) -> str:
        self._line = line = self._text.readline(LINE)
        while line and not line.endswith("\n") and len(line) == LINE:
            line = self._text.readline(LINE)  # the rest of a line that is too long is passed over
        self._number += bool(self._line)
        return self._line


def long_line(path: Path, size: int) -> int:
    """Number of the first line that is longer than LINE."""
    number, length = 1, 0
    with opened(path, size) as stream:
        while block := stream.read(LINE):
            for k, part in enumerate(block.replace(b"\r\n", b"\n").split(b"\n")):
                if k:
                    number, length = number + 1, 0
                length += len(part)
                if length > LINE:
                    return number
    return number
