"""The sheet of a batch of units, for a terminal, a spreadsheet and programs."""

import csv
import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rich.table import Table

from inertial.whole_file import whole
from messages.text import cell
from sessions.procedure.batch import COLUMNS, Cell, Unit, marked, remarks, unit_of
from sessions.report.verdict import load_spec

__all__ = ["as_json", "made", "remarks", "table", "write"]


def made(sessions: Sequence[tuple[str, Path]]) -> list[Unit]:
    """The rows of sessions, each a name and an MCAP file; raises ValueError, OSError."""
    spec = load_spec(None)
    return marked([unit_of(path, spec, name) for name, path in sessions])


def _filled(units: Sequence[Unit]) -> list[tuple[str, str, str]]:
    """Columns that some unit has a number in."""
    return [one for one in COLUMNS if any(u.cells[one[0]].value is not None for u in units)]


def table(units: Sequence[Unit]) -> Table:
    """For a terminal; an outlier has a mark."""
    columns = _filled(units)
    heads = [f"{title}, {unit}" for _, title, unit in columns]
    shown = Table("unit", "session", "verdict", *heads)
    for one in units:
        numbers = [_text(one.cells[key]) for key, *_ in columns]
        shown.add_row(one.unit or "–", one.session, one.verdict, *numbers)
    return shown


def _text(one: Cell) -> str:
    if one.value is None or not math.isfinite(one.value):
        return "–"
    known = one.sigma is not None and math.isfinite(one.sigma)
    spread = f" ± {2.0 * one.sigma:.2g}" if known and one.sigma is not None else ""
    return f"{one.value:.4g}{spread}{' !' if one.outlier else ''}"


def write(units: Sequence[Unit], path: Path) -> None:
    """As CSV, numbers and standard errors in columns of their own; raises OSError."""
    columns = _filled(units)
    names = [f"{key}{end}" for key, *_ in columns for end in ("", "_std_error", "_outlier")]
    with whole(path) as draft, draft.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["unit", "session", "procedure", "verdict", *names])
        for one in units:
            numbers: list[Any] = []
            for key, *_ in columns:
                found = one.cells[key]
                numbers += [found.value, found.sigma, int(found.outlier)]
            words = [cell(text) for text in (one.unit, one.session, one.procedure, one.verdict)]
            writer.writerow([*words, *("" if n is None else n for n in numbers)])


def as_json(units: Sequence[Unit]) -> dict[str, Any]:
    """For programs."""
    return {"units": [asdict(one) for one in units], "remarks": remarks(units)}
