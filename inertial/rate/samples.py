"""Samples on their way into a rate estimator: checked once for a batch, as the compiled functions
want them.
"""

import math

import numpy as np
from numpy.typing import NDArray

from inertial.layouts.layout import Layout
from inertial.rate.field import checked

Array = NDArray[np.float64]

BRIDGED = 3
"""Samples in a row that may be missing without anything being forgotten: the next step is longer,
and that is all. Over more of them a body may have begun to turn.
"""


def finite(values: Array) -> bool:
    """Are all numbers finite? The sum of their squares says so at a third of the cost, unless it
    overflows.
    """
    return math.isfinite(np.vdot(values, values)) or bool(np.isfinite(values).all())


class Samples:
    """Checks samples before they reach a filter: their number, finite, time that grows."""

    def __init__(self) -> None:
        self.last_s: float | None = None

    def take(self, layout: Layout, t_s: Array, f_axis: Array) -> tuple[Array, Array]:
        """Times (n,), s, and readings (n, N) as the compiled functions want them; ValueError names
        what is wrong.
        """
        t_s, f_axis = (
            np.ascontiguousarray(t_s, dtype=np.float64),
            np.ascontiguousarray(f_axis, dtype=np.float64),
        )
        if f_axis.shape != (len(t_s), layout.axes) or not finite(f_axis):
            for row in f_axis:
                checked(layout, row)
            raise ValueError(
                f"readings {f_axis.shape}, want ({len(t_s)}, {layout.axes}) of {layout.name}"
            )
        last = self.last_s
        for t in t_s.tolist():
            if last is not None and not t > last:
                raise ValueError(
                    f"sample at {t:.6f} s after one at {last:.6f} s: time must grow; start a new"
                    " estimator"
                )
            last = t
        self.last_s = last
        return t_s, f_axis
