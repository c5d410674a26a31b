"""What the movements of a guided detection say: the axis map of two turns, the third gyroscope, the
angle of each turn by both sensors. Pure functions of readings; E-79a and E-79b of
docs/equations-attitude.md.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inertial.attitude.axes import LEAST_SHIFT, Assignment, Unclear, movement
from inertial.attitude.axis_map import ABSENT, SI, AxisMap, Figures
from inertial.elementary import acos, cos, dot, norm

Array = NDArray[np.float64]

WINDOW_S = 0.5  # s, of the rest test, and of the rest at both ends of a movement
SENSITIVITY = 0.15  # of the turned angle: gyroscope against accelerometer
NOT_LEVEL = np.radians(20.0)  # of the first rest, as the map that was found sees it
ABOUT = "xyz"  # axes of b


@dataclass(frozen=True)
class BoardColumns:
    """The columns a board sends: their names, resolution, and how much they may move at rest."""

    source: str
    names: tuple[str, ...]
    quantum: Array  # (columns,) readings are judged in multiples of this
    rest: Array  # (columns,) largest standard deviation at rest
    figures: Figures = SI


@dataclass(frozen=True)
class Turn:
    """A movement that counts: about which axis of b, and its angle by both sensors, rad."""

    about: str
    by_force: float  # NaN about the vertical
    by_rate: float


class Tipped(NamedTuple):
    """The movement "nose up": what a turn about an edge does to forces and rates."""

    whole: Array  # (n, columns) in quanta, with the rests at both ends
    rows: Array  # the movement alone
    period: float  # s


def map_of(a: Assignment, board: BoardColumns, level: Array, used: Sequence[int]) -> AxisMap:
    """The map of two turns; level (columns,) are the readings at the first rest, used the columns
    that the assignment counts.
    """
    f = board.figures
    # y and z of the article's frame are the opposite of b's; its two rates are those about +y_b
    # and +x_b
    order = ((a.accel_x, 1), (a.accel_y, -1), (a.accel_z, -1), (a.gyro_yz, 1), (a.gyro_xz, 1))
    column = [used[one.channel] for one, _ in order]
    signs = [-article if one.invert else article for one, article in order]
    rest = level if board.source == "adc" else np.zeros(len(level))
    return AxisMap(
        board.source,
        board.names,
        (*column, ABSENT),
        (*signs, 1),
        (*[f.zero_force] * 3, *(float(rest[c]) for c in column[3:]), 0.0),
        (*[1.0 / f.force] * 3, *[1.0 / f.rate] * 3),
    )


def lies_level(m: AxisMap, level: Array) -> bool:
    """Whether the readings at the first rest (columns,) are those of a level board."""
    felt = m.apply(level[None])[0][0]
    return bool(-felt[2] >= cos(NOT_LEVEL) * norm(felt))


def with_third(
    m: AxisMap, board: BoardColumns, rows: Array, tipped: Tipped, level: Array, used: Sequence[int]
) -> AxisMap:
    """The map with the gyroscope about the vertical: of the inputs left over, the one that turned
    with the board on the table, rows (n, columns) in quanta. Raises Unclear.
    """
    seen = movement(rows, tipped.period)
    force, known = list(m.column[:3]), m.column[4]
    weight = np.abs(tipped.whole[-1] - tipped.whole[0])[force].max()
    if np.abs(seen.shift[force]).max() > LEAST_SHIFT * weight:
        raise Unclear("it tilted: keep it flat on the table while it turns")
    best = max((c for c in used if c not in m.column), key=lambda c: abs(seen.swing[c]))
    usual = abs(movement(tipped.rows, tipped.period).swing[known])
    if abs(seen.swing[best]) < 0.3 * usual:
        raise Unclear(
            "no further input turned with it: turn by a quarter, or save without a third gyroscope"
        )
    rest = float(level[best]) if board.source == "adc" else 0.0
    return AxisMap(
        m.source,
        m.inputs,
        (*m.column[:5], best),
        (*m.sign[:5], 1 if seen.swing[best] > 0.0 else -1),
        (*m.zero[:5], rest),
        m.scale,
    )


def compared(m: AxisMap, about: str, rows: Array, period: float) -> Turn:
    """The angle of a movement about an axis of b by both sensors; rows (n, columns) as sent."""
    f_b, omega_b = m.apply(rows)
    ends, axis = round(WINDOW_S / period), ABOUT.index(about)
    before, after = f_b[:ends].mean(axis=0), f_b[-ends:].mean(axis=0)
    by_force = float("nan")  # gravity does not see a turn about the vertical
    if about != "z":
        by_force = float(acos(dot(before, after) / (norm(before) * norm(after))))
    rate = omega_b[:, axis] - omega_b[:ends, axis].mean()
    return Turn(about, by_force, float(rate.sum() * period))


def remarks(turns: Sequence[Turn], m: AxisMap) -> str:
    """For people: what does not fit in what was found."""
    said = [
        f"about {turn.about} the gyroscope saw {np.degrees(turn.by_rate):.0f}°, the"
        f" accelerometer {np.degrees(turn.by_force):.0f}°: check the sensitivities"
        for turn in turns
        if abs(turn.by_rate - turn.by_force) > SENSITIVITY * turn.by_force  # not of NaN
    ]
    if m.mirrored:
        said.append(
            "the axes come out left-handed: one is really inverted, or a turn went the other"
            " way; start again if you are not sure"
        )
    return "; ".join(said) or "found"


def seen_end(rows: Array) -> Array:
    """Mean of the rest at the end of a movement."""
    return rows[-max(4, len(rows) // 20) :].mean(axis=0)
