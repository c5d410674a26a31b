"""A tachometer's report as a correction of a products filter: axis . omega = rate, at the report's
own time (E-50).

An estimate that was aided so must not be scored against the same tachometer: RateState.aid says it,
and so does what is published. The correction itself: inertial/core/rate/tachometer.cpp.
"""

from typing import NamedTuple

import numpy as np

SUFFIX = "+tacho"  # of an aided estimator's name in results of logs
LONGEST_S = 0.5  # s between two reports whose rate is the mean between them


class Report(NamedTuple):
    """One scalar measurement."""

    t_s: float
    rate: float
    sigma: float
    signed: bool


class Reports:
    """Reports on their way to a filter; a rate is of the middle between its pulses and those of the
    report before.
    """

    def __init__(self) -> None:
        self._before: float | None = None
        self._waiting: list[Report] = []

    def __bool__(self) -> bool:
        return bool(self._waiting)

    def add(self, t_s: float, rate: float, sigma: float, signed: bool) -> None:
        """Rate (rad/s) up to the newest pulse at t_s (s). Raises ValueError for what is no
        measurement.
        """
        if not (np.isfinite([t_s, rate, sigma]).all() and sigma > 0.0):
            raise ValueError(
                f"tachometer: rate {rate} rad/s, sigma {sigma} rad/s at {t_s} s: want numbers,"
                " sigma > 0"
            )
        before, self._before = self._before, t_s
        if before is not None and 0.0 < t_s - before < LONGEST_S:
            self._waiting.append(Report(0.5 * (before + t_s), rate, sigma, signed))

    def due(self, t_s: float) -> list[Report]:
        """Those of no later than t_s, which are taken away."""
        due = [report for report in self._waiting if report.t_s <= t_s]
        self._waiting = [report for report in self._waiting if report.t_s > t_s]
        return due
