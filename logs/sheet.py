"""The one reader of CSV: whatever a spreadsheet, a logger or a script of another country writes.

    sheet = open_sheet(path)                      looks at the beginning only
    table = sheet.read(["t_s", "fx_mps2"])        numbers, or an error that names line and column

Encodings: UTF-8 with or without a byte-order mark, UTF-16, else Windows-1252. Separators: comma,
semicolon, tab, bar. Decimal comma where the separator is another. Lines that begin with #, % or //
are comments, before the header and below it; empty lines are left out; the header may be quoted.
The file is read in blocks, so memory grows with the numbers that are kept, not with the text.
"""

import csv
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv
from numpy.typing import NDArray

from logs.sheet_form import (
    COMMENTS,
    FIRST_LOOK,
    MISSING,
    SEPARATORS,
    LogError,
    count,
    decimal_of,
    decoded,
    header_line,
    is_number,
)

Array = NDArray[np.float64]

BLOCK = 1 << 20  # bytes read at once; no line may be longer


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

    skipped: list[int] = field(default_factory=list)  # row numbers of comments and empty lines
    wrong: list[tuple[int, int, str]] = field(default_factory=list)  # row, cells, text

    def judge(self, row: pa.csv.InvalidRow) -> str:
        """What to do with a row of a wrong number of cells."""
        text = row.text.strip()
        if not text.strip(",;|\t ") or text.startswith(COMMENTS):
            self.skipped.append(row.number)
        else:
            self.wrong.append((row.number, row.actual_columns, text))
        return "skip"


@dataclass(frozen=True)
class Sheet:
    """How a file is written, found from its beginning."""

    path: Path
    encoding: str
    separator: str
    decimal: str
    header: tuple[str, ...]
    header_line: int  # of the file, from 1

    def want(self, names: Sequence[str], purpose: str = "") -> None:
        """Raises LogError for a column that is not there."""
        missing = [name for name in names if name not in self.header]
        if not missing:
            return
        found = ", ".join(self.header[:20]) + (" ..." if len(self.header) > 20 else "")
        separated = ""
        if len(self.header) == 1:
            separated = (
                f"; the line has one column only: separate columns by {_or(SEPARATORS.values())}"
            )
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
        rows, parts, done = _Rows(), [], 0
        for batch in self._batches(list(names), rows):
            part = [column.to_numpy(zero_copy_only=False) for column in batch.columns]
            table = np.column_stack(part).astype(np.float64, copy=False)
            empty = self._empty(table, rows, done)
            table = table[~empty]
            self._finite(table, names, may_miss, rows, done)
            parts.append(table)
            done += len(table)
        table = np.concatenate(parts) if parts else np.zeros((0, len(names)))
        cut_off = self._check_rows(rows, done)
        columns = {name: np.ascontiguousarray(table[:, k]) for k, name in enumerate(names)}
        return Table(columns, self._lines(np.arange(done), rows), cut_off)

    def _batches(self, names: list[str], rows: _Rows) -> Iterator[pa.RecordBatch]:
        try:
            with self._open(names, rows, pa.float64()) as reader:
                yield from reader
        except pa.ArrowInvalid as error:
            if "straddling" in str(error):
                raise LogError(
                    f"{self.path}: a line of more than {BLOCK >> 20} MB; want one sample a line"
                ) from None
            raise LogError(self._no_number(names) or f"{self.path}: {error}") from None

    def _open(self, names: list[str], rows: _Rows, kind: pa.DataType) -> pa.csv.CSVStreamingReader:
        # names are ours: a column that stands twice, or has none, must not stop the reader
        unique = [f"{k}:{name}" for k, name in enumerate(self.header)]
        chosen = [unique[self.header.index(name)] for name in names]
        return pa.csv.open_csv(
            self.path,
            pa.csv.ReadOptions(
                use_threads=False,
                block_size=BLOCK,
                skip_rows=self.header_line,
                column_names=unique,
                encoding=self.encoding,
            ),
            pa.csv.ParseOptions(
                delimiter=self.separator,
                ignore_empty_lines=False,
                invalid_row_handler=rows.judge,
            ),
            pa.csv.ConvertOptions(
                column_types=dict.fromkeys(chosen, kind),
                include_columns=chosen,
                null_values=MISSING if kind == pa.float64() else [],
                decimal_point=self.decimal,
            ),
        )

    def _empty(self, table: Array, rows: _Rows, done: int) -> NDArray[np.bool_]:
        """Which rows are empty lines; they are noted as skipped."""
        empty = np.isnan(table).all(axis=1)
        if not empty.any():
            return empty
        lines = self._lines(np.arange(done, done + len(table)), rows)
        blank = self._blank_lines(set(lines[empty].tolist()))
        empty &= np.isin(lines, sorted(blank))
        rows.skipped += lines[empty].tolist()
        return empty

    def _blank_lines(self, candidates: set[int]) -> set[int]:
        nothing = ' \t\r\n"' + self.separator
        with self.path.open(encoding=self.encoding, errors="replace") as file:
            return {
                k for k, line in enumerate(file, 1) if k in candidates and not line.strip(nothing)
            }

    def _finite(
        self, table: Array, names: Sequence[str], may_miss: Sequence[str], rows: _Rows, done: int
    ) -> None:
        must = [k for k, name in enumerate(names) if name not in may_miss]
        bad = np.argwhere(~np.isfinite(table[:, must]))
        if len(bad):
            row, column = bad[0]
            line = int(self._lines(np.array([done + row]), rows)[0])
            name = names[must[column]]
            raise LogError(
                f"{self.path}:{line}: column {name!r}: {self._cell(line, name)!r} is no finite"
                " number; correct it, or leave the row out: it then counts as a missing sample"
            )

    def _check_rows(self, rows: _Rows, done: int) -> bool:
        """Raises LogError for a row of a wrong number of cells; True for a last line cut off."""
        last = done + len(rows.skipped) + len(rows.wrong)
        for number, cells, text in rows.wrong:
            if cells < len(self.header) and number - self._first == last - 1:
                if not self._ends_with_newline():
                    return True
            raise LogError(
                f"{self.path}:{number}: {cells} cells, the header names {len(self.header)}:"
                f" {text[:60]!r}; complete the row, or leave it out"
            )
        return False

    @property
    def _first(self) -> int:
        """Number that the parser gives to the first row below the header."""
        return self.header_line + 1

    def _lines(self, index: NDArray[np.int64], rows: _Rows) -> NDArray[np.int64]:
        """Lines of the file of rows that were kept, by their order."""
        lines = index + self._first
        for number in sorted([*rows.skipped, *(row[0] for row in rows.wrong)]):
            lines = np.where(lines >= number, lines + 1, lines)
        return lines

    def _ends_with_newline(self) -> bool:
        with self.path.open("rb") as file:
            file.seek(-min(4, self.path.stat().st_size), 2)
            return file.read().rstrip(b"\0").endswith((b"\n", b"\r"))

    def _text(self) -> Iterator[list[str]]:
        with self.path.open(encoding=self.encoding, errors="replace", newline="") as file:
            for line in file:
                yield next(csv.reader([line], delimiter=self.separator), [])

    def _cell(self, line: int, name: str) -> str:
        place = self.header.index(name)
        for number, cells in enumerate(self._text(), 1):
            if number == line:
                return cells[place].strip() if place < len(cells) else ""
        return ""

    def _no_number(self, names: list[str]) -> str:
        """The first cell that is no number, in words."""
        places = [(name, self.header.index(name)) for name in names]
        for number, cells in enumerate(self._text(), 1):
            if number <= self.header_line or not cells or cells[0].startswith(COMMENTS):
                continue
            for name, place in places:
                cell = cells[place].strip() if place < len(cells) else ""
                if cell and cell not in MISSING and not is_number(cell, self.decimal):
                    return (
                        f"{self.path}:{number}: column {name!r}: {cell!r} is no finite number"
                        f"{self._comma_hint(cell)}; correct it, or leave the row out"
                    )
        return ""

    def _comma_hint(self, cell: str) -> str:
        if self.decimal == "." and is_number(cell, ","):
            return " (a decimal comma wants another separator of columns: semicolon or tab)"
        return ""


def open_sheet(path: Path) -> Sheet:
    """Find encoding, separator, decimal sign and header. Raises LogError, OSError."""
    with path.open("rb") as file:
        data = file.read(FIRST_LOOK)
    encoding, text = decoded(path, data, len(data) == FIRST_LOOK)
    lines = text.splitlines()
    number = header_line(lines)
    if number == 0:
        raise LogError(f"{path}: empty; want a header line with the columns' names, and samples")
    line = lines[number - 1]
    separator = max(SEPARATORS, key=lambda s: count(line, s))
    names = next(csv.reader([line], delimiter=separator))
    header = tuple(name.strip().strip('"') for name in names)
    if all(is_number(name, ".") for name in header):
        raise LogError(
            f"{path}:{number}: numbers where the columns' names were expected ({line[:40]!r}); want"
            " a header line above the samples"
        )
    twice = [name for name in header if name and header.count(name) > 1]
    if twice:
        raise LogError(
            f"{path}:{number}: column {twice[0]!r} stands there twice; rename or remove one"
        )
    decimal = decimal_of(lines[number:], separator)
    return Sheet(path, encoding, separator, decimal, header, number)


def _or(names) -> str:
    *most, last = names
    return f"{', '.join(most)} or {last}"
