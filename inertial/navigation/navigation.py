"""Navigation from samples and fixes, live: alignment, then a filter that applies every fix at the
fix's own time.

A fix arrives after the samples of its instant. The navigator keeps the filter as it was after the
last fix used (or two seconds ago) beside the newest state, goes back to it, corrects there and runs
forward again. When a fix is used depends on times in the data only (its arrival plus `settle`), not
on which message the bus delivered first.
"""

import logging
import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from inertial.navigation import estimate as est
from inertial.navigation.alignment import Alignment, AlignmentSettings, Start
from inertial.navigation.drag import DragWatch
from inertial.navigation.earth import ned_between
from inertial.navigation.error_model import DP, ImuNoise
from inertial.navigation.filters import FILTERS, FilterConfig, filter_of
from inertial.navigation.fix import Fix, FixSettings, fix_row
from inertial.navigation.history import LATEST, History
from inertial.navigation.leg import Leg, copy_leg, current_covariance, new_leg, reset
from inertial.navigation.mechanise import AXLE, TIME
from inertial.navigation.solution import (
    INNOVATIONS,
    WITHHELD,
    Correction,
    HorizonChoice,
    Mode,
    Solution,
    correction_of,
    nothing_compared,
)
from inertial.navigation.strapdown import BA, BG, LAT, LON, C, H, V, dcm_to_quaternion, exp

log = logging.getLogger(__name__)

Array = NDArray[np.float64]

FUTURE = 10.0  # s; a fix further ahead of the newest sample than this is not waited for


@dataclass(frozen=True)
class NavigatorConfig:
    """Everything a navigator is told beforehand. SI units and radians."""

    lever_arm_b: tuple[float, float, float] = (0.0, 0.0, 0.0)  # m, IMU to antenna
    imu: ImuNoise = ImuNoise()
    fix: FixSettings = FixSettings()
    alignment: AlignmentSettings = AlignmentSettings()
    sigma_tilt: float = math.radians(1.0)  # at the start of navigation
    sigma_yaw: float = math.radians(4.0)
    sigma_v: tuple[float, float, float] = (0.3, 0.3, 0.4)  # m/s, or the fix's where that is more
    sigma_p: tuple[float, float, float] = (2.0, 2.0, 4.0)  # m, or the fix's where that is less
    sigma_bias_accel: float = 0.15  # m/s^2
    sigma_bias_gyro: float = math.radians(0.08)  # rad/s
    settle: float = (
        0.05  # s after a fix's arrival until it is used, so that order on the bus does not matter
    )
    longest_gap: float = (
        0.3  # s without samples that the filter bridges; after more the heading is found again
    )


def first_leg(config: NavigatorConfig, chosen: FilterConfig, start: Start, fix: Fix) -> Leg:
    """The filter at the fix that ended the alignment: attitude from there, position and velocity of
    the fix.
    """
    c, m = config, chosen.model(config.imu)
    leg = new_leg(m.n)
    x = leg.x
    x[LAT], x[LON], x[H] = fix.latitude, fix.longitude, fix.height
    x[V] = fix.v_n
    x[C] = start.C_nb.ravel()
    x[BG], x[BA] = start.bias_gyro, start.bias_accel
    if chosen.constraints.car:
        x[AXLE] = chosen.constraints.axle
    antenna = np.zeros(m.n)
    antenna[DP] = (start.C_nb @ np.array(c.lever_arm_b)) * (1.0, 1.0, -1.0)
    reset(x, antenna, m)
    sigma_p = np.minimum(c.sigma_p, np.maximum(3.0 * fix.sigma_p, 0.1))
    sigma_v = np.maximum(c.sigma_v, fix.sigma_v)
    tilt, yaw, ba, bg = c.sigma_tilt, c.sigma_yaw, c.sigma_bias_accel, c.sigma_bias_gyro
    sigma = np.concatenate(
        [[tilt, tilt, yaw], sigma_v, sigma_p, [ba] * 3, [bg] * 3, chosen.extra_sigma()]
    )
    leg.P[:] = np.diag(np.square(sigma))
    if start.P is not None:
        places = np.r_[0:3, 9:15]
        leg.P[np.ix_(places, places)] = start.P
    leg.acc[TIME] = fix.t
    return leg


class Navigator:
    """Alignment, then the filter of a name of FILTERS, on samples that come one by one."""

    def __init__(
        self, config: NavigatorConfig = NavigatorConfig(), chosen: FilterConfig = FILTERS["kf"]
    ) -> None:
        self.config, self.filter = config, chosen
        self.model = chosen.model(config.imu)
        self.settings = chosen.settings(config.fix, config.lever_arm_b)
        self.mode = Mode.WAITING
        names = (
            "used",
            "rejected",
            "withheld",
            "late",
            "ahead",
            "readmitted",
            "doubted",
            "dragged",
        )
        self.counts = dict.fromkeys(names, 0)
        self.watch: DragWatch | None = DragWatch()  # None: the fixes have been looked at already
        self.horizon: HorizonChoice | None = None
        self.align = Alignment(config.alignment)
        self._history = History()
        self._pending: list[Fix] = []
        self._memory: est.Memory | None = None
        self._anchor, self._head = new_leg(self.model.n), new_leg(self.model.n)
        self._anchor_next = self._head_next = 0
        self._scratch = np.zeros((3, self.model.n, self.model.n))
        self._row = np.empty(est.OUT)
        self._how = ""
        self._last_fix: Fix | None = None
        self._last_used = -math.inf
        self._origin: tuple[float, float, float] | None = None

    @property
    def x(self) -> Array:
        """Nominal state at the newest sample, see mechanise; meaningless before navigation."""
        return self._head.x

    def covariance(self) -> Array:
        """(n, n) at the newest sample."""
        return current_covariance(self._head, self.model)

    # -- input
    # -------------------------------------------------------------------------------------------------

    def imu(self, t: float, f_b: Array, omega_b: Array) -> list[Correction]:
        """Take a sample (s, (3,) m/s^2, (3,) rad/s); returns the corrections that became due with
        it.
        """
        last = self._history.newest
        if last is not None and t <= last:
            # a clock that stands or runs back moves nothing; the stream's bookkeeping tells of it
            return []
        if last is not None and t - last > self.config.longest_gap:
            self._after_gap(t - last)
        dropped = self._history.append(t, f_b, omega_b)
        self._anchor_next, self._head_next = self._anchor_next - dropped, self._head_next - dropped
        if self._memory is not None:
            self._advance_head()
            self._advance_anchor(t - LATEST)
        else:
            self.align.imu(t, f_b, omega_b)
            self.mode = Mode.COURSE if self.align.levelled else Mode.LEVELLING
        corrections = []
        while self._pending and self._pending[0].due(self.config.settle) <= t:
            corrections.append(self._use(self._pending.pop(0)))
        return corrections

    def fix(self, fix: Fix) -> None:
        """Take a fix; it is used, and answered for, once samples have passed its arrival."""
        newest = self._history.newest
        if newest is None or not fix.due(self.config.settle) < newest + FUTURE:
            self.counts["ahead"] += 1  # samples have stopped, or the clocks are not one clock
            return
        self._pending.append(fix)
        self._pending.sort(key=lambda f: f.due(self.config.settle))

    def _run(self, leg: Leg, start: int, stop: int, until: float) -> int:
        h = self._history
        return est.run_to(
            leg, self.model, self.settings.rules, self._scratch, h.t, h.f, h.w, start, stop, until
        )

    def _advance_head(self) -> None:
        self._head_next = self._run(self._head, self._head_next, self._history.count, math.inf)

    def _advance_anchor(self, until: float) -> None:
        """Bring the anchor within reach: fixes older than `until` come too late. A second at a
        time, for speed.
        """
        if self._anchor.acc[TIME] < until - 1.0:
            stop = self._history.after(until)
            self._anchor_next = self._run(self._anchor, self._anchor_next, stop, math.inf)

    def _after_gap(self, length: float) -> None:
        log.warning("%.2f s without samples: heading must be found again", length)
        if self._memory is not None:
            self.align.C = self._head.x[C].reshape(3, 3).copy()
            self.align.gyro_bias = self._head.x[BG].copy()
            self.align.levelled = (
                True  # roughly: what turned during the gap is in sigma_tilt of the next start
            )
            self._memory = None
        self.mode = Mode.COURSE if self.align.levelled else Mode.LEVELLING
        self._history.clear()

    # -- fixes
    # -------------------------------------------------------------------------------------------------

    def _use(self, fix: Fix) -> Correction:
        reason = self.config.fix.objection(fix)
        if reason:
            return self._refuse(nothing_compared(fix), "rejected", reason)
        if self.watch is not None:
            fix = self.watch.take(fix)
        self.counts["dragged"] += fix.drag > 0.0
        if self._origin is None:
            self._origin = (fix.latitude, fix.longitude, fix.height)
        if self._memory is None:
            return self._start(fix)
        if fix.t < self._anchor.acc[TIME] - 1e-9:
            age = self._history.newest - fix.t
            return self._refuse(
                nothing_compared(fix),
                "late",
                f"{age:.2f} s old: before the last one used, or too old",
            )
        h, trial = self._history, self._memory.trial
        stop = max(self._anchor_next, h.after(fix.t))
        copy_leg(self._anchor, trial)
        k = self._run(trial, self._anchor_next, stop, math.inf)
        self._run(trial, k, min(k + 1, h.count), fix.t)
        rate = h.w[min(k, h.count - 1)]
        row = fix_row(fix, self.config.fix)
        status = est.take(trial, self.model, self.settings, self._memory, row, rate, self._row)
        said = correction_of(fix, self._row)
        if status in (est.REJECTED, est.WITHHELD):
            return self._refuse(
                said, "rejected" if status == est.REJECTED else "withheld", said.reason
            )
        self._count(status)
        self.horizon = said.horizon
        copy_leg(trial, self._anchor)
        copy_leg(trial, self._head)
        self._anchor_next = self._head_next = k
        self._advance_head()
        self._took(fix)
        return said

    def _count(self, status: int) -> None:
        if status == est.READMITTED:
            log.warning(
                "%d fixes in a row rejected: covariance raised, fix taken",
                self.config.fix.readmit_after,
            )
            self.counts["readmitted"] += 1
        self.counts["doubted"] += status == est.DOUBTED

    def _took(self, fix: Fix) -> None:
        self._last_fix = fix
        self._last_used = fix.t
        self.counts["used"] += 1

    def _refuse(self, said: Correction, count: str, reason: str) -> Correction:
        self.counts[count] += 1
        return replace(said, accepted=False, reason=reason)

    def _start(self, fix: Fix) -> Correction:
        """Before navigation: watch the speed, and start once the alignment knows the heading."""
        if fix.withheld:
            return self._refuse(nothing_compared(fix), "withheld", WITHHELD)
        if fix.v_n is None:
            self._took(fix)
            return replace(nothing_compared(fix), reason="aligning: no velocity in the fix")
        self.align.fix(fix.t, fix.v_n, fix.sigma_v)
        start = (
            self.align.start(self._attitude_at(fix.t), fix.v_n)
            if self._history.reaches(fix.t)
            else None
        )
        if start is not None:
            self.begin(start, fix)
            self._head_next = self._anchor_next = self._history.after(fix.t)
            self._advance_head()
            log.info("%s: navigating", start.how)
        self._took(fix)
        return replace(nothing_compared(fix), reason="aligning")

    def begin(self, start: Start, fix: Fix) -> None:
        """Start the filter at a fix."""
        copy_leg(first_leg(self.config, self.filter, start, fix), self._anchor)
        copy_leg(self._anchor, self._head)
        still_f = float(np.linalg.norm(self.align.mean_f)) if self.align.levelled else 9.80665
        self._memory = self.filter.memory(self.model.n, self._anchor.P, still_f)
        self._how = start.how
        self.mode = Mode.NAVIGATING

    def _attitude_at(self, t: float) -> Array:
        """Alignment's C at time t: the newest one turned back by the gyro."""
        h, C_nb = self._history, self.align.C
        for i in range(h.count - 1, h.after(t) - 1, -1):
            begin = max(t, h.t[i - 1]) if i else t
            C_nb = C_nb @ exp(-(h.w[i] - self.align.gyro_bias) * (h.t[i] - begin))
        return C_nb

    # -- output
    # ------------------------------------------------------------------------------------------------

    def solution(self) -> Solution:
        """The newest sample's solution; before navigation the last fix, with sigmas that say so."""
        t = self._history.newest or 0.0
        if self._memory is None:
            return self._waiting_solution(t)
        x, P = self._head.x, self.covariance()
        down = np.array([1.0, 1.0, -1.0])  # the error state counts height up
        return Solution(
            t,
            self.mode,
            float(x[LAT]),
            float(x[LON]),
            float(x[H]),
            np.array(ned_between(*self._origin, x[LAT], x[LON], x[H])),
            x[V].copy(),
            dcm_to_quaternion(x[C].reshape(3, 3)),
            x[BA].copy(),
            x[BG].copy(),
            np.sqrt(np.diag(P)[:15]),
            P[DP, DP] * np.outer(down, down),
            self._origin,
            t - self._last_used,
            self.horizon,
            self._how,
        )

    def _waiting_solution(self, t: float) -> Solution:
        c, fix = self.config, self._last_fix
        age = t - self._last_used
        v, where, sigma_p, sigma_v = (
            np.zeros(3),
            (0.0, 0.0, 0.0),
            np.full(3, 1e7),
            np.full(3, 100.0),
        )
        if fix is not None:
            where, sigma_p = (fix.latitude, fix.longitude, fix.height), fix.sigma_p
            if fix.v_n is not None:
                v, sigma_v = (
                    fix.v_n,
                    fix.sigma_v + 2.0 * age,
                )  # 2 m/s^2: how fast a car changes its mind
            sigma_p = sigma_p + (np.abs(v) + 1.0) * age
        tilt = c.sigma_tilt if self.align.levelled else math.pi
        sigma = np.concatenate(
            [
                [tilt, tilt, math.pi],
                sigma_v,
                sigma_p,
                [c.sigma_bias_accel] * 3,
                [c.sigma_bias_gyro] * 3,
            ]
        )
        origin = self._origin or (0.0, 0.0, 0.0)
        return Solution(
            t,
            self.mode,
            *where,
            np.array(ned_between(*origin, *where)),
            v,
            dcm_to_quaternion(self.align.C),
            np.zeros(3),
            self.align.gyro_bias,
            sigma,
            np.diag(sigma_p**2),
            origin,
            age,
            None,
            self.align.text,
        )


def _maker(name: str) -> Callable[..., Navigator]:
    return lambda config=NavigatorConfig(): Navigator(config, filter_of(name))


NAVIGATORS: dict[str, Callable[..., Navigator]] = {name: _maker(name) for name in FILTERS}

__all__ = [
    "INNOVATIONS",
    "NAVIGATORS",
    "Correction",
    "Mode",
    "Navigator",
    "NavigatorConfig",
    "Solution",
    "first_leg",
]
