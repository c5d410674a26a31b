"""A whole drive through many filters at once: the live filters' own compiled code, one call between
two gaps.

runs = run_filters(imu, fixes, ["kf", "fpe-fuzzy"])
runs["kf"].error_ned  # (k, 3) m, computed - fix, before the correction
"""

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inertial.navigation import estimate as est
from inertial.navigation.alignment import Start
from inertial.navigation.drag import DragWatch
from inertial.navigation.filters import FilterConfig, filter_of
from inertial.navigation.fix import Fix, fix_row
from inertial.navigation.leg import Leg, copy_leg
from inertial.navigation.mechanise import NOMINAL
from inertial.navigation.navigation import Navigator, NavigatorConfig, first_leg
from inertial.navigation.update import FIX_COLUMNS

Array = NDArray[np.float64]


@dataclass(frozen=True)
class FilterRun:
    """What a filter said of every fix from the start of navigation; k rows, in the order of their
    use.
    """

    name: str
    fixes: list[Fix]
    rows: Array  # (k, OUT), columns in estimate
    began: float  # s, time of the fix that navigation began at; infinite when it never did
    seconds: float  # CPU time of mechanisation, covariance and updates
    epochs: int  # samples in that time
    leg: Leg | None  # the filter at the end

    @property
    def t(self) -> Array:
        """Times (k,) of the fixes, s."""
        return np.array([fix.t for fix in self.fixes])

    @property
    def status(self) -> NDArray[np.int64]:
        """USED, REJECTED, WITHHELD, LATE, READMITTED or DOUBTED of estimate, (k,)."""
        return self.rows[:, est.O_STATUS].astype(np.int64)

    @property
    def fed(self) -> NDArray[np.bool_]:
        """Fixes that the filter used, (k,)."""
        return np.isin(self.status, (est.USED, est.READMITTED, est.DOUBTED))

    @property
    def withheld(self) -> NDArray[np.bool_]:
        """Fixes that it was not given, (k,)."""
        return self.status == est.WITHHELD

    @property
    def innovation(self) -> Array:
        """Computed - measured before the correction, (k, 7): position N E h m, v_n m/s, heading
        rad; NaN: absent.
        """
        return self.rows[:, est.O_Y : est.O_Y + 7]

    @property
    def innovation_sigma(self) -> Array:
        """1-sigma of it as the filter expects, (k, 7)."""
        return self.rows[:, est.O_SIGMA : est.O_SIGMA + 7]

    @property
    def residual(self) -> Array:
        """Computed - measured after the correction, (k, 6); NaN where nothing was corrected."""
        return self.rows[:, est.O_LEFT : est.O_LEFT + 6]

    @property
    def error_ned(self) -> Array:
        """Computed - measured position of the antenna before the correction, (k, 3) m."""
        return self.rows[:, est.O_ERROR : est.O_ERROR + 3]

    @property
    def yaw(self) -> Array:
        """Heading at the time of the fix's velocity, before the correction, (k,) rad."""
        return self.rows[:, est.O_YAW]

    @property
    def nis(self) -> Array:
        """(k,), to be compared with `dof`."""
        return self.rows[:, est.O_NIS]

    @property
    def dof(self) -> Array:
        """Rows of each fix, (k,)."""
        return self.rows[:, est.O_DOF]

    @property
    def horizon(self) -> Array:
        """Fixes looked back, (k,); 0 for filters without a horizon."""
        return self.rows[:, est.O_N]

    @property
    def x(self) -> Array:
        """Nominal state after the fix (before it where it was not used), (k, NOMINAL), slices of
        strapdown.
        """
        return self.rows[:, est.O_X : est.O_X + NOMINAL]

    @property
    def P(self) -> Array:
        """Covariance of psi_n, dv_n, dN dE dh then, (k, 9, 9)."""
        return self.rows[:, est.O_P : est.O_P + 81].reshape(-1, 9, 9)


def run_filters(
    imu: Array,
    fixes: Sequence[Fix],
    filters: Sequence[str] | Mapping[str, FilterConfig],
    config: NavigatorConfig = NavigatorConfig(),
    begin: Callable[[Start], Start] | None = None,
    progress: Callable[[float, str], None] | None = None,
) -> dict[str, FilterRun]:
    """Run filters, by name or made by the caller, over imu (n, 7: t s, f_b m/s^2, omega_ib_b rad/s)
    and fixes.

    The alignment is the live one and done once. `begin` may change its result, to try filters on a
    wrong start. Raises UnknownFilter, and ValueError for samples whose times do not rise.
    """
    chosen = (
        dict(filters)
        if isinstance(filters, Mapping)
        else {name: filter_of(name) for name in filters}
    )
    imu = np.ascontiguousarray(imu, dtype=np.float64)
    if imu.ndim != 2 or imu.shape[1] != 7:
        raise ValueError(f"samples of shape {imu.shape}, want (n, 7): t, force (3), rate (3)")
    fallen = np.flatnonzero(np.diff(imu[:, 0]) <= 0.0)
    if len(fallen):
        raise ValueError(
            f"sample {fallen[0] + 2}: time {imu[fallen[0] + 1, 0]} s is not after the one before it"
        )
    drive = Drive(imu, fixes, config)
    runs = {}
    for i, (name, filter_config) in enumerate(chosen.items()):
        if progress:
            progress(i / len(chosen), name)
        runs[name] = drive.run(name, filter_config, begin)
    if progress:
        progress(1.0, "")
    return runs


class Drive:
    """The samples as the compiled code wants them, the fixes as a table, the alignment once it is
    known.
    """

    def __init__(self, imu: Array, fixes: Sequence[Fix], config: NavigatorConfig) -> None:
        self.t, self.f, self.w = imu[:, 0].copy(), imu[:, 1:4].copy(), imu[:, 4:7].copy()
        self.config = config
        settle = config.settle
        good = [fix for fix in fixes if not config.fix.objection(fix)]
        watch = DragWatch()
        by_use = sorted(good, key=lambda fix: fix.due(settle))
        self.fixes = [
            watch.take(fix) if fix.arrival >= self.t[0] else fix for fix in by_use
        ]  # live they need samples
        self.due = np.array([fix.due(settle) for fix in self.fixes])
        self.table = np.array([fix_row(fix, config.fix) for fix in self.fixes]).reshape(
            -1, FIX_COLUMNS
        )
        self.gaps = (
            np.flatnonzero(np.diff(self.t) > config.longest_gap) + 1
        )  # first samples after one
        self._first: tuple[Navigator, Start, Fix, int] | None = None

    def run(
        self, name: str, chosen: FilterConfig, begin: Callable[[Start], Start] | None
    ) -> FilterRun:
        nav = Navigator(self.config, chosen)
        rows, used = np.empty((len(self.fixes), est.OUT)), []
        k = j = done = epochs = 0
        began, seconds, leg = math.inf, 0.0, None
        while k < len(self.t):
            found = self.align(nav, k, j)
            if found is None:
                break
            start, fix, j = found
            leg = first_leg(self.config, chosen, begin(start) if begin else start, fix)
            level = float(np.linalg.norm(nav.align.mean_f)) if nav.align.levelled else 9.80665
            memory = chosen.memory(nav.model.n, leg.P, level)
            began = min(began, fix.t)
            k = int(np.searchsorted(self.t, fix.t, side="right"))
            behind = self.gaps[self.gaps > k]
            end = int(behind[0]) if len(behind) else len(self.t)
            last = int(np.searchsorted(self.due, self.t[end - 1], side="right"))
            out = rows[done : done + max(0, last - j)]
            clock = time.thread_time_ns()
            est.run(
                leg,
                nav.model,
                nav.settings,
                memory,
                self.t,
                self.f,
                self.w,
                k,
                end,
                self.table[j:last],
                out,
            )
            seconds += (time.thread_time_ns() - clock) * 1e-9
            epochs += end - k
            used += self.fixes[j:last]
            done, j, k = len(used), max(j, last), end
            if k < len(self.t):
                copy_leg(leg, nav._head)
                nav._memory = memory
                nav._after_gap(float(self.t[k] - self.t[k - 1]))
        return FilterRun(name, used, rows[:done].copy(), began, seconds, epochs, leg)

    def align(self, nav: Navigator, k: int, j: int) -> tuple[Start, Fix, int] | None:
        """Feed samples from k and fixes from j as the live path does until navigation can begin.

        Returns the start, its fix and the first fix after it; the first alignment is remembered, it
        is everybody's.
        """
        if k == 0 and self._first is not None:
            seen, start, fix, j = self._first
            nav.align = seen.align
            return start, fix, j
        caught: list[tuple[Start, Fix]] = []
        nav.begin = lambda start, fix: caught.append((start, fix))  # type: ignore[method-assign]
        nav._advance_head = lambda: None  # type: ignore[method-assign]
        nav.watch = None
        for i in range(k, len(self.t)):
            nav.imu(float(self.t[i]), self.f[i], self.w[i])
            while not caught and j < len(self.fixes) and self.due[j] <= self.t[i]:
                nav._use(self.fixes[j])
                j += 1
            if caught:
                start, fix = caught[0]
                if k == 0:
                    self._first = (nav, start, fix, j)
                return start, fix, j
        return None
