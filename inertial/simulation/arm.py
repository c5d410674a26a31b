"""A cube at the end of a turning arm, with a receiver beside it: a platform that turns fast enough
for it to see.

The arm is the table of table.py with the cube off its axis, so that the body's x is the way it goes
(positive turning) and its z is up.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from inertial.layouts.layout import Layout
from inertial.simulation.profiles import DEGREE, Profile, Ramp
from inertial.simulation.table import SensorModel, TableTest

Array = NDArray[np.float64]

LENGTH = 3.0  # m
SPEEDS: Sequence[tuple[float, float]] = (
    (100, 14),
    (70, 8),
    (130, 10),
    (90, 12),
    (120, 10),
)  # deg/s, s held


def _pieces(still: float) -> list[Ramp]:
    pieces, now = [Ramp(still, 0.0, 0.0)], 0.0
    for rate, hold in SPEEDS:
        pieces += [Ramp(4.0, now, rate * DEGREE), Ramp(hold, rate * DEGREE, rate * DEGREE)]
        now = rate * DEGREE
    return [*pieces, Ramp(5.0, now, 0.0), Ramp(3.0, 0.0, 0.0)]


ARM = Profile("arm", _pieces(still=14.0))
"""Still for alignment, then never again until the end: 90 s."""


def arm_test(
    seed: int,
    length: float = LENGTH,
    half_side: float = 0.05,
    sensor: SensorModel = SensorModel(),
    layout: Layout | None = None,
    run: int = 0,
) -> TableTest:
    """The arm of `length` m; other arguments as of TableTest. Raises ValueError for a length of no
    arm.
    """
    if not 0.5 <= length <= 20.0:
        raise ValueError(f"arm of {length:g} m, want 0.5 to 20 m")
    return TableTest(
        seed,
        half_side,
        ARM,
        tilt=0.0,
        sensor=sensor,
        centre_b=(0.0, -length, 0.0),
        layout=layout,
        run=run,
    )


def centre(test: TableTest, t_s: float) -> tuple[Array, Array]:
    """Where the body's centre really is against the axis, and its velocity: (3,) m and (3,) m/s, in
    n.
    """
    angle, rate, _ = (float(v[0]) for v in test.profile.motion(np.array([t_s])))
    x, y, z = test.centre_b
    c, s = math.cos(angle), math.sin(angle)
    # table frame: x north at angle 0, y west, z up
    p = np.array([c * x - s * y, -(s * x + c * y), -z])
    v = rate * np.array([-s * x - c * y, -(c * x - s * y), 0.0])
    return p, v
