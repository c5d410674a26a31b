"""Samples and tachometer reports become windows at rest and at a steady rate: what settings are
judged by.

A window is a quarter of a second. At rest it is quiet and its products show no turn; steady it is
while the tachometer reads the same over two windows and more. Biases drop out: of every steady
window only the difference from the newest rest counts. What is said needs several windows that
agree, and it is withdrawn when they do so no more. SI units, body frame b.
"""

from collections import deque
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from inertial.constants import GRAVITY
from inertial.doubts.axes import agree_on_gravity, doubt_of_axes
from inertial.doubts.ratio import Ramp, Steady, doubt_of_ratio
from inertial.layouts.layout import Layout
from inertial.plausible import Doubt, doubt_of_gravity

Array = NDArray[np.float64]

WINDOW_S = 0.25
KEPT = 160  # windows of each kind: the newest 40 s
QUIET = 4.0  # times the noise of an axis, within a window at rest
SLOW = 6.0  # rad^2/s^2, of products at rest: what biases of 40 mg make of 5 cm
TURNS = 2.0  # rad/s, of a steady rate; slower ones the biases' drift could make
ALIKE = 0.02  # relative, of the tachometer within a plateau
REST_ENOUGH = 8  # windows, 2 s
ENOUGH_PULSES = 50
LONGEST_RAMP_S = 4.0  # then what the axes are off by has grown too far


@dataclass
class SettingsWatch:
    """Feed it samples and tachometer reports in order; ask it for its doubts."""

    layout: Layout
    lsb_mg: float | None = None  # what a count was taken for, where a log has counts
    live: bool = True  # how the remedy is put: a board's setting, or a log's option
    rests: deque[Array] = field(default_factory=lambda: deque(maxlen=KEPT))  # means (N,)
    steady: deque[Steady] = field(default_factory=lambda: deque(maxlen=KEPT))
    ramps: deque[Ramp] = field(default_factory=lambda: deque(maxlen=KEPT))

    def __post_init__(self) -> None:
        self._rows: list[Array] = []
        self._count, self._last_t, self._period_s = 0, None, 0.01
        self._reports: list[float] = []  # |rate| since the window began
        self._rate: float | None = None  # of the window before
        self._heard = False
        self._stretch = 0
        self._turned: Array | None = None  # readings over the newest rest, integrated since it
        self._turned_s = 0.0
        self._pulses = _Pulses()
        self._force = np.linalg.pinv(self.layout.J)[3:]
        self._sees_all = self.layout.rank == 12

    def tacho(self, t_s: float, rate: float, pulses: int | None = None) -> None:
        """A report of the tachometer, rad/s, signed or not; pulses: counted since boot."""
        self._heard = True
        self._reports.append(abs(rate))
        self._pulses.add(t_s, abs(rate), pulses)

    def gap(self) -> None:
        """Samples are missing: the window and the ramp begin anew."""
        self._rows, self._count = [], 0
        self._reports, self._rate, self._turned = [], None, None

    def feed(self, t_s: Array, f_axis: Array) -> None:
        """Readings of the axes (n, N), m/s^2, at t_s (n,) s."""
        if self._last_t is not None and len(t_s) > 1:
            self._period_s = float(t_s[1] - t_s[0])
            if t_s[0] - self._last_t > 1.5 * self._period_s or t_s[0] <= self._last_t:
                self.gap()
        self._last_t = float(t_s[-1])
        self._rows.append(f_axis)
        self._count += len(f_axis)
        if self._count * self._period_s >= WINDOW_S:
            self._close(np.concatenate(self._rows))
            self._rows, self._count = [], 0

    def doubts(self, spoilt: bool = False) -> list[Doubt]:
        """What is certain now; one cause at a time, since one explains the others. spoilt: an axis
        is known to be, then nothing is said of rates.
        """
        if len(self.rests) < REST_ENOUGH:
            return []
        rest = np.mean(np.array(self.rests), axis=0)
        one = agree_on_gravity(self.layout, rest)
        scaled = self._gravity() if one else None
        if scaled is not None:
            return [scaled]
        if not self._sees_all:
            return []
        wired = doubt_of_axes(
            self.layout,
            rest,
            [w.mean - w.rest for w in self.steady],
            [(ramp.turned, ramp.steady) for ramp in self.ramps],
        )
        if wired is not None or spoilt or not one:
            return [] if wired is None else [wired]
        found = doubt_of_ratio(
            self.layout, list(self.steady), list(self.ramps), self._pulses.per_rev, self.live
        )
        return [] if found is None else [found]

    def _gravity(self) -> Doubt | None:
        forces = np.array(self.rests) @ self._force.T
        sizes = np.linalg.norm(forces, axis=1)
        if sizes.std() > 0.05 * sizes.mean():
            return None
        return doubt_of_gravity(forces, self.lsb_mg, self.live)

    def _close(self, rows: Array) -> None:
        mean, scatter = rows.mean(axis=0), rows.std(axis=0)
        reports, self._reports = self._reports, []
        if self._still(mean, scatter, reports):
            self.rests.append(mean)
            self._turned, self._turned_s = np.zeros(len(mean)), 0.0
            self._rate = 0.0
            return
        if not self._sees_all or not self.rests:
            return
        rest = self.rests[-1] if len(self.rests) < 4 else np.mean(list(self.rests)[-4:], axis=0)
        motion = self.layout.field_inverse @ (mean - rest)
        seconds = len(rows) * self._period_s
        if self._turned is not None:
            self._turned = self._turned + (mean - rest) * seconds
            self._turned_s += seconds
        self._plateau(mean, rest, motion, reports)

    def _plateau(self, mean: Array, rest: Array, motion: Array, reports: list[float]) -> None:
        rate = float(np.mean(reports)) if reports else None
        before, self._rate = self._rate, rate
        spread = max(reports) - min(reports) if reports else 0.0
        if (
            rate is None
            or before is None
            or rate < TURNS * 0.1
            or spread > ALIKE * rate
            or abs(rate - before) > ALIKE * rate
        ):
            self._stretch += bool(self.steady) and self.steady[-1].stretch == self._stretch
            return
        square = float(motion[6] + motion[9] + motion[11])
        if max(rate, np.sqrt(max(square, 0.0))) < TURNS:
            return
        self.steady.append(Steady(self._stretch, mean, rest, rate, square))
        if self._turned is not None and self._turned_s <= LONGEST_RAMP_S and square > 0.0:
            self.ramps.append(Ramp(self._turned, mean - rest))
        self._turned = None

    def _still(self, mean: Array, scatter: Array, reports: list[float]) -> bool:
        """Whether nothing turns: by the tachometer, by the scatter, and by the products, which a
        wrong scale would make as wrong as gravity.
        """
        if self._heard and (not reports or max(reports) > 0.05):
            return False
        size = float(np.linalg.norm(self._force @ mean)) / GRAVITY
        if size < 1e-3 or np.any(scatter > QUIET * self.layout.noise * max(size, 1.0)):
            return False
        if self._heard or not self._sees_all:
            return True
        products = self.layout.field_inverse[6:] @ mean
        return abs(products[0] + products[3] + products[5]) < SLOW * max(size, 1.0)


class _Pulses:
    """Pulses per revolution as set, of the rates that the gateway made of counted pulses."""

    def __init__(self) -> None:
        self._last: tuple[float, int] | None = None
        self._rate = 0.0
        self._angle = self._count = 0.0

    def add(self, t_s: float, rate: float, pulses: int | None) -> None:
        """One report: the rate holds from the report before to this one."""
        if pulses is None:
            return
        steady = abs(rate - self._rate) <= ALIKE * rate and rate > 0.0
        if self._last is not None and steady:
            seconds, more = t_s - self._last[0], pulses - self._last[1]
            if 0.0 < seconds < 1.0 and more > 0:
                self._angle += rate * seconds
                self._count += more
        self._last, self._rate = (t_s, pulses), rate

    @property
    def per_rev(self) -> int | None:
        """None until enough pulses were counted at a steady rate."""
        if self._count < ENOUGH_PULSES or self._angle <= 0.0:
            return None
        return round(2.0 * np.pi * self._count / self._angle)
