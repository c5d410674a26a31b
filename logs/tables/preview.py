"""A foreign CSV before it is read: how it is written, its first rows, what its columns may be; and
the same numbers under the names that logs have.
"""

import csv
import re
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.csv

from logs.quantities import UNITS
from logs.sheet import LogError, open_sheet
from logs.sheet_form import COMMENTS, SEPARATORS, Lines, is_number, iso_time, printable

ROWS = 200  # looked at
AXIS = r"a[1-9]\d?[1-3]"
OF_UNITS = {
    "t": ("s", "ms", "us", "ns"),
    **dict.fromkeys(("fx", "fy", "fz"), ("mps2", "g", "mg")),
    **dict.fromkeys(("wx", "wy", "wz"), ("radps", "degps")),
    **dict.fromkeys(("lat", "lon"), ("deg", "rad")),
    **dict.fromkeys(("height", "sd_n", "sd_e", "sd_u"), ("m", "cm")),
    **dict.fromkeys(("vn", "ve", "vd"), ("mps", "kmph")),
}
PLAIN = ("quality", "tacho_rad_s")
TARGETS = (
    *(f"{quantity}_{unit}" for quantity, units in OF_UNITS.items() for unit in units),
    *PLAIN,
    *(f"a{s}{a}_counts" for s in range(1, 5) for a in range(1, 4)),
)
WORDS = (  # how others call a quantity; the first that fits
    (r"^(t|time|zeit|timestamp|elapsed)\b", "t"),
    (r"^(acc|accel|acceleration|a|f|beschl)[\w ]*?[ _.]?([xyz])\b", "f"),
    (r"^(gyro|gyr|g|omega|w|rate|angular)[\w ]*?[ _.]?([xyz])\b", "w"),
    (r"^lat", "lat"),
    (r"^(lon|lng|long)", "lon"),
    (r"^(height|alt|hoehe|höhe)", "height"),
    (r"^(quality|q|fix)\b", "quality"),
    (r"^(tacho|turntable)", "tacho_rad_s"),
)
UNIT_WORDS = (
    (r"m/s\^?[2²]|mps2|m s-2", "mps2"),
    (r"\bmg\b", "mg"),
    (r"deg/s|°/s|\bdps\b|degps", "degps"),
    (r"rad/s|radps", "radps"),
    (r"\bms\b|milli", "ms"),
    (r"[uµμ]s\b|micro", "us"),
    (r"\bns\b|nano", "ns"),
    (r"\bg\b", "g"),
    (r"km/h", "kmph"),
    (r"\bs\b|sec", "s"),
)


def look(path: Path) -> dict[str, Any]:
    """How a file is written, its first rows as they stand, and a guess at each column ("" for
    none). Raises LogError, OSError.
    """
    sheet = open_sheet(path)
    rows: list[list[str]] = []
    for number, line in enumerate(Lines(path, sheet.size, sheet.encoding), 1):
        if number <= sheet.head.above or not line.strip() or line.startswith(COMMENTS):
            continue
        rows.append(
            [printable(c.strip()) for c in next(csv.reader([line], delimiter=sheet.separator))]
        )
        if len(rows) >= ROWS:
            break
    columns = []
    for k, (name, written) in enumerate(zip(sheet.header, sheet.head.written, strict=True)):
        cells = [row[k] if k < len(row) else "" for row in rows]
        values = [
            _time(cell) if name in sheet.head.times else _value(cell, sheet.decimal)
            for cell in cells
        ]
        numeric = any(value is not None for value in values)
        columns.append(
            {
                "name": printable(written),
                "guess": guess(name) if numeric else "",
                "values": values if numeric else [],
            }
        )
    return {
        "encoding": sheet.encoding,
        "separator": SEPARATORS[sheet.separator],
        "decimal": "comma" if sheet.decimal == "," else "point",
        "header_line": sheet.header_line,
        "own": sheet.head.own,
        "rows": rows[:8],
        "columns": columns,
    }


def _time(cell: str) -> float | None:
    """A date and time of ISO 8601 in s since 1970; without its zone it is taken for UTC."""
    if not iso_time(cell):
        return None
    try:
        moment = datetime.fromisoformat(cell)
    except ValueError:
        return None
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()


def _value(cell: str, decimal: str) -> float | None:
    if not is_number(cell, decimal):
        return None
    value = float(cell.strip('"').replace(decimal, "."))
    return value if abs(value) < 1e300 else None


def guess(name: str) -> str:
    """What a column may be, as one of TARGETS; "" for no idea. A person decides."""
    low = name.strip().lower()
    stem, _, unit = low.rpartition("_")
    if low in TARGETS or (re.fullmatch(AXIS, stem) and unit in ("counts", "mps2", "g", "mg")):
        return low
    low = low.replace("_", " ")
    for pattern, quantity in WORDS:
        found = re.search(pattern, low)
        if found is None:
            continue
        if quantity in PLAIN:
            return quantity
        whole = quantity + (found[found.lastindex] if quantity in ("f", "w") else "")
        units = OF_UNITS.get(whole, ())
        said = next((u for words, u in UNIT_WORDS if u in units and re.search(words, low)), "")
        return f"{whole}_{said or units[0]}" if units else ""
    return ""


def rewritten(path: Path, columns: Mapping[str, str], out: Path) -> None:
    """The numbers of some columns (name in the file -> one of TARGETS), as CSV of the usual form.
    Raises LogError for a column that is missing, meant twice or no number, OSError.
    """
    chosen = {name: target for name, target in columns.items() if target}
    targets = list(chosen.values())
    for target in targets:
        stem, _, unit = target.rpartition("_")
        if target not in TARGETS and not (re.fullmatch(AXIS, stem) and unit in (*UNITS, "counts")):
            raise LogError(f"column meant as {target[:40]!r}: want one of those offered")
        if targets.count(target) > 1:
            raise LogError(f"two columns are meant as {target}: want each once")
    sheet = open_sheet(path)
    by_name = {printable(w): n for w, n in zip(sheet.head.written, sheet.header, strict=True)}
    wanted = [by_name.get(name, name) for name in chosen]
    table = sheet.read(wanted, [n for n, t in zip(wanted, targets, strict=True) if t[0] in "lhqsv"])
    found = pa.table(
        {
            target: pa.array(table[name], from_pandas=True)
            for name, target in zip(wanted, targets, strict=True)
        }
    )
    pa.csv.write_csv(found, out, pa.csv.WriteOptions(quoting_style="none"))
