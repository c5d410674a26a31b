"""Boards whose axes are all good, under everything that a laboratory adds and with calibrations
that are worse than expected: what an axis monitor must leave alone.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inertial.layouts.catalogue import CUBE
from inertial.layouts.layout import Layout
from inertial.rate.health import HealthMonitor
from inertial.simulation.disturbed import CONDITIONS, record
from inertial.simulation.imperfect import Imperfections, device, table_run
from inertial.simulation.table import SensorModel

Array = NDArray[np.float64]
DEGREE = np.pi / 180.0


class Readings(NamedTuple):
    """What arrived, arrays over samples (n)."""

    index: NDArray[np.int64]
    t_s: Array
    f_axis: Array  # (n, N) m/s^2


def _disturbed(**options) -> Callable[[str, int], Readings]:
    def made(profile: str, seed: int) -> Readings:
        one = record(seed, profile, **options)
        return Readings(one.index, one.t_s, one.readings)

    return made


def _imperfect(off: Imperfections) -> Callable[[str, int], Readings]:
    def made(profile: str, seed: int) -> Readings:
        run = table_run(device(CUBE(0.05), seed, off), profile=profile, seed=10 * seed + 9)
        return Readings(np.arange(len(run.t_s)), run.t_s, run.readings)

    return made


BOARDS = {name: _disturbed(**options) for name, options in CONDITIONS.items()} | {
    "scale 5 %": _disturbed(sensor=SensorModel(scale_error=0.05)),
    "imperfect device": _imperfect(Imperfections()),
    "misalignment 3 deg": _imperfect(
        Imperfections(scale=0.005, misalignment=3.0 * DEGREE, position=0.0)
    ),
}
"""Readings of a cube on a table by profile and seed."""


def watch(readings: Readings, layout: Layout | None = None) -> tuple[HealthMonitor, set[int]]:
    """The monitor after these readings, and every axis that it ever left out."""
    monitor, out = HealthMonitor(layout or CUBE(0.05)), 0
    holes = np.nonzero(np.diff(readings.index) > 1)[0] + 1
    for part in np.split(np.arange(len(readings.t_s)), holes):
        if part[0]:
            monitor.skip(int(readings.index[part[0]] - readings.index[part[0] - 1]) - 1)
        for _, mask, _ in monitor.feed(readings.t_s[part], readings.f_axis[part]):
            out |= mask
    return monitor, {k for k in range(monitor.layout.axes) if out >> k & 1}
