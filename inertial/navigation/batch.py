"""A whole drive through many filters at once: the live filters' own compiled code, one call between
two gaps.

runs = run_filters(imu, fixes, ["kf", "fpe-fuzzy"])
runs["kf"].error_ned  # (k, 3) m, computed - fix, before the correction
"""

import copy
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inertial.core import navigation as core
from inertial.navigation import results
from inertial.navigation.alignment import Start
from inertial.navigation.drag import DragWatch
from inertial.navigation.filters import FilterConfig, filter_of
from inertial.navigation.fix import Fix, core_fix
from inertial.navigation.navigation import NavigatorConfig
from inertial.navigation.solution import Wheels
from inertial.navigation.start import Startup, first_leg

Array = NDArray[np.float64]


@dataclass(frozen=True)
class FilterRun:
    """What a filter said of every fix from the start of navigation; k rows, in the order of their
    use.
    """

    name: str
    fixes: list[Fix]
    rows: results.Table  # (k,), columns RESULT
    began: float  # s, time of the fix that navigation began at; infinite when it never did
    seconds: float  # CPU time of mechanisation, covariance and updates
    epochs: int  # samples in that time
    leg: Any  # the core's Leg at the end; None when it never began
    text: str = ""  # for people: how it was aligned, or what the alignment still waits for

    @property
    def t(self) -> Array:
        """Times (k,) of the fixes, s."""
        return np.array([fix.t for fix in self.fixes])

    @property
    def status(self) -> NDArray[np.int32]:
        """USED, REJECTED, WITHHELD, LATE, READMITTED or DOUBTED of results, (k,)."""
        return self.rows["status"]

    @property
    def fed(self) -> NDArray[np.bool_]:
        """Fixes that the filter used, (k,)."""
        return np.isin(self.status, (results.USED, results.READMITTED, results.DOUBTED))

    @property
    def withheld(self) -> NDArray[np.bool_]:
        """Fixes that it was not given, (k,)."""
        return self.status == results.WITHHELD

    @property
    def wheels(self) -> list[tuple[float, Wheels]]:
        """When it began or ceased to believe a car's wheels, s; empty where it never did."""
        return [
            (self.fixes[k].t, Wheels(self.rows["wheels"][k]))
            for k in np.flatnonzero(self.rows["switched"])
        ]

    @property
    def innovation(self) -> Array:
        """Computed - measured before the correction, (k, 7): position N E h m, v_n m/s, heading
        rad; NaN: absent.
        """
        return self.rows["y"]

    @property
    def innovation_sigma(self) -> Array:
        """1-sigma of it as the filter expects, (k, 7)."""
        return self.rows["sigma"]

    @property
    def residual(self) -> Array:
        """Computed - measured after the correction, (k, 6); NaN where nothing was corrected."""
        return self.rows["left"]

    @property
    def error_ned(self) -> Array:
        """Computed - measured position of the antenna before the correction, (k, 3) m."""
        return self.rows["error_ned"]

    @property
    def yaw(self) -> Array:
        """Heading at the time of the fix's velocity, before the correction, (k,) rad."""
        return self.rows["yaw"]

    @property
    def nis(self) -> Array:
        """(k,), to be compared with `dof`."""
        return self.rows["nis"]

    @property
    def dof(self) -> NDArray[np.int32]:
        """Rows of each fix, (k,)."""
        return self.rows["dof"]

    @property
    def horizon(self) -> NDArray[np.int32]:
        """Fixes looked back, (k,); 0 for filters without a horizon."""
        return self.rows["horizon"]

    @property
    def x(self) -> results.Table:
        """Nominal state after the fix (before it where it was not used), (k,), columns NOMINAL."""
        return self.rows["x"]

    @property
    def P(self) -> Array:
        """Covariance of psi_n, dv_n, dN dE dh then, (k, 9, 9)."""
        return self.rows["P"]


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


@dataclass(frozen=True)
class Found:
    """Where a filter takes over from the alignment."""

    startup: Startup
    start: Start
    fix: Fix
    next_fix: int  # place of the first fix after it


class Drive:
    """The samples, the fixes as the core takes them, the alignment once it is known."""

    def __init__(self, imu: Array, fixes: Sequence[Fix], config: NavigatorConfig) -> None:
        self.imu, self.t = imu, imu[:, 0].copy()
        self.config = config
        good = [fix for fix in fixes if not config.fix.objection(fix)]
        watch = DragWatch()
        by_use = sorted(good, key=lambda fix: fix.due(config.settle))
        self.fixes = [
            watch.take(fix) if fix.arrival >= self.t[0] else fix for fix in by_use
        ]  # live they need samples
        self.due = np.array([fix.due(config.settle) for fix in self.fixes])
        self.core_fixes = [core_fix(fix, config.fix) for fix in self.fixes]
        # first samples after one
        self.gaps = np.flatnonzero(np.diff(self.t) > config.longest_gap) + 1
        self._first: Found | None = None
        self.text = ""  # for people: what the alignment of the first start said last

    def run(
        self, name: str, chosen: FilterConfig, begin: Callable[[Start], Start] | None
    ) -> FilterRun:
        """One filter over the whole drive, anew after each gap."""
        model = chosen.model(self.config.imu)
        settings = chosen.settings(self.config.fix, self.config.lever_arm_b)
        rows, used = [np.empty(0, results.RESULT)], []
        began, seconds, epochs, leg = math.inf, 0.0, 0, None
        found = self.first()
        while found is not None:
            start = begin(found.start) if begin else found.start
            leg = first_leg(self.config, chosen, start, found.fix)
            memory = chosen.memory(leg.P, found.startup.still_f)
            began = min(began, found.fix.t)
            k, end, last = self.stretch(found)
            clock = time.thread_time_ns()
            fixes = self.core_fixes[found.next_fix : last]
            rows.append(results.run(leg, model, settings, memory, self.imu, k, end, fixes))
            seconds += (time.thread_time_ns() - clock) * 1e-9
            epochs += end - k
            used += self.fixes[found.next_fix : last]
            if end == len(self.t):
                break
            found.startup.history = core.Live()
            found.startup.after_gap(leg.x)
            found = self._find(found.startup, end, max(found.next_fix, last))
        return FilterRun(name, used, np.concatenate(rows), began, seconds, epochs, leg, self.text)

    def stretch(self, found: Found) -> tuple[int, int, int]:
        """First sample after a start, first one after the gap that ends it, and first fix that is
        due after that.
        """
        k = int(np.searchsorted(self.t, found.fix.t, side="right"))
        behind = self.gaps[self.gaps > k]
        end = int(behind[0]) if len(behind) else len(self.t)
        last = int(np.searchsorted(self.due, self.t[end - 1], side="right"))
        return k, end, max(last, found.next_fix)

    def first(self) -> Found | None:
        """The first start, which is everybody's; None when it is never fit for navigation."""
        if self._first is None:
            startup = Startup(self.config.alignment, core.Live())
            self._first = self._find(startup, 0, 0)
            self.text = startup.align.text if self._first is None else self._first.start.how
        return copy.deepcopy(self._first)

    def _find(self, startup: Startup, k: int, j: int) -> Found | None:
        """Feed samples from k and fixes from j as the live path does until navigation can begin."""
        while k < len(self.t):
            end = len(self.t)
            if j < len(self.due):
                end = min(end, int(np.searchsorted(self.t, self.due[j], side="left")) + 1)
            end = max(end, k + 1)
            for gap in self.gaps[(self.gaps >= k) & (self.gaps < end)]:
                startup.feed(self.imu[k:gap])
                startup.history = core.Live()
                k = int(gap)
            startup.feed(self.imu[k:end])
            k = end
            while j < len(self.fixes) and self.due[j] <= self.t[k - 1]:
                fix, j = self.fixes[j], j + 1
                start = None if fix.withheld else startup.fix(fix)
                if start is not None:
                    return Found(startup, start, fix, j)
        return None
