"""Which input of an analogue board is which axis, and with which sign: found from three movements
by hand.

Section 3 of tilt-filter: lay the board level; turn it about y by about a quarter so that x rises;
the same about x so that y rises. An accelerometer's output stays where the turn has brought it, a
gyro's moves only during the turn, and its integral must have the sign of the angle. Equation E-79a
of docs/equations-attitude.md.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

STEADY_S = 0.4  # s of rest at both ends of a movement
LEAST_SHIFT = 0.35  # of the largest shift of any input: an accelerometer that took part in the turn
DISTINCT = 1.5  # the winner's lead over the second


class Unclear(ValueError):
    """A movement that does not tell the inputs apart: what was seen, and what to do again."""


@dataclass(frozen=True)
class Input:
    """One input of the converter and the sense in which it counts."""

    channel: int
    invert: bool


@dataclass(frozen=True)
class Assignment:
    """Inputs of the article's axes: accelerometer x, y, z and the rates of the angles in the xz and
    yz planes.
    """

    accel_x: Input
    accel_y: Input
    accel_z: Input
    gyro_xz: Input
    gyro_yz: Input

    def toml(self) -> str:
        """As [gateway.devices.analogue] of gyrofree.toml wants it."""
        lines = []
        for name in ("accel_x", "accel_y", "accel_z", "gyro_xz", "gyro_yz"):
            found = getattr(self, name)
            lines.append(
                f"{name} = {{ channel = {found.channel}, invert = {str(found.invert).lower()} }}"
            )
        return "\n".join(lines)


@dataclass(frozen=True)
class Movement:
    """What every input did: its rest before and after, and the integral of its departure from a
    straight line.
    """

    shift: Array  # (channels,) counts, rest after minus rest before
    swing: (
        Array  # (channels,) counts s, integral of the reading minus the rest before, over the turn
    )
    noise: Array  # (channels,) counts, standard deviation at rest


def movement(counts: Array, period_s: float) -> Movement:
    """Judge one recorded movement, (n, channels) counts, that begins and ends at rest.

    Raises Unclear when it is too short or not at rest at its ends.
    """
    m = round(STEADY_S / period_s)
    if len(counts) < 4 * m:
        raise Unclear(
            f"{len(counts) * period_s:.1f} s recorded, want at least {4 * STEADY_S:.1f} s, at rest"
            " at both ends"
        )
    before, after = counts[:m], counts[-m:]
    noise = np.maximum(np.minimum(before.std(axis=0), after.std(axis=0)), 0.5)
    shift = after.mean(axis=0) - before.mean(axis=0)
    restless = np.maximum(before.std(axis=0), after.std(axis=0)) > 10.0 * noise + 0.05 * np.ptp(
        counts, axis=0
    )
    if restless.any():
        raise Unclear(
            f"input {int(np.argmax(restless))} moved at the ends: hold the board still before and"
            " after"
        )
    return Movement(shift, (counts - before.mean(axis=0)).sum(axis=0) * period_s, noise)


def assign(turn_y: Array, turn_x: Array, period_s: float) -> Assignment:
    """Find the five inputs from the turn about y (x rises) and the turn about x (y rises), both
    from level.

    Both are (n, channels) counts at period_s. Raises Unclear with the movement to be repeated.
    """
    about_y, about_x = movement(turn_y, period_s), movement(turn_x, period_s)
    accel = _shifted(about_y, "about y") | _shifted(about_x, "about x")
    gyros = [c for c in range(turn_y.shape[1]) if c not in accel]
    if len(accel) != 3:
        raise Unclear(
            f"inputs {sorted(accel)} changed with the tilt, want three: turn by about a quarter"
            " each time"
        )
    if len(gyros) < 2:
        raise Unclear(
            f"{turn_y.shape[1]} inputs, want at least five: three of the accelerometer, two of the"
            " gyro"
        )
    # z loses in both turns; x rises in the first only, y in the second only
    z = max(accel, key=lambda c: min(abs(about_y.shift[c]), abs(about_x.shift[c])))
    x = max(accel - {z}, key=lambda c: abs(about_y.shift[c]) - abs(about_x.shift[c]))
    (y,) = accel - {z, x}
    alike_y = abs(about_y.shift[x]) < DISTINCT * abs(about_y.shift[y])
    alike_x = abs(about_x.shift[y]) < DISTINCT * abs(about_x.shift[x])
    if alike_y or alike_x:
        raise Unclear(
            "both turns moved the same input: turn about y first, then, from level again, about x"
        )
    xz, yz = _gyro(about_y, gyros, "about y"), _gyro(about_x, gyros, "about x")
    if xz == yz:
        raise Unclear(f"input {xz} moved in both turns: turn about one edge of the board at a time")
    return Assignment(
        Input(x, bool(about_y.shift[x] < 0.0)),
        Input(y, bool(about_x.shift[y] < 0.0)),
        Input(z, bool(about_y.shift[z] > 0.0)),  # z reads +1 g when level, so it must fall
        Input(xz, bool(about_y.swing[xz] < 0.0)),
        Input(yz, bool(about_x.swing[yz] < 0.0)),
    )


def _shifted(m: Movement, which: str) -> set[int]:
    size = np.abs(m.shift)
    if size.max() < 20.0 * m.noise[int(size.argmax())]:
        raise Unclear(
            f"no input changed in the turn {which}: turn the board by about a quarter and hold it"
            " there"
        )
    return {int(c) for c in np.flatnonzero(size > LEAST_SHIFT * size.max())}


def _gyro(m: Movement, gyros: list[int], which: str) -> int:
    order = sorted(gyros, key=lambda c: -abs(m.swing[c]))
    best, second = abs(m.swing[order[0]]), abs(m.swing[order[1]])
    if best < DISTINCT * second:
        raise Unclear(
            f"inputs {order[0]} and {order[1]} moved alike in the turn {which}: turn about one edge"
            " only"
        )
    return order[0]
