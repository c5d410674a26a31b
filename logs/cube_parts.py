"""A log cut where its samples cannot be taken as one batch: at holes, at a change of the axes that
are believed, at reports of the tachometer. The same axis monitor as on the live path says which
axes are believed, so that a log gives the same answer whichever way it goes.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from inertial.layouts.layout import Layout
from inertial.rate.axis_fault import Fault
from inertial.rate.health import HealthMonitor
from logs.cube_log import CubeLog

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Part:
    """Rows begin .. end - 1 of a log."""

    begin: int
    end: int
    missing: int  # samples before its first
    mask: int  # bit k: axis k is not believed
    doubted: bool = False  # the axes do not fit one motion, and nothing explains that yet


@dataclass(frozen=True)
class Monitored:
    """What the axis monitor says of a log."""

    parts: tuple[Part, ...]
    faults: tuple[Fault, ...]  # of each axis, at the end
    width: str  # how much less exact than expected all axes are, for people; empty: they are not

    def named(self, names: Sequence[str]) -> list[str]:
        """Axes that are not good, in words."""
        return [
            f"axis {name}: {fault.text or fault.word}"
            for name, fault in zip(names, self.faults, strict=True)
            if fault.word != "good"
        ]


def monitored(data: CubeLog, shape: Layout, f_axis: Array) -> Monitored:
    """Run the axis monitor over readings f_axis (n, N), m/s^2, corrected as the estimators' are."""
    monitor, parts = HealthMonitor(shape, data.period_s), []
    jump = np.diff(data.index)
    starts = [0, *(np.nonzero(jump > 1)[0] + 1).tolist()]
    for begin, end in zip(starts, [*starts[1:], len(data.t_s)], strict=True):
        missing = int(jump[begin - 1]) - 1 if begin else 0
        if missing:
            monitor.skip(missing)
        at = begin
        for stop, mask, doubted in monitor.feed(data.t_s[begin:end], f_axis[begin:end]):
            parts.append(Part(at, begin + stop, missing if at == begin else 0, mask, doubted))
            at = begin + stop
    return Monitored(tuple(parts), tuple(monitor.faults), monitor.belief.width.text)


def cut(parts: Sequence[Part], rows: Sequence[int]) -> list[Part]:
    """The parts cut once more so that each of `rows` is the last of a part."""
    ends, out = sorted(rows), []
    for part in parts:
        begin, missing = part.begin, part.missing
        for row in (row for row in ends if part.begin <= row < part.end - 1):
            out.append(replace(part, begin=begin, end=row + 1, missing=missing))
            begin, missing = row + 1, 0
        out.append(replace(part, begin=begin, missing=missing))
    return out
