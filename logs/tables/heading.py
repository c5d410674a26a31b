"""What columns are called: a header in other letters, with blanks, with its units in brackets or in
a row below it, means the names that logs have, where it can mean nothing else.

    T_S, "t s", "Time (s)", "time [ms]", "FX [m/s²]", "Latitude (deg)", "t" above "s"
"""

import csv
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from logs.sheet_form import COMMENTS, OWN, OWN_NAMES, iso_time

UNITS_WRITTEN = {  # as people write them -> as names of columns have them
    **dict.fromkeys(("s", "sec", "secs", "second", "seconds"), "s"),
    **dict.fromkeys(("ms", "msec", "millisecond", "milliseconds"), "ms"),
    **dict.fromkeys(("us", "\u00b5s", "\u03bcs", "usec", "microseconds"), "us"),
    **dict.fromkeys(("ns", "nanoseconds"), "ns"),
    **dict.fromkeys(("m/s2", "m/s^2", "m/s\u00b2", "m/s/s", "mps2", "m s-2", "m*s^-2"), "mps2"),
    **dict.fromkeys(("g", "mg", "m", "cm", "counts", "rad", "radps", "degps", "mps", "kmph"), ""),
    **dict.fromkeys(("lsb", "count"), "counts"),
    **dict.fromkeys(("rad/s", "rad s-1"), "radps"),
    **dict.fromkeys(("deg/s", "\u00b0/s", "dps"), "degps"),
    **dict.fromkeys(("deg", "\u00b0", "degree", "degrees"), "deg"),
    **dict.fromkeys(("m/s", "m s-1"), "mps"),
    **dict.fromkeys(("km/h", "kph"), "kmph"),
}
OTHER_UNITS = ("-", "1", "", "v", "bar", "\u00b0c", "degc", "k", "pa", "hpa", "ut", "hz", "%")
STEMS = {"time": "t", "timestamp": "t", "zeit": "t", "latitude": "lat", "longitude": "lon"}
OURS = re.compile(
    r"(t_(s|ms|us|ns)|f[xyz]_(mps2|g|mg)|w[xyz]_(radps|degps)|(lat|lon)_(deg|rad)"
    r"|(height|sd_[neu])_(m|cm)|v[ned]_(mps|kmph)|quality|tacho_rad_s|in\d{1,2}"
    r"|a[1-9]\d?[1-3]_(counts|mps2|g|mg)|true_(w[xyz]|q[wxyz]))"
)
BRACKETS = re.compile(r"(.*?)\s*[\[(]\s*([^\])]*?)\s*[\])]")
UNIT_OF_NAME = re.compile(r"_(s|ms|us|ns|mps2|g|mg|radps|degps|deg|rad|m|cm|mps|kmph|counts)$")


DATED = ("t", "time", "timestamp", "zeit", "date", "datetime", "utc")  # names of a date and time


@dataclass(frozen=True)
class Heading:
    """What stands above the samples of a file."""

    names: tuple[str, ...]  # of the columns, as logs have them
    written: tuple[str, ...]  # as they stand in the file
    above: int  # the last line above the samples: the header, or the row of units below it
    times: Mapping[str, str]  # columns of dates and times, and how these are written: iso_time
    own: bool  # an export of ours
    contradicted: tuple[str, str] | None  # a column of another unit than the row of units says


def heading(lines: Sequence[str], number: int, separator: str) -> Heading:
    """Of the first lines of a file, whose header is line `number`, from 1."""
    below = [
        (k, cells_of(line, separator))
        for k, line in enumerate(lines[number : number + 200], number + 1)
        if line.strip() and not line.startswith(COMMENTS)
    ]
    first = below[0][1] if below else ()
    written = _as_wide(cells_of(lines[number - 1], separator), first)
    own = set(OWN) <= set(written)
    units = first if row_of_units(first) else ()
    names = named([OWN_NAMES.get(name, name) if own else name for name in written], units)
    if units:
        first = below[1][1] if len(below) > 1 else ()
    dated = {k: kind for k, cell in enumerate(first[: len(names)]) if (kind := iso_time(cell))}
    if "t_s" not in names:  # a date needs no unit
        bare = next((k for k in dated if names[k].lower() in DATED), None)
        names = tuple("t_s" if k == bare else name for k, name in enumerate(names))
    return Heading(
        names,
        written,
        below[0][0] if units else number,
        {names[k]: kind for k, kind in dated.items()},
        own,
        against_units(names, units),
    )


def cells_of(line: str, separator: str) -> tuple[str, ...]:
    """Cells of a line without blanks and quotes around them."""
    cells = next(csv.reader([line], delimiter=separator), [])
    return tuple(cell.strip().strip('"') for cell in cells)


def _as_wide(header: tuple[str, ...], first: Sequence[str]) -> tuple[str, ...]:
    """The header with as many columns as the rows have, where only one of both ends in a
    separator.
    """
    if len(first) == len(header) + 1 and not first[-1]:
        return (*header, "")
    if len(first) == len(header) - 1 and not header[-1]:
        return header[:-1]
    return header


def unit_of(cell: str) -> str | None:
    """A unit as names of columns have it; "" for one that no log of ours has, None for none."""
    text = " ".join(cell.strip().strip('"').strip("[]()").lower().split())
    if text in UNITS_WRITTEN:
        return UNITS_WRITTEN[text] or text
    return "" if text in OTHER_UNITS else None


def row_of_units(cells: Sequence[str]) -> bool:
    """Whether a row below the header has units, and nothing else."""
    found = [unit_of(cell) for cell in cells]
    return None not in found and any(found)


def named(written: Sequence[str], units: Sequence[str] = ()) -> tuple[str, ...]:
    """Names of columns as logs have them; one that can mean something else stays as it is, and so
    does one whose proper name stands there already.
    """
    units = [*units, *[""] * len(written)]
    taken, out = set(written), list(written)
    for k, (name, unit) in enumerate(zip(written, units, strict=False)):
        meant = _meant(name, unit_of(unit) or "")
        if meant not in taken:
            out[k] = meant
            taken.add(meant)
    return tuple(out)


def against_units(header: Sequence[str], units: Sequence[str]) -> tuple[str, str] | None:
    """A column whose name has another unit than the row of units says, and that; None for none."""
    for name, cell in zip(header, units, strict=False):
        told, own = unit_of(cell), UNIT_OF_NAME.search(name)
        if told and own and told != own[1] and OURS.fullmatch(name):
            return name, cell.strip()
    return None


def _meant(name: str, unit: str) -> str:
    """The log's name of a column with a unit from elsewhere, or the name itself."""
    low = name.strip().lower()
    bracketed = BRACKETS.fullmatch(low)
    if bracketed:
        low, unit = bracketed[1], unit_of(bracketed[2]) or ""
        if not unit:
            return name
    stem = re.sub(r"[\s.\-]+", "_", low).strip("_")
    first, _, rest = stem.partition("_")
    stem = "_".join(part for part in (STEMS.get(first, first), rest) if part)
    for meant in (stem, f"{stem}_{unit}" if unit else stem):
        if OURS.fullmatch(meant):
            return meant
    return name
