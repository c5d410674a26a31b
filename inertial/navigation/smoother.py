"""Offline: all fixes for every moment of a drive. Rauch, Tung and Striebel's smoother, and a robust
one. E-46, E-50.

The forward pass is the filter of the name; each fix, used or not, and each constraint that held is
an event at which Phi, both covariances and the correction c are kept. Going back, the error left in
the filter's own solution is found and taken off. The robust smoother repeats this with weights from
its own residuals, which know the future too.
"""

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

from inertial.navigation import estimate as est
from inertial.navigation.arrays import copy1, copy2, fill2, identity
from inertial.navigation.batch import Drive
from inertial.navigation.constraints import constrain
from inertial.navigation.filters import FILTERS, FilterConfig
from inertial.navigation.fix import Fix
from inertial.navigation.leg import Leg, Model, carry, close, reset, run_leg
from inertial.navigation.mechanise import NOMINAL, SINCE, TIME
from inertial.navigation.navigation import Navigator, NavigatorConfig, first_leg
from inertial.navigation.update import F_HAS_V, F_SIGMA, F_T, F_WITHHELD, residual

Array = NDArray[np.float64]

CAUCHY = 2.0  # sigmas of a smoothed residual at which a fix has half its weight


@dataclass(frozen=True)
class Smoother:
    """What a smoother of a name does."""

    filter: FilterConfig
    passes: int = 0  # of reweighting; 0: plain


SMOOTHERS = {
    "smoother": Smoother(FILTERS["huber-nhc"]),
    "smoother-robust": Smoother(replace(FILTERS["kf-nhc"], gated=False), 4),
}


@dataclass(frozen=True)
class SmoothRun:
    """The smoothed solution at every fix; k rows."""

    name: str
    fixes: list[Fix]
    used: NDArray[np.bool_]  # (k,)
    y: Array  # (k, 7) smoothed minus measured, rows of update; NaN: absent
    x: Array  # (k, NOMINAL)
    P: Array  # (k, 9, 9) of psi_n, dv_n, dN dE dh
    began: float  # s
    seconds: float  # CPU time
    epochs: int

    @property
    def t(self) -> Array:
        """Times (k,) of the fixes, s."""
        return np.array([fix.t for fix in self.fixes])


@njit(cache=True)
def _event(leg: Leg, m: Model, e: int, Phi: Array, before: Array, scratch: Array) -> None:
    """Keep what led to event e."""
    close(leg, m)
    copy2(leg.Phi, Phi[e])
    carry(leg.P, leg.Phi, leg.Q, 1.0, scratch, before[e])


@njit(cache=True)
def _forward(
    leg: Leg,
    m: Model,
    s: est.Settings,
    mem: est.Memory,
    t: Array,
    f: Array,
    w: Array,
    start: int,
    stop: int,
    fixes: Array,
    Phi: Array,
    before: Array,
    after: Array,
    c: Array,
    x: Array,
    y: Array,
    H: Array,
    at: Array,
) -> int:
    """The filter with its events kept; at (k,) is the event of each fix. Returns the number of
    events.
    """
    k, e = start, 0
    out = np.empty(est.OUT)
    for j in range(fixes.shape[0]):
        when = fixes[j, F_T]
        while True:
            k = run_leg(leg, m, t, f, w, k, stop, when, s.rules.every)
            if leg.acc[SINCE] < s.rules.every - 1e-6:
                break
            _event(leg, m, e, Phi, before, mem.scratch[2])
            if constrain(leg, m, s.rules, mem.scratch, c[e]):
                copy2(leg.P, after[e])
                copy1(leg.x, x[e])
                e += 1
            if leg.acc[TIME] >= when - 1e-9 or k >= stop:
                break
        _event(leg, m, e, Phi, before, mem.scratch[2])
        rate = w[min(k, stop - 1)]
        residual(leg, m, rate, s.lever, fixes[j], y[j], H[j])
        copy1(leg.x, x[e])
        status = est.take(leg, m, s, mem, fixes[j], rate, out)
        if status == est.REJECTED or status == est.WITHHELD:
            copy2(before[e], leg.P)
            identity(leg.Phi)
            fill2(leg.Q, 0.0)
            for i in range(m.n):
                c[e, i] = 0.0
        else:
            copy1(mem.last, c[e])
            copy1(leg.x, x[e])
        copy2(leg.P, after[e])
        at[j] = e
        e += 1
    return e


@njit(cache=True)
def _backward(
    m: Model, events: int, Phi: Array, before: Array, after: Array, c: Array, x: Array, dx: Array
) -> None:
    """Smooth in place: x of every event, `after` becomes its covariance, dx the error against the
    filter (E-46).
    """
    n = m.n
    for i in range(n):
        dx[events - 1, i] = 0.0
    for e in range(events - 2, -1, -1):
        G = np.linalg.solve(before[e + 1], np.dot(Phi[e + 1], after[e])).T.copy()
        for i in range(n):
            s = 0.0
            for j in range(n):
                s += G[i, j] * (c[e + 1, j] + dx[e + 1, j])
            dx[e, i] = s
        change = np.dot(np.dot(G, after[e + 1] - before[e + 1]), G.T)
        for i in range(n):
            for j in range(n):
                after[e, i, j] += 0.5 * (change[i, j] + change[j, i])
        reset(x[e], dx[e], m)


def smooth_drive(
    imu: Array,
    fixes: Sequence[Fix],
    name: str = "smoother",
    config: NavigatorConfig = NavigatorConfig(),
) -> SmoothRun | None:
    """Smooth a drive, imu (n, 7) as run_filters takes it, up to the first gap in it; None when it
    never navigates.
    """
    chosen = SMOOTHERS[name]
    drive = Drive(imu, fixes, config)
    nav = Navigator(config, chosen.filter)
    found = drive.align(nav, 0, 0)
    if found is None:
        return None
    start, fix, j = found
    k = int(np.searchsorted(drive.t, fix.t, side="right"))
    end = int(drive.gaps[drive.gaps > k][0]) if (drive.gaps > k).any() else len(drive.t)
    last = int(np.searchsorted(drive.due, drive.t[end - 1], side="right"))
    table, n = drive.table[j:last].copy(), nav.model.n
    clock = time.thread_time_ns()
    size = (
        len(table) + int((drive.t[end - 1] - fix.t) / nav.settings.rules.every) + 2
        if math.isfinite(nav.settings.rules.every)
        else len(table) + 1
    )
    Phi, before, after = (np.zeros((size, n, n)) for _ in range(3))
    c, dx, x = np.zeros((size, n)), np.zeros((size, n)), np.zeros((size, NOMINAL))
    y, H, at = (
        np.zeros((len(table), 7)),
        np.zeros((len(table), 7, n)),
        np.zeros(len(table), np.int64),
    )
    fed = table[:, F_WITHHELD] == 0.0
    for _ in range(chosen.passes + 1):
        leg = first_leg(config, chosen.filter, start, fix)
        memory = chosen.filter.memory(n, leg.P, float(np.linalg.norm(nav.align.mean_f)))
        events = _forward(
            leg,
            nav.model,
            nav.settings,
            memory,
            drive.t,
            drive.f,
            drive.w,
            k,
            end,
            table,
            Phi,
            before,
            after,
            c,
            x,
            y,
            H,
            at,
        )
        _backward(nav.model, events, Phi, before, after, c, x, dx)
        left = y - np.einsum("kij,kj->ki", H, (c + dx)[at])
        if chosen.passes:
            table[:, F_SIGMA : F_SIGMA + 7] = _doubt(drive.table[j:last], left, fed)
    left[table[:, F_HAS_V] == 0.0, 3:6] = np.nan
    return SmoothRun(
        name,
        drive.fixes[j:last],
        fed,
        left,
        x[at],
        after[at][:, :9, :9],
        fix.t,
        (time.thread_time_ns() - clock) * 1e-9,
        end - k,
    )


def _doubt(table: Array, left: Array, fed: NDArray[np.bool_]) -> Array:
    """Sigmas (k, 7) raised by Cauchy weights 1 / (1 + (d / CAUCHY)^2) of the smoothed residuals
    (E-50).
    """
    sigma = table[:, F_SIGMA : F_SIGMA + 7].copy()
    for rows in (slice(0, 3), slice(3, 6)):
        d = np.sqrt(np.mean((left[:, rows] / np.maximum(sigma[:, rows], 1e-9)) ** 2, axis=1))
        grow = np.where(fed & np.isfinite(d), np.sqrt(1.0 + (d / CAUCHY) ** 2), 1.0)
        sigma[:, rows] *= grow[:, None]
    return sigma
