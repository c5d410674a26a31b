"""Navigation from samples and fixes, live: alignment, then a filter that applies every fix at the
fix's own time.

A fix arrives after the samples of its instant. The core keeps the filter as it was after the last
fix used (or two seconds ago) beside the newest state, goes back to it, corrects there and runs
forward again. When a fix is used depends on times in the data only (its arrival plus `settle`), not
on which message the bus delivered first.
"""

import logging
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inertial.core import navigation as core
from inertial.earth import ned_between
from inertial.navigation import results
from inertial.navigation.alignment import Start
from inertial.navigation.drag import DragWatch
from inertial.navigation.error_model import DP, TILT
from inertial.navigation.filters import FILTERS, FilterConfig, filter_of
from inertial.navigation.fix import Fix, core_fix
from inertial.navigation.settings import NavigatorConfig
from inertial.navigation.solution import (
    INNOVATIONS,
    WHEELS,
    WITHHELD,
    Correction,
    HorizonChoice,
    Mode,
    Solution,
    Wheels,
    as_known,
    correction_of,
    nothing_compared,
)
from inertial.navigation.start import HEIGHT_UP, Startup, first_leg
from inertial.rotation import from_matrix

log = logging.getLogger(__name__)

Array = NDArray[np.float64]

FUTURE = 10.0  # s; a fix further ahead of the newest sample than this is not waited for
FIRST_ROW = np.zeros(1, np.int64)
COUNTS = ("used", "rejected", "withheld", "late", "ahead", "readmitted", "doubted", "dragged")


class Navigator:
    """Alignment, then the filter of a name of FILTERS, on samples that come in batches."""

    def __init__(
        self, config: NavigatorConfig = NavigatorConfig(), chosen: FilterConfig = FILTERS["kf"]
    ) -> None:
        self.config, self.filter = config, chosen
        self.mode = Mode.WAITING
        self.counts = dict.fromkeys(COUNTS, 0)
        self.watch = DragWatch()
        self.horizon: HorizonChoice | None = None
        self._live = core.Live(
            model=chosen.model(config.imu), settings=chosen.settings(config.fix, config.lever_arm_b)
        )
        self._startup = Startup(config.alignment, self._live)
        self._pending: list[Fix] = []
        self.wheels = Wheels.NONE
        self._how = ""
        self._last_fix: Fix | None = None
        self._last_used = -math.inf
        self._origin: tuple[float, float, float] | None = None  # its height may be NaN: unknown
        self._datum, self._measured_height = 0.0, False

    @property
    def nominal(self) -> Any:
        """The core's Nominal at the newest sample; meaningless before navigation."""
        return self._live.head.x

    def covariance(self) -> Array:
        """(n, n) at the newest sample, with what stays of position (E-138) and tilt (E-142)."""
        head, model = self._live.head, self._live.model
        P = head.covariance(model)
        P[TILT, TILT] += np.eye(2) * model.axes**2
        P[DP, DP] += np.diag(head.receiver.wander)
        return P

    @property
    def navigating(self) -> bool:
        """Whether the filter runs, which it does from the alignment on."""
        return self._live.navigating

    def believe_attitude_noise(self, density: Array) -> None:
        """Let the noise density of the attitude be (3,) rad^2/s, from the next sample on."""
        model = self._live.model
        model.density = np.concatenate([density, model.density[3:]])

    # -- input

    def imu(self, t: float, f_b: Array, omega_b: Array) -> list[Correction]:
        """Take one sample (s, (3,) m/s^2, (3,) rad/s); returns the corrections that became due."""
        said = self.feed(np.array([[t, *f_b, *omega_b]]))
        return [correction for _, correction in said]

    def feed(self, imu: Array) -> list[tuple[int, Correction]]:
        """Take samples imu (n, 7: t s, f_b m/s^2, omega_ib_b rad/s); returns the corrections that
        became due, each with the row of its sample.
        """
        rows = self._rising(imu[:, 0])
        t, samples = imu[rows, 0], imu[rows]
        said, k = [], 0
        while k < len(t):
            stop = self._stretch(t, k)
            self._take(samples[k:stop])
            k = stop
            while self._pending and self._pending[0].due(self.config.settle) <= t[k - 1]:
                said.append((int(rows[k - 1]), self._use(self._pending.pop(0))))
        return said

    def _rising(self, t: Array) -> NDArray[np.int64]:
        """Rows whose time is later than all before: a clock that stands or runs back moves nothing;
        the stream's bookkeeping tells of it.
        """
        newest = self._live.newest()
        if len(t) == 1:  # most batches of a board at 100 Hz
            return FIRST_ROW if t[0] > newest else FIRST_ROW[:0]
        return np.flatnonzero(t > np.maximum.accumulate(np.concatenate([[newest], t[:-1]])))

    def _stretch(self, t: Array, k: int) -> int:
        """End of the stretch of samples from k on: at a gap, or with the sample at which the next
        fix is due.
        """
        if k + 1 == len(t):
            return k + 1
        gaps = np.flatnonzero(np.diff(t[k:]) > self.config.longest_gap)
        end = k + 1 + int(gaps[0]) if len(gaps) else len(t)
        if self._pending:
            due = self._pending[0].due(self.config.settle)
            end = min(end, k + 1 + int(np.searchsorted(t[k:], due, side="left")))
        return end

    def _take(self, imu: Array) -> None:
        """Samples in which there is no gap, but maybe one before them."""
        length = imu[0, 0] - self._live.newest()
        if self.config.longest_gap < length < math.inf:
            self._after_gap(length)
        if self._live.navigating:
            self._live.feed(imu)
        else:
            self._startup.feed(imu)
            self._wait()

    def fix(self, fix: Fix) -> None:
        """Take a fix; it is used, and answered for, once samples have passed its arrival."""
        if not fix.due(self.config.settle) < self._live.newest() + FUTURE:
            self.counts["ahead"] += 1  # samples have stopped, or the clocks are not one clock
            return
        self._pending.append(fix)
        self._pending.sort(key=lambda f: f.due(self.config.settle))

    def _after_gap(self, length: float) -> None:
        log.warning("%.2f s without samples: heading must be found again", length)
        self._startup.after_gap(self.nominal if self._live.navigating else None)
        self._live.stop()
        self._wait()

    def _wait(self) -> None:
        self.mode = Mode.COURSE if self._startup.align.levelled else Mode.LEVELLING

    # -- fixes

    def _use(self, fix: Fix) -> Correction:
        reason = self.config.fix.objection(fix)
        if reason:
            return self._refuse(nothing_compared(fix), "rejected", reason)
        fix = self.watch.take(fix.beside(self._datum if self._measured_height else None))
        self.counts["dragged"] += fix.drag > 0.0
        if self._origin is None:
            self._origin = (fix.latitude, fix.longitude, fix.height)
        elif fix.has_height and not math.isfinite(self._origin[2]):
            self._origin = (*self._origin[:2], fix.height)
        if not self._live.navigating:
            return self._start(fix)
        if self._live.too_late(fix.t):
            age = self._live.newest() - fix.t
            late = f"{age:.2f} s old: before the last one used, or too old"
            return self._refuse(nothing_compared(fix), "late", late)
        result = self._live.take(core_fix(fix, self.config.fix))
        said = correction_of(fix, result)
        self._tell_wheels(result)
        if not said.accepted:
            count = "rejected" if result.status == results.REJECTED else "withheld"
            return self._refuse(said, count, said.reason)
        self._count(result.status)
        self.horizon = said.horizon
        self._took(fix)
        return said

    def _tell_wheels(self, result: Any) -> None:
        self.wheels = Wheels(result.wheels)
        if result.switched:
            log.info("%s", WHEELS[self.wheels])

    @property
    def text(self) -> str:
        """For people: what the alignment does or waits for; while navigating how it was found, and
        what is believed of the vehicle.
        """
        if not self._live.navigating:
            return self._startup.align.text
        return "; ".join(part for part in (self._how, WHEELS[self.wheels]) if part)

    def _count(self, status: int) -> None:
        if status == results.READMITTED:
            log.warning(
                "%d fixes in a row rejected: covariance raised, fix taken",
                self.config.fix.readmit_after,
            )
            self.counts["readmitted"] += 1
        self.counts["doubted"] += status == results.DOUBTED

    def _took(self, fix: Fix) -> None:
        self._last_fix = fix
        self._last_used = fix.t
        if fix.has_height:
            self._datum, self._measured_height = fix.datum, True
        self.counts["used"] += 1

    def _refuse(self, said: Correction, count: str, reason: str) -> Correction:
        self.counts[count] += 1
        return replace(said, accepted=False, reason=reason)

    def _start(self, fix: Fix) -> Correction:
        """Before navigation: watch the speed, and start once the alignment knows the heading."""
        if fix.withheld:
            return self._refuse(nothing_compared(fix), "withheld", WITHHELD)
        start = self._startup.fix(fix)
        if start is not None:
            self._begin(start, fix)
            log.info("%s: navigating", start.how)
        self._took(fix)
        return replace(nothing_compared(fix), reason="aligning")

    def _begin(self, start: Start, fix: Fix) -> None:
        leg = first_leg(self.config, self.filter, start, fix)
        self._live.begin(leg, self.filter.memory(leg.P, self._startup.still_f))
        self._how = start.how
        self.wheels = Wheels.ON_TRIAL if self._live.memory.trial.running else Wheels.NONE
        self.mode = Mode.NAVIGATING

    # -- output

    def solution(self) -> Solution:
        """The newest sample's solution; before navigation the last fix, with sigmas that say so."""
        newest = self._live.newest()
        t = newest if math.isfinite(newest) else 0.0
        if not self._live.navigating:
            return self._waiting_solution(t)
        x, P = self.nominal, self.covariance()
        place = (x.latitude, x.longitude, x.height)
        solution = Solution(
            t,
            self.mode,
            *place,
            np.array(ned_between(self._known_origin(), place)),
            x.v_n,
            from_matrix(x.C_nb),
            x.bias_accel,
            x.bias_gyro,
            np.sqrt(np.diag(P)[:15]),
            P[DP, DP] * np.outer(HEIGHT_UP, HEIGHT_UP),
            self._origin,
            t - self._last_used,
            self.horizon,
            self._datum,
            self.text,
        )
        return as_known(solution, self._measured_height)

    def _known_origin(self) -> tuple[float, float, float]:
        """The origin to count from; at height 0 as long as no fix had one."""
        if self._origin is None:
            return 0.0, 0.0, 0.0
        north, east, height = self._origin
        return north, east, height if math.isfinite(height) else 0.0

    def _waiting_solution(self, t: float) -> Solution:
        c, fix, align = self.config, self._last_fix, self._startup.align
        age = t - self._last_used
        v, where = np.zeros(3), (math.nan, math.nan, math.nan)
        sigma_p, sigma_v = np.full(3, 1e7), np.full(3, 100.0)
        if fix is not None:
            fix = fix.filled()
            where, sigma_p = (fix.latitude, fix.longitude, fix.height), fix.sigma_p
            if fix.v_n is not None:
                # 2 m/s^2: how fast a car changes its mind
                v, sigma_v = fix.v_n, fix.sigma_v + 2.0 * age
            sigma_p = sigma_p + (np.abs(v) + 1.0) * age
        tilt = c.sigma_tilt if align.levelled else math.pi
        biases = [c.sigma_bias_accel] * 3 + [c.sigma_bias_gyro] * 3
        solution = Solution(
            t,
            self.mode,
            *where,
            np.array(ned_between(self._known_origin(), where)),
            v,
            from_matrix(align.C),
            np.zeros(3),
            align.gyro_bias,
            np.concatenate([[tilt, tilt, math.pi], sigma_v, sigma_p, biases]),
            np.diag(sigma_p**2),
            self._origin or (0.0, 0.0, 0.0),
            age,
            None,
            self._datum,
            align.text,
        )
        return as_known(solution, self._measured_height)


def _maker(name: str) -> Callable[..., Navigator]:
    return lambda config=NavigatorConfig(): Navigator(config, filter_of(name))


NAVIGATORS: dict[str, Callable[..., Navigator]] = {name: _maker(name) for name in FILTERS}

__all__ = ["INNOVATIONS", "NAVIGATORS", "Correction", "Mode", "Navigator", "NavigatorConfig"]
__all__ += ["Solution", "first_leg"]
