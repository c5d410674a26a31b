"""Navigation from samples and fixes: alignment, then a filter that applies every fix at the fix's own time.

A fix arrives after the samples of its instant. The navigator keeps the last two seconds of samples with a snapshot
of the filter every 0.1 s, goes back to the fix, corrects there and runs forward again. When a fix is used depends on
times in the data only (its arrival plus `settle`), not on which message the bus delivered first.
"""

import logging
import math
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from estimator.ins import ekf as ins_ekf
from estimator.ins.alignment import Alignment, AlignmentSettings, Start
from estimator.ins.earth import ned_between
from estimator.ins.error_model import DP, STATES, ImuNoise, fix_residual
from estimator.ins.fix import Fix, FixSettings, fix_noise
from estimator.ins.history import History
from estimator.ins.strapdown import BA, BG, LAT, LON, C, H, V, dcm_to_quaternion, exp

log = logging.getLogger(__name__)

Array = NDArray[np.float64]

INNOVATIONS = ("position N m", "position E m", "height m", "velocity N m/s", "velocity E m/s", "velocity D m/s")


ALIGNED = [0, 1, 2, 9, 10, 11, 12, 13, 14]  # error states of Start.P
FUTURE = 10.0  # s; a fix further ahead of the newest sample than this is not waited for
WITHHELD = "withheld to score the filter"


class Mode(IntEnum):
    """As NavSolution.Mode of the bus contract."""

    WAITING = 0
    LEVELLING = 1
    COURSE = 2
    NAVIGATING = 3


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
    settle: float = 0.05  # s after a fix's arrival until it is used, so that order on the bus does not matter
    longest_gap: float = 0.3  # s without samples that the filter bridges; after more the heading is found again


@dataclass(frozen=True)
class Correction:
    """What one fix said, and what was done with it."""

    fix: Fix
    values: Array  # (m,) computed - measured: position NE and height m, v_n m/s; empty when nothing could be compared
    sigma: Array  # (m,) of values as the filter expects them
    nis: float
    accepted: bool
    error_ned: Array  # (3,) computed - measured position of the antenna, m, before the correction; may be empty
    reason: str = ""  # why it was not accepted
    yaw: float = math.nan  # heading at the fix before the correction, rad


def nothing_compared(fix: Fix) -> Correction:
    """A fix taken while there is no prediction to compare it with."""
    return Correction(fix, np.empty(0), np.empty(0), 0.0, True, np.empty(0))


@dataclass(frozen=True)
class Solution:
    """Where we are, at time t of the samples' clock."""

    t: float
    mode: Mode
    latitude: float  # rad
    longitude: float  # rad
    height: float  # m
    p_ned: Array  # (3,) m from origin
    v_n: Array  # (3,) m/s
    q_nb: Array  # (4,)
    bias_f_b: Array  # (3,) m/s^2
    bias_omega_b: Array  # (3,) rad/s
    sigma: Array  # (15,) in the order of the error state, see ins_error
    position_covariance: Array  # (3, 3) NED m^2
    origin: tuple[float, float, float]  # rad, rad, m: the first fix
    fix_age: float  # s since the last fix used; infinite before the first
    alignment: str = ""  # for people: what the alignment does or waits for, or how it ended


class Navigator(Protocol):
    """What every navigation filter offers to the pipeline."""

    def imu(self, t: float, f_b: Array, omega_b: Array) -> list[Correction]: ...
    def fix(self, fix: Fix) -> None: ...
    def solution(self) -> Solution: ...


class EkfNavigator:
    """Levelling, course alignment and the 15-state error-state Kalman filter."""

    def __init__(self, config: NavigatorConfig = NavigatorConfig()) -> None:
        self.config = config
        self.mode = Mode.WAITING
        self.counts = {"used": 0, "rejected": 0, "withheld": 0, "late": 0, "ahead": 0, "readmitted": 0}
        self._align = Alignment(config.alignment)
        self._work = ins_ekf.Workspace(config.imu)
        self._history = History()
        self._pending: list[Fix] = []
        self._state: ins_ekf.InsState | None = None
        self._last_fix: Fix | None = None
        self._last_used = -math.inf
        self._rejected_in_row = 0
        self._aligned = ""  # how navigation began
        self._origin: tuple[float, float, float] | None = None
        self._lever = np.array(config.lever_arm_b)

    # -- input -------------------------------------------------------------------------------------------------

    def imu(self, t: float, f_b: Array, omega_b: Array) -> list[Correction]:
        """Take a sample (s, (3,) m/s^2, (3,) rad/s); returns the corrections that became due with it."""
        last = self._history.newest
        if last is not None and t <= last:
            return []  # a clock that stands or runs back moves nothing; the stream's bookkeeping tells of it
        if last is not None and t - last > self.config.longest_gap:
            self._after_gap(t - last)
        self._history.append(t, f_b, omega_b)
        if self._state is not None:
            self._history.advance(self._state, math.inf, self._work)
        else:
            self._align.imu(t, f_b, omega_b)
            self.mode = Mode.COURSE if self._align.levelled else Mode.LEVELLING
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

    def _after_gap(self, length: float) -> None:
        log.warning("%.2f s without samples: heading must be found again", length)
        if self._state is not None:
            self._align.C = self._state.x[C].reshape(3, 3).copy()
            self._align.gyro_bias = self._state.x[BG].copy()
            self._align.levelled = True  # roughly: what turned during the gap is in sigma_tilt of the next start
            self._state = None
        self.mode = Mode.COURSE if self._align.levelled else Mode.LEVELLING
        self._history.clear()

    # -- fixes -------------------------------------------------------------------------------------------------

    def _use(self, fix: Fix) -> Correction:
        reason = self.config.fix.objection(fix)
        if reason:
            return self._refuse(nothing_compared(fix), "rejected", reason)
        if self._origin is None:
            self._origin = (fix.latitude, fix.longitude, fix.height)
        if self._state is None:
            return self._start(fix)
        then = self._history.state_at(fix.t, self._work)
        if then is None:
            age = self._history.newest - fix.t
            return self._refuse(nothing_compared(fix), "late", f"{age:.2f} s old: before the last one used, or too old")
        state, k = then
        ins_ekf.close(state, self._work)
        P = ins_ekf.covariance(state.P, state.Phi, state.Q)
        y, H_full = np.empty(6), np.empty((6, STATES))
        fix_residual(state.x, self._history.rate(k), self._lever, fix.vector(), y, H_full)
        rows = fix.rows()
        y, H_rows, R = y[rows], H_full[rows], fix_noise(fix, self.config.fix)
        return self._judge(fix, state, k, P, y, H_rows, R)

    def _judge(
        self, fix: Fix, state: ins_ekf.InsState, k: int, P: Array, y: Array, H_rows: Array, R: Array
    ) -> Correction:
        K, S, nis = ins_ekf.gain(P, y, H_rows, R)
        yaw = math.atan2(state.x[9], state.x[6])
        said = Correction(fix, y, np.sqrt(np.diag(S)), nis, True, np.array([y[0], y[1], -y[2]]), yaw=yaw)
        if fix.withheld:
            return self._refuse(said, "withheld", WITHHELD)
        if nis > self.config.fix.gate(len(y)):
            self._rejected_in_row += 1
            if self._rejected_in_row < self.config.fix.readmit_after:
                return self._refuse(said, "rejected", f"NIS {nis:.0f} of {len(y)}")
            P, factor = ins_ekf.consistent(P, y, H_rows, R, len(y))
            log.warning("%d fixes in a row rejected: covariance times %g, fix taken", self._rejected_in_row, factor)
            self.counts["readmitted"] += 1
            K = ins_ekf.gain(P, y, H_rows, R)[0]
        self._rejected_in_row = 0
        ins_ekf.correct(state, P, y, H_rows, R, K)
        self._history.restart(state, k)
        self._history.advance(state, math.inf, self._work)
        self._state = state
        self._took(fix)
        return said

    def _took(self, fix: Fix) -> None:
        self._last_fix = fix
        self._last_used = fix.t
        self.counts["used"] += 1

    def _refuse(self, said: Correction, count: str, reason: str) -> Correction:
        self.counts[count] += 1
        return replace(said, accepted=False, reason=reason)

    def _start(self, fix: Fix) -> Correction:
        """Before navigation: watch the speed, and start once the course gives the heading."""
        if fix.withheld:
            return self._refuse(nothing_compared(fix), "withheld", WITHHELD)
        if fix.v_n is None:
            self._took(fix)
            return replace(nothing_compared(fix), reason="aligning: no velocity in the fix")
        self._align.fix(fix.t, fix.v_n, fix.sigma_v)
        k = self._history.first_after(fix.t)
        start = None if k is None else self._align.start(self._attitude_at(fix.t, k), fix.v_n)
        if start is not None:
            self._state = self._first_state(fix, start)
            self._history.restart(self._state, k)
            self._history.advance(self._state, math.inf, self._work)
            self.mode = Mode.NAVIGATING
            self._aligned = start.how
            log.info("%s; course %.1f deg at %.1f m/s: navigating", start.how,
                     math.degrees(math.atan2(fix.v_n[1], fix.v_n[0])), math.hypot(fix.v_n[0], fix.v_n[1]))  # fmt: skip
        self._took(fix)
        return replace(nothing_compared(fix), reason="aligning")

    def _attitude_at(self, t: float, k: int) -> Array:
        """Alignment's C at time t, sample k the first after it: the newest one turned back by the gyro."""
        C_nb = self._align.C
        for dt, w in self._history.back_to(t, k):
            C_nb = C_nb @ exp(-(w - self._align.gyro_bias) * dt)
        return C_nb

    def _first_state(self, fix: Fix, start: Start) -> ins_ekf.InsState:
        c = self.config
        s = ins_ekf.InsState()
        s.x[LAT], s.x[LON], s.x[H] = fix.latitude, fix.longitude, fix.height
        s.x[V] = fix.v_n
        s.x[C], s.x[BA], s.x[BG] = start.C_nb.ravel(), start.bias_accel, start.bias_gyro
        antenna = np.zeros(STATES)
        antenna[6:9] = (start.C_nb @ self._lever) * (1.0, 1.0, -1.0)
        ins_ekf.reset(s.x, antenna)
        sigma_p = np.minimum(c.sigma_p, np.maximum(3.0 * fix.sigma_p, 0.1))
        sigma_v = np.maximum(c.sigma_v, fix.sigma_v)
        tilt, yaw, ba, bg = c.sigma_tilt, c.sigma_yaw, c.sigma_bias_accel, c.sigma_bias_gyro
        s.P = np.diag(np.square(np.concatenate([[tilt, tilt, yaw], sigma_v, sigma_p, [ba] * 3, [bg] * 3])))
        if start.P is not None:
            s.P[np.ix_(ALIGNED, ALIGNED)] = start.P
        s.acc[ins_ekf.ACC_TIME] = fix.t
        return s

    # -- output ------------------------------------------------------------------------------------------------

    def solution(self) -> Solution:
        """The newest sample's solution; before navigation the last fix, with sigmas that say so."""
        t = self._history.newest or 0.0
        if self._state is None:
            return self._waiting_solution(t)
        x = self._state.x
        P = ins_ekf.current_covariance(self._state, self._work)
        down = np.array([1.0, 1.0, -1.0])  # the error state counts height up
        return Solution(
            t, self.mode, float(x[LAT]), float(x[LON]), float(x[H]),
            np.array(ned_between(*self._origin, x[LAT], x[LON], x[H])),
            x[V].copy(), dcm_to_quaternion(x[C].reshape(3, 3)), x[BA].copy(), x[BG].copy(), np.sqrt(np.diag(P)),
            P[DP, DP] * np.outer(down, down), self._origin, t - self._last_used, self._aligned,
        )  # fmt: skip

    def _waiting_solution(self, t: float) -> Solution:
        c, fix = self.config, self._last_fix
        age = t - self._last_used
        v, where, sigma_p, sigma_v = np.zeros(3), (0.0, 0.0, 0.0), np.full(3, 1e7), np.full(3, 100.0)
        if fix is not None:
            where, sigma_p = (fix.latitude, fix.longitude, fix.height), fix.sigma_p
            if fix.v_n is not None:
                v, sigma_v = fix.v_n, fix.sigma_v + 2.0 * age  # 2 m/s^2: how fast a car changes its mind
            sigma_p = sigma_p + (np.abs(v) + 1.0) * age
        tilt = c.sigma_tilt if self._align.levelled else math.pi
        sigma = np.concatenate(
            [[tilt, tilt, math.pi], sigma_v, sigma_p, [c.sigma_bias_accel] * 3, [c.sigma_bias_gyro] * 3]
        )
        origin = self._origin or (0.0, 0.0, 0.0)
        return Solution(
            t, self.mode, *where, np.array(ned_between(*origin, *where)), v, dcm_to_quaternion(self._align.C),
            np.zeros(3), self._align.gyro_bias, sigma, np.diag(sigma_p**2), origin, age, self._align.text,
        )  # fmt: skip


NAVIGATORS = {"ekf": EkfNavigator}
