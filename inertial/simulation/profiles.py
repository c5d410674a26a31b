"""Turning of a table about its axis as an analytic function of time: angle, rate, angular
acceleration.

A profile is a row of pieces; rate and angular acceleration are continuous where pieces meet. It
starts and ends at rest, so it can be repeated without a jump. SI: s, rad, rad/s, rad/s^2; positive
about z_b (up).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

DEGREE = np.pi / 180.0  # rad


@dataclass(frozen=True)
class Ramp:
    """Rate from start to end by the cubic 3 x^2 - 2 x^3; a plateau or standstill when they are
    equal.
    """

    seconds: float
    start: float  # rad/s
    end: float  # rad/s

    def motion(self, t: Array) -> tuple[Array, Array, Array]:
        """Angle since the piece began, rate and angular acceleration at times t of the piece."""
        x, step = t / self.seconds, self.end - self.start
        angle = self.start * t + step * self.seconds * (x**3 - 0.5 * x**4)
        rate = self.start + step * (3.0 * x**2 - 2.0 * x**3)
        return angle, rate, step / self.seconds * 6.0 * x * (1.0 - x)


@dataclass(frozen=True)
class Swing:
    """Rate mean - amplitude cos(2 pi cycles t / seconds): begins and ends at mean - amplitude."""

    seconds: float
    mean: float  # rad/s
    amplitude: float  # rad/s
    cycles: int

    def motion(self, t: Array) -> tuple[Array, Array, Array]:
        """Angle since the piece began, rate and angular acceleration at times t of the piece."""
        w = 2.0 * np.pi * self.cycles / self.seconds
        angle = self.mean * t - self.amplitude / w * np.sin(w * t)
        return angle, self.mean - self.amplitude * np.cos(w * t), self.amplitude * w * np.sin(w * t)


@dataclass(frozen=True)
class Profile:
    """Pieces in a row, repeated for ever; the angle goes on from one turn of the profile to the
    next.
    """

    name: str
    pieces: Sequence[Ramp | Swing]
    begin: Array = field(init=False, repr=False)  # s, start of every piece
    angle: Array = field(init=False, repr=False)  # rad, angle at every start

    def __post_init__(self) -> None:
        lengths = np.array([piece.seconds for piece in self.pieces])
        turned = [float(piece.motion(np.array([piece.seconds]))[0][0]) for piece in self.pieces]
        object.__setattr__(self, "begin", np.concatenate([[0.0], np.cumsum(lengths)]))
        object.__setattr__(self, "angle", np.concatenate([[0.0], np.cumsum(turned)]))

    @property
    def seconds(self) -> float:
        """Length of one turn of the profile, s."""
        return float(self.begin[-1])

    @property
    def max_rate(self) -> float:
        """Largest |rate|, rad/s."""
        return float(np.abs(self.motion(np.linspace(0.0, self.seconds, 4001))[1]).max())

    def motion(self, t: Array) -> tuple[Array, Array, Array]:
        """Angle (rad, since t = 0), rate (rad/s) and angular acceleration (rad/s^2) at times t >=
        0, s.
        """
        turns = np.floor(t / self.seconds)
        local = t - turns * self.seconds
        which = np.clip(
            np.searchsorted(self.begin, local, side="right") - 1, 0, len(self.pieces) - 1
        )
        angle, rate, acceleration = np.empty_like(t), np.empty_like(t), np.empty_like(t)
        for k in np.unique(which):
            at = which == k
            angle[at], rate[at], acceleration[at] = self.pieces[k].motion(local[at] - self.begin[k])
            angle[at] += self.angle[k]
        return angle + turns * self.angle[-1], rate, acceleration


def _rest(seconds: float) -> Ramp:
    return Ramp(seconds, 0.0, 0.0)


def _turn(rate: float, up: float, hold: float, down: float) -> list[Ramp]:
    return [Ramp(up, 0.0, rate), Ramp(hold, rate, rate), Ramp(down, rate, 0.0)]


PLATEAU = 171.0 * DEGREE  # rad/s, the published test
LOW, HIGH = 29.0 * DEGREE, 201.0 * DEGREE  # rad/s, ends of the wobble 115 +- 86 deg/s

PROFILES: dict[str, Profile] = {
    profile.name: profile
    for profile in (
        # still 5 s, clockwise (negative about z_b, seen from above), still, counter-clockwise,
        # still: 30 s
        Profile(
            "published",
            [_rest(5), *_turn(-PLATEAU, 1, 8, 1), _rest(3), *_turn(PLATEAU, 1, 8, 1), _rest(2)],
        ),
        Profile(
            "wobble",
            [
                _rest(5),
                Ramp(1, 0, LOW),
                Swing(21, (LOW + HIGH) / 2, (HIGH - LOW) / 2, 7),
                Ramp(1, LOW, 0),
                _rest(2),
            ],
        ),
        Profile("fast", [_rest(5), *_turn(684.0 * DEGREE, 10, 5, 7), _rest(3)]),
        Profile("still", [_rest(30)]),
        # through zero without a stop, three times
        Profile(
            "reversals",
            [
                _rest(5),
                Ramp(1, 0, PLATEAU),
                Ramp(3, PLATEAU, PLATEAU),
                Ramp(2, PLATEAU, -PLATEAU),
                Ramp(4, -PLATEAU, -PLATEAU),
                Ramp(2, -PLATEAU, PLATEAU),
                Ramp(4, PLATEAU, PLATEAU),
                Ramp(3, PLATEAU, -PLATEAU / 2),
                Ramp(3, -PLATEAU / 2, -PLATEAU / 2),
                Ramp(1, -PLATEAU / 2, 0),
                _rest(2),
            ],
        ),
        # where products say little: 10, 20, 30 deg/s with stops between
        Profile(
            "slow",
            [
                _rest(5),
                *_turn(10 * DEGREE, 1, 5, 1),
                _rest(2),
                *_turn(-20 * DEGREE, 1, 5, 1),
                _rest(2),
                *_turn(30 * DEGREE, 1, 4, 1),
                _rest(1),
            ],
        ),
    )
}

ALIASES = {"cw-ccw": "published"}  # clockwise, then counter-clockwise


def named(name: str) -> Profile:
    """Profile of a name or of its other name; raises ValueError with the known ones."""
    known = PROFILES | {TURNING.name: TURNING}
    profile = known.get(ALIASES.get(name, name))
    if profile is None:
        raise ValueError(f"no profile {name!r}; want one of {', '.join([*known, *ALIASES])}")
    return profile


# Begins and ends at full speed; for a body that is switched on while it turns. Not in the table:
# not at rest at 0 s.
TURNING = Profile(
    "turning",
    [
        Ramp(8, PLATEAU, PLATEAU),
        Ramp(2, PLATEAU, PLATEAU / 2),
        Ramp(6, PLATEAU / 2, PLATEAU / 2),
        Ramp(2, PLATEAU / 2, 0),
        _rest(3),
        Ramp(2, 0, PLATEAU),
        Ramp(7, PLATEAU, PLATEAU),
    ],
)
