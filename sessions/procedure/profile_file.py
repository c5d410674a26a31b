"""A table's motion from a file: points of a rate over time in CSV, or pieces in TOML.

CSV: columns t_s and rate_dps; between two points the rate goes by a smooth cubic. TOML:

    [[pieces]]
    seconds = 5.0
    from_dps = 0.0     # where the piece before ended, unless it is said
    to_dps = 100.0     # the same as from_dps for a plateau

Either begins and ends at rest, so that it can be repeated.
"""

import csv
import io
import math
import tomllib
from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from inertial.simulation.profiles import DEGREE, Profile, Ramp, named
from inertial.toml_file import parsed, text_of

FASTEST = 2000.0  # °/s: +-16 g of an axis 10 cm from the centre
SHORTEST = 0.01  # s
MOST = 10_000  # pieces
COLUMNS = ("t_s", "rate_dps")


class _Piece(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    seconds: float = Field(ge=SHORTEST, le=1e6)
    from_dps: float | None = Field(default=None, ge=-FASTEST, le=FASTEST)
    to_dps: float = Field(ge=-FASTEST, le=FASTEST)


class _File(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)

    name: str = ""
    pieces: list[_Piece] = Field(min_length=1, max_length=MOST)


def profile_of(name: str) -> Profile:
    """The profile of a name, or of a file .csv or .toml; raises ValueError, OSError."""
    kind = Path(name).suffix.lower()
    if kind == ".csv":
        return _of_csv(Path(name))
    return _of_toml(Path(name)) if kind == ".toml" else named(name)


def _of_csv(path: Path) -> Profile:
    rows = list(csv.reader(io.StringIO(text_of(path))))
    rows = [row for row in rows if row and not row[0].lstrip().startswith("#")]
    head = [cell.strip() for cell in rows[0]] if rows else []
    missing = [name for name in COLUMNS if name not in head]
    if missing:
        raise ValueError(f"{path}: no column {missing[0]!r} in {head}; want {', '.join(COLUMNS)}")
    at = [head.index(name) for name in COLUMNS]
    points = []
    for number, row in enumerate(rows[1:], 2):
        try:
            t, rate = (float(row[k]) for k in at)
        except (ValueError, IndexError):
            raise ValueError(f"{path}: row {number}: {row}: want two numbers") from None
        if not (math.isfinite(t) and abs(rate) <= FASTEST):
            raise ValueError(f"{path}: row {number}: want at most {FASTEST:g} °/s, all finite")
        if points and t - points[-1][0] < SHORTEST:
            before = points[-1][0]
            raise ValueError(f"{path}: row {number}: t_s = {t:g} after {before:g}: want it later")
        points.append((t, rate))
    if not 2 <= len(points) <= MOST:
        raise ValueError(f"{path}: {len(points)} rows; want 2 to {MOST}")
    ends = zip(points, points[1:], strict=False)
    return _made(path, path.stem, [(b[0] - a[0], a[1], b[1]) for a, b in ends])


def _of_toml(path: Path) -> Profile:
    try:
        file = _File.model_validate(parsed(text_of(path)))
    except tomllib.TOMLDecodeError as error:
        raise ValueError(f"{path}: not TOML: {error}") from None
    except ValidationError as error:
        first = error.errors()[0]
        raise ValueError(f"{path}: {'.'.join(map(str, first['loc']))}: {first['msg']}") from None
    pieces, rate = [], 0.0
    for piece in file.pieces:
        begin = rate if piece.from_dps is None else piece.from_dps
        pieces.append((piece.seconds, begin, piece.to_dps))
        rate = piece.to_dps
    return _made(path, file.name or path.stem, pieces)


def _made(path: Path, name: str, pieces: list[tuple[float, float, float]]) -> Profile:
    """A profile of (seconds, from, to in °/s); raises ValueError for a jump."""
    rate = 0.0
    for number, (_, begin, end) in enumerate(pieces, 1):
        if abs(begin - rate) > 1e-9:
            raise ValueError(
                f"{path}: piece {number} begins at {begin:g} °/s and the one before ends at"
                f" {rate:g}: the rate cannot jump"
            )
        rate = end
    if abs(rate) > 1e-9:
        raise ValueError(f"{path}: ends at {rate:g} °/s; want 0, so that it can be repeated")
    return Profile(name, [Ramp(s, a * DEGREE, b * DEGREE) for s, a, b in pieces])
