"""A tachometer's report as a correction of a products filter: axis . omega = rate, at the report's
own time (E-50).

An estimate that was aided so must not be scored against the same tachometer: RateState.aid says it,
and so does what is published.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inertial.rate import products_run as frame
from inertial.rate.observed import Sensor
from inertial.rate.products_kernel import PP, SIGN
from inertial.rate.products_model import STATES
from inertial.rate.still import COUNT, DEPTH, FILLED, Watch

Array = NDArray[np.float64]

NAME = "tachometer"
SUFFIX = "+tacho"  # of an aided estimator's name in results of logs
GATE = 36.0  # chi-square, 1 degree: 6 sigma; beyond it a report is refused
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


def correct(m: frame.Memory, w: Watch, s: Sensor, axis_b: Array, report: Report) -> bool:
    """Correct the filter's state after its newest sample by an older report; axis_b (3,) of unit
    length.

    omega' since then, summed, carries the report to now. While the sign of omega is unknown, a
    signed report counts for it. False, and nothing is changed, when it is too old, contradicts by
    more than 6 sigma, or nothing is known.
    """
    marks, clock = m["marks"], m["clock"]
    dt = float(clock[frame.DT])
    n = round((float(clock[frame.LAST_S]) - report.t_s) / dt)
    if not marks[frame.STARTED] or not 0 <= n < min(DEPTH, int(w["n"][FILLED])):
        return False
    now = int(w["n"][COUNT]) - 1
    raw = (
        (w["total"][now % (2 * DEPTH), :3] - w["total"][(now - n) % (2 * DEPTH), :3])
        if n
        else np.zeros(3)
    )
    noise = report.sigma**2 + n * dt * dt * float(axis_b @ s["R_alpha"] @ axis_b)
    if marks[frame.BRANCHES] == 2 and report.signed:
        _decide(
            m,
            [_innovation(m[name], axis_b, raw, n, dt, noise, report) for name in ("core", "other")],
        )
    used = False
    for name in ("core", "other")[: int(marks[frame.BRANCHES])]:
        core = m[name]
        y, S = _innovation(core, axis_b, raw, n, dt, noise, report)
        if y * y > GATE * S:
            continue
        P = core[STATES:PP].reshape(STATES, STATES)
        gain = P[:, :3] @ axis_b
        core[:STATES] += gain * (y / S)
        P -= np.outer(gain, gain) / S
        core[SIGN] = min(core[SIGN], noise)
        used, marks[frame.FITTED] = True, 0  # a later fit would not know of it
    return used


def _innovation(
    core: Array, axis_b: Array, raw: Array, n: int, dt: float, noise: float, report: Report
) -> tuple:
    """Innovation, rad/s, and its variance."""
    then = float(axis_b @ (core[:3] - dt * (raw - n * core[3:6])))
    P = core[STATES:PP].reshape(STATES, STATES)[:3, :3]
    want = report.rate if report.signed else np.copysign(report.rate, then)
    return want - then, float(axis_b @ P @ axis_b) + noise


def _decide(m: frame.Memory, said: list[tuple[float, float]]) -> None:
    """What a signed report says of two signs; the likelier one becomes the first."""
    first, second = (-0.5 * (y * y / S + np.log(S)) for y, S in said)
    m["clock"][frame.BALANCE] += first - second
    if m["clock"][frame.BALANCE] < 0.0:
        core = m["core"].copy()
        m["core"][:], m["other"][:] = m["other"], core
        m["clock"][frame.BALANCE] *= -1.0
    if m["clock"][frame.BALANCE] > frame.DECIDED:
        m["marks"][frame.BRANCHES] = 1
