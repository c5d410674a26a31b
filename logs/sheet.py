"""The one reader of CSV: whatever a spreadsheet, a logger or a script of another country writes.

    sheet = open_sheet(path)                      looks at the beginning only
    table = sheet.read(["t_s", "fx_mps2"])        numbers, or an error that names line and column

Encodings: UTF-8 with or without a byte-order mark, UTF-16, else Windows-1252. Separators: comma,
semicolon, tab, bar, or what a spreadsheet's line `sep=;` says. Decimal comma where the separator is
another. Times may be dates of ISO 8601. Units may stand in brackets or in a row below the header
(tables/heading.py). Lines that begin with #, % or // are comments, before the header and below it;
empty lines are left out; the header may be quoted. The file is read in blocks, so memory grows with
the numbers that are kept, not with the text.
"""

import csv
from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from logs.sheet_blocks import blocks, parsed, without_lines
from logs.sheet_form import (
    COMMENTS,
    FIRST_LOOK,
    LINE,
    MISSING,
    SEPARATORS,
    THOUSANDS,
    Lines,
    LogError,
    decimal_of,
    decoded,
    first_bytes,
    header_line,
    is_number,
    iso_time,
    printable,
    separator_of,
)
from logs.tables.heading import Heading, heading

Array = NDArray[np.float64]

MOST_COLUMNS = 4096
SEPARATED = " or ".join(SEPARATORS.values())


@dataclass(frozen=True)
class Table:
    """Numbers of a sheet; arrays over its rows (n)."""

    columns: dict[str, Array]
    lines: NDArray[np.int64]  # (n,) of the file, from 1
    cut_off: bool  # the last line was half written and is left out

    def __getitem__(self, name: str) -> Array:
        return self.columns[name]

    def __contains__(self, name: str) -> bool:
        return name in self.columns

    def __len__(self) -> int:
        return len(self.lines)


@dataclass
class _Rows:
    """Rows that are no samples, as the parser meets them."""

    first: int  # number that the parser gives to the first row below the header
    skipped: array = field(default_factory=lambda: array("q"))  # comments and empty lines
    wrong: list[tuple[int, int, str]] = field(default_factory=list)  # row, cells, text: two at most
    count: int = 0  # rows that the parser left out
    cut_off: bool = False

    def judge(self, number: int, cells: int, text: str) -> None:
        """Note a row of a wrong number of cells."""
        self.count += 1
        text = text.strip()
        if not text.strip(",;|\t ") or text.startswith(COMMENTS):
            self.skipped.append(number)
        elif len(self.wrong) < 2:
            self.wrong.append((number, cells, printable(text)))

    def lines(self, index: NDArray[np.int64]) -> NDArray[np.int64]:
        """Lines of the file of rows that were kept, by their order."""
        out = np.sort([*self.skipped, *(row[0] for row in self.wrong)]).astype(np.int64)
        kept_before = out - self.first - np.arange(len(out))
        return index + self.first + np.searchsorted(kept_before, index, side="right")


class _Growing:
    """A column that grows block by block in one array, as long as the file's size promises."""

    def __init__(self, size: int) -> None:
        self._blocks = 2 + size // LINE
        self._values, self._n = np.zeros(0), 0

    def add(self, part: Array) -> None:
        """More of it."""
        if self._n + len(part) > len(self._values):
            larger = np.empty(max(len(part) * self._blocks, 2 * len(self._values)))
            larger[: self._n] = self._values[: self._n]
            self._values = larger  # pages that are never written take no memory
        self._values[self._n : self._n + len(part)] = part
        self._n += len(part)

    def whole(self) -> Array:
        """All of it."""
        return self._values[: self._n]


@dataclass(frozen=True)
class Sheet:
    """How a file is written, found from its beginning."""

    path: Path
    size: int  # bytes when it was looked at; what comes later is not read
    encoding: str
    separator: str
    decimal: str
    header_line: int  # of the file, from 1
    head: Heading

    @property
    def header(self) -> tuple[str, ...]:
        """Names of the columns as logs have them."""
        return self.head.names

    def want(self, names: Sequence[str], purpose: str = "") -> None:
        """Raises LogError for a column that is not there."""
        twice = [name for name in names if self.header.count(name) > 1]
        if twice:
            raise LogError(
                f"{self.path}:{self.header_line}: column {printable(twice[0])!r} stands there"
                " twice; rename or remove one"
            )
        missing = [name for name in names if name not in self.header]
        if not missing:
            return
        more = " ..." if len(self.header) > 20 else ""
        found = ", ".join(map(printable, self.head.written[:20])) + more
        separated = f"; the line has one column only: separate columns by {SEPARATED}"
        separated = separated if len(self.header) == 1 else ""
        share = f" ({len(missing)} of {len(names)} are)" if 1 < len(missing) < len(names) else ""
        raise LogError(
            f"{self.path}:{self.header_line}: column {missing[0]!r} is missing{share}, found"
            f" {found}{separated}; want {purpose or ', '.join(names)}"
        )

    def read(self, names: Sequence[str], may_miss: Sequence[str] = ()) -> Table:
        """The named columns, each once; cells of `may_miss` may be empty and become NaN.

        Raises LogError for a column that is missing, a cell that is no finite number, a row with
        too few cells or a line that is too long; OSError for a file that cannot be read.
        """
        self.want(names)
        rows, done = _Rows(self.head.above + 1), 0
        blanks = Lines(self.path, self.size, self.encoding)
        kept: dict[str, _Growing] = {name: _Growing(self.size) for name in names}
        for batch in self._batches(list(kept), rows):
            table = {
                name: column.to_numpy(zero_copy_only=False).astype(np.float64, copy=False)
                for name, column in zip(kept, batch.columns, strict=True)
            }
            empty = self._empty(table, rows, done, blanks)
            for name, column in table.items():
                samples = column[~empty]
                if name not in may_miss:
                    self._finite(samples, name, rows, done)
                kept[name].add(samples)
            done += int(np.count_nonzero(~empty))
        cut_off = self._check_rows(rows, done)
        columns = {name: column.whole() for name, column in kept.items()}
        return Table(columns, rows.lines(np.arange(done)), cut_off)

    def _batches(self, names: list[str], rows: _Rows) -> Iterator[pa.Table]:
        # names are ours: a column that stands twice, or has none, must not stop the reader
        unique = [f"{k}:{name}" for k, name in enumerate(self.header)]
        chosen = [unique[self.header.index(name)] for name in names]
        # numbers are ASCII; bytes that Windows-1252 does not know must not end the reading
        encoding = "latin-1" if self.encoding == "cp1252" else self.encoding
        done, above = self.head.above, self.head.above
        times = {
            unique[self.header.index(n)]: self.head.times[n] for n in names if n in self.head.times
        }
        try:
            for block in blocks(self.path, self.size, encoding):
                if above:
                    block, above = without_lines(block, above), 0
                if not block:
                    continue
                left_out = rows.count

                def judge(row: int, cells: int, text: str, before: int = done) -> None:
                    rows.judge(before + row, cells, text)

                try:
                    table = parsed(
                        block, unique, chosen, self.separator, self.decimal, judge, times
                    )
                except pa.ArrowInvalid:
                    if block.endswith((b"\n", b"\r")):
                        raise
                    rows.cut_off = True  # in the middle of a number
                    return
                done += len(table) + rows.count - left_out
                yield table
        except UnicodeDecodeError as error:
            raise LogError(f"{self.path}: no text in {self.encoding}: {error.reason}") from None
        except pa.ArrowInvalid as error:
            raise LogError(
                self._no_number(names) or f"{self.path}: {printable(str(error))}"
            ) from None

    def _empty(
        self, table: dict[str, Array], rows: _Rows, done: int, text: Lines
    ) -> NDArray[np.bool_]:
        """Which rows are empty lines; they are noted as skipped."""
        empty = np.all([np.isnan(column) for column in table.values()], axis=0)
        if empty.any():
            lines = rows.lines(np.arange(done, done + len(empty)))
            nothing = ' \t\r\n"' + self.separator
            for k in np.nonzero(empty)[0].tolist():
                empty[k] = not text.line(int(lines[k])).strip(nothing)
            rows.skipped.extend(lines[empty].tolist())
        return empty

    def _finite(self, column: Array, name: str, rows: _Rows, done: int) -> None:
        bad = np.nonzero(~np.isfinite(column))[0]
        if len(bad):
            line = int(rows.lines(bad[:1] + done)[0])
            raise LogError(
                f"{self.path}:{line}: column {name!r}: {self._cell(line, name)!r} is no finite"
                " number; correct it, or leave the row out: it then counts as a missing sample"
            )

    def _check_rows(self, rows: _Rows, done: int) -> bool:
        """Raises LogError for a row of a wrong number of cells; True for a last line cut off."""
        last = done + len(rows.skipped) + len(rows.wrong)
        for number, cells, text in rows.wrong:
            if cells < len(self.header) and number - rows.first == last - 1:
                if not self._ends_with_newline():
                    return True
            raise LogError(
                f"{self.path}:{number}: {cells} cells, the header names {len(self.header)}:"
                f" {text!r}; complete the row, or leave it out"
            )
        return rows.cut_off

    def _ends_with_newline(self) -> bool:
        with self.path.open("rb") as file:
            file.seek(max(0, self.size - 4))
            return file.read(min(4, self.size)).rstrip(b"\0").endswith((b"\n", b"\r"))

    def _cells(self, line: str) -> list[str]:
        return next(csv.reader([line], delimiter=self.separator), [])

    def _cell(self, line: int, name: str) -> str:
        place = self.header.index(name)
        cells = self._cells(Lines(self.path, self.size, self.encoding).line(line))
        return printable(cells[place].strip()) if place < len(cells) else ""

    def _no_number(self, names: list[str]) -> str:
        """The first cell that is no number, in words."""
        places = [(name, self.header.index(name)) for name in names]
        for number, line in enumerate(Lines(self.path, self.size, self.encoding), 1):
            cells = self._cells(line)
            if number <= self.head.above or not cells or cells[0].startswith(COMMENTS):
                continue
            for name, place in places:
                cell = cells[place].strip() if place < len(cells) else ""
                if name in self.head.times:
                    wrong = iso_time(cell) != self.head.times[name]
                else:
                    wrong = not is_number(cell, self.decimal)
                if cell and cell not in MISSING and wrong:
                    return (
                        f"{self.path}:{number}: column {name!r}: {printable(cell)!r} is no finite"
                        f" number{self._comma_hint(cell)}; correct it, or leave the row out"
                    )
        return ""

    def _comma_hint(self, cell: str) -> str:
        if THOUSANDS.fullmatch(cell):
            return " (write numbers without a separator of thousands)"
        if self.decimal == "," and is_number(cell, "."):
            return " (other numbers of the file have a decimal comma)"
        if self.decimal == "." and is_number(cell, ","):
            return " (a decimal comma wants another separator of columns: semicolon or tab)"
        return ""


def open_sheet(path: Path) -> Sheet:
    """Find encoding, separator, decimal sign and header. Raises LogError, OSError."""
    size, data = first_bytes(path, FIRST_LOOK)
    more = len(data) < size
    encoding, text = decoded(path, data, more)
    lines = text.splitlines()
    number = header_line(lines)
    if more and number in (0, len(lines)):
        raise LogError(
            f"{path}:{len(lines)}: no header in the first {FIRST_LOOK >> 10} kB; want CSV with a"
            " line of columns' names above the samples"
        )
    if number == 0:
        raise LogError(f"{path}: empty; want a header line with the columns' names, and samples")
    separator = separator_of(lines[: number - 1], lines[number - 1])
    head = heading(lines, number, separator)
    if len(head.names) > MOST_COLUMNS:
        raise LogError(
            f"{path}:{number}: {len(head.names)} columns; this program reads up to {MOST_COLUMNS}"
        )
    if all(is_number(name, ".") for name in head.names):
        raise LogError(
            f"{path}:{number}: numbers where the columns' names were expected"
            f" ({printable(lines[number - 1])!r}); want a header line above the samples"
        )
    if head.contradicted:
        name, unit = head.contradicted
        raise LogError(
            f"{path}:{head.above}: column {name!r} is in {printable(unit)!r} by this row of units;"
            " let name and unit agree"
        )
    decimal = decimal_of(lines[head.above :], separator)
    return Sheet(path, size, encoding, separator, decimal, number, head)
