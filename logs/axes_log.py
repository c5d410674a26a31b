"""A guided detection of axes and signs from a log on disk: the same session as live, over the rows
of a CSV.
"""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from inertial.attitude.axis_map import IMU, SI, AxisMap, Figures
from inertial.attitude.wiring import (
    FORCE_REST,
    RATE_REST,
    VOLT_REST,
    BoardColumns,
    GuidedWiring,
    Turn,
)
from inertial.constants import GRAVITY
from logs.attitude_log import SAMPLES, LogError

Array = NDArray[np.float64]

INPUT = re.compile(r"in(\d+)_(counts|v)")
ACC_GYRO = Figures(
    1.65, 0.4785 / GRAVITY, 1.23, float(np.degrees(0.002))
)  # LIS331AL and LPR550AL: data sheets
VOLT_PER_COUNT = 3.3 / 4095
WANTED = (
    f"{', '.join(SAMPLES)}; or t_s with in0_counts, in1_counts ... (or in0_v ...) of a converter"
)


@dataclass(frozen=True)
class Found:
    """What a log told: the map, None where it is not whole, and what was said at each movement."""

    map: AxisMap | None
    turns: list[Turn]
    said: list[tuple[float, str]]  # s since the log's start, what came of a movement
    instruction: str  # what was waited for when the log ended


def detect(log: Path, figures: Figures = ACC_GYRO, volt_per_count: float = VOLT_PER_COUNT) -> Found:
    """Run a guided detection over a log of the movements in their order; figures and
    volt_per_count: of a converter.

    Raises LogError with the file and what it lacks.
    """
    t, columns, values = _read(log)
    period = float(np.median(np.diff(t)))
    session = GuidedWiring(_board(columns, figures, volt_per_count))
    scale = np.array([volt_per_count if name.endswith("_counts") else 1.0 for name in columns])
    said: list[tuple[float, str]] = []
    for k in range(len(t)):
        if k and t[k] - t[k - 1] > 1.5 * period:
            session.gap()
        session.feed(period, values[k : k + 1] * scale)
        if session.message and (not said or said[-1][1] != session.message):
            said.append((float(t[k] - t[0]), session.message))
    whole = session.map if session.complete else None
    return Found(whole, session.turns, said, session.instruction)


def _read(log: Path) -> tuple[Array, tuple[str, ...], Array]:
    if not log.is_file():
        raise LogError(f"{log}: no such file")
    with log.open(encoding="utf-8") as lines:
        names = next((line for line in lines if not line.startswith("#")), "").strip().split(",")
        inputs = tuple(
            sorted(
                (n for n in names if INPUT.fullmatch(n)), key=lambda n: int(INPUT.fullmatch(n)[1])
            )
        )
        columns = SAMPLES[1:] if set(SAMPLES) <= set(names) else inputs
        if "t_s" not in names or len(columns) < 5:
            raise LogError(
                f"{log}: columns {', '.join(names)[:80]!r}; want {WANTED}, at least five"
            )
        try:
            table = np.loadtxt(lines, delimiter=",", ndmin=2)
        except ValueError as error:
            raise LogError(f"{log}: {error}") from None
    if table.shape[1:] != (len(names),) or len(table) < 2:
        raise LogError(f"{log}: {len(table)} rows of samples, want at least some seconds of them")
    t, values = table[:, names.index("t_s")], table[:, [names.index(name) for name in columns]]
    if not np.isfinite(values).all() or not (np.diff(t) > 0.0).all():
        bad = ~np.isfinite(values).all(axis=1) | np.r_[False, ~(np.diff(t) > 0.0)]
        raise LogError(
            f"{log}: row {int(np.argmax(bad)) + 1}: not a number, or a time that does not grow"
        )
    return t, columns, values


def _board(columns: tuple[str, ...], figures: Figures, volt_per_count: float) -> BoardColumns:
    if columns == SAMPLES[1:]:
        return BoardColumns(
            "imu",
            IMU,
            np.array([0.01] * 3 + [0.001] * 3),
            np.array([FORCE_REST] * 3 + [RATE_REST] * 3),
            SI,
        )
    names = tuple(f"input {INPUT.fullmatch(name)[1]}" for name in columns)
    return BoardColumns(
        "adc", names, np.full(len(names), volt_per_count), np.full(len(names), VOLT_REST), figures
    )
