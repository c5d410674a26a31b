"""A log in CSV becomes what its board would have sent.

Two forms, told apart by their header; columns may stand in any order, others are ignored, `#` lines
are comments:

    t_s, fx_mps2, fy_mps2, fz_mps2, wx_radps, wy_radps, wz_radps          a six-axis IMU in
    forward-right-down t_s, a11_counts, a12_counts, a13_counts, a21_counts ... a43_counts    the
    cube; optional tacho_rad_s

GNSS beside an IMU log (gnss.csv in the same folder) becomes UBX, NAV-PVT and NAV-HPPOSLLH per
epoch:

    t_s, lat_deg, lon_deg, height_m, quality, sd_n_m, sd_e_m, sd_u_m, vn_mps, ve_mps, vd_mps

height above the ellipsoid; quality as RTKLIB counts: 1 fixed, 2 float, 3 SBAS, 4 differential, 5
single, 0 none. t_s must rise. A log has no date: its t_s counts from LOG_EPOCH.
"""

import csv
import heapq
import logging
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from gateway.gnss.ubx import Epoch, ubx_bytes
from gateway.virtual.virtual_board import BoardAccel, BoardBytes, BoardImu, BoardPulse, Item

log = logging.getLogger(__name__)

LOG_EPOCH_S = 1704067200  # 2024-01-01T00:00:00Z, stands for the date that a log does not have
IMU = ("t_s", "fx_mps2", "fy_mps2", "fz_mps2", "wx_radps", "wy_radps", "wz_radps")
CUBE = ("t_s", *(f"a{sensor}{axis}_counts" for sensor in range(1, 5) for axis in range(1, 4)))
TACHO = "tacho_rad_s"
GNSS = (
    "t_s",
    "lat_deg",
    "lon_deg",
    "height_m",
    "quality",
    "sd_n_m",
    "sd_e_m",
    "sd_u_m",
    "vn_mps",
    "ve_mps",
    "vd_mps",
)


class PlayError(ValueError):
    """A log that cannot be played; names file, row and column, and says what was wanted."""


@dataclass(frozen=True)
class PlayLog:
    """A whole log in memory, checked."""

    path: Path
    kind: str  # "imu" or "cube"
    rows: list[tuple[float, ...]]
    gnss: list[tuple[float, ...]]
    period_s: float
    pulses_per_rev: int

    @property
    def duration_s(self) -> float:
        """From the first to the last sample, s."""
        return self.rows[-1][0] - self.rows[0][0]

    def items(self) -> Iterator[Item]:
        """What the board sees, in time order."""
        samples = self._imu_items() if self.kind == "imu" else self._cube_items()
        return heapq.merge(samples, self._gnss_items(), key=lambda item: item.t_s)

    def _imu_items(self) -> Iterator[Item]:
        for t_s, fx, fy, fz, wx, wy, wz in self.rows:
            yield BoardImu(t_s, (fx, fy, fz), (wx, wy, wz))

    def _cube_items(self) -> Iterator[Item]:
        pitch = 2.0 * math.pi / self.pulses_per_rev
        angle, before_s = 0.0, self.rows[0][0]
        for row in self.rows:
            t_s = row[0]
            if len(row) > len(CUBE):
                rate = row[-1]
                yield from table_pulses(angle, rate, before_s, t_s, pitch)
                angle, before_s = angle + rate * (t_s - before_s), t_s
            yield BoardAccel(t_s, tuple(int(count) for count in row[1 : len(CUBE)]))

    def _gnss_items(self) -> Iterator[Item]:
        start_s, end_s = self.rows[0][0], self.rows[-1][0]
        for t_s, lat, lon, height, quality, sd_n, sd_e, sd_u, vn, ve, vd in self.gnss:
            if start_s <= t_s <= end_s:
                epoch = Epoch(
                    LOG_EPOCH_S,
                    t_s,
                    lat,
                    lon,
                    height,
                    int(quality),
                    (sd_n, sd_e, sd_u),
                    (vn, ve, vd),
                )
                yield BoardBytes(t_s, ubx_bytes(epoch))


def table_pulses(
    angle: float, rate: float, t0_s: float, t1_s: float, pitch: float
) -> Iterator[BoardPulse]:
    """Pulses of a table turning by `rate` (rad/s) from t0_s to t1_s: one at each multiple of the
    pitch it crosses.
    """
    if rate == 0.0:
        return
    end = angle + rate * (t1_s - t0_s)
    low, high = sorted((angle, end))
    marks: Sequence[int] = range(math.floor(low / pitch) + 1, math.floor(high / pitch) + 1)
    direction = 1 if rate > 0 else -1
    for mark in marks if rate > 0 else reversed(marks):
        yield BoardPulse(t0_s + (mark * pitch - angle) / rate, direction)


def load(path: Path, gnss: Path | None = None, pulses_per_rev: int = 360) -> PlayLog:
    """Read and check a log: a CSV file or a folder with imu.csv. gnss: its epochs; default gnss.csv
    beside it, if any.

    Raises PlayError. A last line that was cut off while the log was written is left out with a
    warning.
    """
    path = Path(path)
    if path.is_dir():
        path = path / "imu.csv"
    header = _header(path)
    kind = "cube" if "a11_counts" in header else "imu"
    wanted = CUBE + ((TACHO,) if TACHO in header else ()) if kind == "cube" else IMU
    rows = _read(path, wanted)
    if len(rows) < 2:
        raise PlayError(f"{path}: {len(rows)} samples; want at least two")
    if gnss is None and kind == "imu" and (path.parent / "gnss.csv").is_file():
        gnss = path.parent / "gnss.csv"
    return PlayLog(
        path,
        kind,
        rows,
        _read(gnss, GNSS) if gnss else [],
        sample_period([r[0] for r in rows]),
        pulses_per_rev,
    )


def sample_period(times_s: list[float]) -> float:
    """Time between samples, s: the median over stretches of 100, so that neither gaps nor rounded
    stamps count.
    """
    step = max(1, min(100, len(times_s) // 10))
    spans = sorted(b - a for a, b in zip(times_s, times_s[step:], strict=False))
    return spans[len(spans) // 2] / step


def _open(path: Path):
    try:
        return path.open(encoding="utf-8", errors="replace", newline="")
    except OSError as error:
        raise PlayError(
            f"{path}: {error.strerror}; give a CSV file or a folder that holds imu.csv"
        ) from None


def _header(path: Path) -> list[str]:
    with _open(path) as file:
        for line in file:
            if not line.startswith("#"):
                return [name.strip() for name in line.split(",")]
    raise PlayError(f"{path}: empty; want a header line and samples")


def _read(path: Path, wanted: tuple[str, ...]) -> list[tuple[float, ...]]:
    header = _header(path)
    missing = [name for name in wanted if name not in header]
    if missing:
        raise PlayError(
            f"{path}:1: column {missing[0]!r} is missing, found {', '.join(header)}; want"
            f" {', '.join(wanted)}"
        )
    places = [header.index(name) for name in wanted]
    rows: list[tuple[float, ...]] = []
    with _open(path) as file:
        text = file.read()
    lines = text.splitlines()
    number = next(i for i, line in enumerate(lines) if not line.startswith("#")) + 1
    for cells in csv.reader(lines[number:]):
        number += 1
        if not cells or cells[0].startswith("#"):
            continue
        if len(cells) < len(header) and number == len(lines) and not text.endswith("\n"):
            log.warning(
                "%s:%d: the last line was cut off; the %d rows before it are played",
                path,
                number,
                len(rows),
            )
            break
        rows.append(_row(path, number, cells, wanted, places))
        if len(rows) > 1 and rows[-1][0] <= rows[-2][0]:
            raise PlayError(
                f"{path}:{number}: t_s {rows[-1][0]} does not rise from {rows[-2][0]}; sort the log"
                " by t_s"
            )
    return rows


def _row(
    path: Path, number: int, cells: list[str], wanted: tuple[str, ...], places: list[int]
) -> tuple[float, ...]:
    values = []
    for name, place in zip(wanted, places, strict=True):
        if place >= len(cells):
            raise PlayError(
                f"{path}:{number}: column {name!r} is missing, the row has {len(cells)} cells;"
                " complete it"
            )
        try:
            value = float(cells[place])
        except ValueError:
            raise PlayError(
                f"{path}:{number}: column {name!r}: {cells[place]!r} is no number"
            ) from None
        if not math.isfinite(value):
            raise PlayError(
                f"{path}:{number}: column {name!r}: {cells[place]!r}; want a finite number, or"
                " leave the row out"
            )
        if name.endswith("_counts") and not (value.is_integer() and -32768 <= value <= 32767):
            raise PlayError(
                f"{path}:{number}: column {name!r}: {cells[place]!r}; want a whole number of 16"
                " bits"
            )
        values.append(value)
    return tuple(values)
