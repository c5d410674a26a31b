"""The last moments of a board: what the table does, how it shakes, which way is up. In the board's
time.
"""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sessions.procedure.model import DEG
from sessions.procedure.seen import Axes, Pulse, Samples, Turned

Array = NDArray[np.float64]

KEPT = 1.5  # s
THIN = 0.01  # s, one estimate in so long is kept
MEAN = 0.3  # s, over which pulses are averaged
SILENCE = 0.6  # s without a pulse: the table stands, as in the report
OVERDUE, LATE_S = 3.0, 0.05  # times the usual interval, and s: a pulse should have come
FRESH = 1.0  # s that an estimate is believed
TABLE_FRESH = 2.5  # s that a table's own word is
STEADY = 1.0 * DEG  # rad/s, between two words of a table
WINDOW = 0.5  # s, of vibration and of the direction of gravity


@dataclass(frozen=True)
class Reference:
    """What the table does, and who says so."""

    omega: float  # rad/s
    signed: bool
    source: str  # tachometer, or the name of an estimator


class Estimate(NamedTuple):
    """One estimator at one moment, about z_b."""

    estimator: str
    t: float  # s
    omega: float  # rad/s
    sigma: float  # rad/s
    valid: bool
    still: bool
    aided: bool  # by the tachometer


@dataclass
class Evidence:
    """Of one boot; `forget` begins with another."""

    health: deque[Axes] = field(default_factory=deque)
    pulses_seen: bool = False  # in this boot or an earlier one: there is a tachometer
    pulses: deque[Pulse] = field(default_factory=deque)
    estimates: deque[Estimate] = field(default_factory=deque)
    samples: deque[tuple[Array, Array]] = field(default_factory=deque)
    own_axes: bool = True
    table: tuple[float, float] | None = None  # s, rad/s: what a driven table said last
    _table_before: tuple[float, float] | None = None
    _thinned: dict[str, int] = field(default_factory=dict)

    def forget(self) -> None:
        """The board's clock begins anew."""
        self.pulses.clear()
        self.estimates.clear()
        self.samples.clear()
        self.health.clear()
        self.table = self._table_before = None

    def axes(self, t: float) -> Axes | None:
        """The newest word on the axes up to a moment."""
        return next((one for one in reversed(self.health) if one.t <= t), None)

    def table_says(self, t: float, omega: float) -> None:
        """What a driven table reads on itself, rad/s."""
        self._table_before, self.table = self.table, (t, omega)

    def steady(self, t: float) -> float | None:
        """What a driven table says, rad/s, where it has said it twice and lately."""
        if self.table is None or self._table_before is None:
            return None
        (before, first), (at, omega) = self._table_before, self.table
        fresh = t - at < TABLE_FRESH and at - before < TABLE_FRESH
        return omega if fresh and abs(omega - first) < STEADY else None

    def votes(self, t: float) -> list[Estimate]:
        """Estimators that know the rate without the tachometer."""
        return [one for one in self.newest(t) if not one.aided and (one.valid or one.still)]

    def add_pulse(self, seen: Pulse) -> None:
        """One rate of the tachometer."""
        self.pulses.append(seen)
        self.pulses_seen = True

    def add_samples(self, t: Array, seen: Samples) -> None:
        """The samples of a batch that are newer than those before: the last ones, at times t."""
        self.own_axes = seen.own_axes
        self.samples.append((t, seen.f_axis[-len(t) :]))

    def add_estimates(self, seen: Turned) -> None:
        """A batch of estimates, thinned on the board's clock."""
        columns = (seen.t, seen.omega, seen.sigma, seen.valid, seen.still)
        for t, omega, sigma, valid, still in zip(*map(np.ndarray.tolist, columns), strict=True):
            place = int(t / THIN)
            if self._thinned.get(seen.estimator) != place:
                self._thinned[seen.estimator] = place
                one = Estimate(seen.estimator, t, omega, sigma, valid, still, seen.aided)
                self.estimates.append(one)

    def trim(self, t: float) -> None:
        """Leave out what no look at t or later asks for."""
        old = t - KEPT
        while len(self.samples) > 1 and self.samples[0][0][-1] < old:
            self.samples.popleft()
        while self.pulses and self.pulses[0].t < old:
            self.pulses.popleft()
        while len(self.health) > 1 and self.health[1].t < old:
            self.health.popleft()
        while self.estimates and self.estimates[0].t < old:
            self.estimates.popleft()

    def reference(self, t: float) -> Reference | None:
        """What the table does; None where nobody knows."""
        if self.pulses_seen:
            near = [p for p in self.pulses if t - MEAN < p.t <= t]
            if not near:
                near = [p for p in self.pulses if t - SILENCE < p.t <= t][-1:]
            if not near:
                return Reference(0.0, True, "tachometer")
            mean = float(np.mean([p.omega for p in near])) * self._slowed(t)
            return Reference(mean, all(p.signed for p in near), "tachometer")
        if self.table is not None and abs(t - self.table[0]) < TABLE_FRESH:
            return Reference(self.table[1], True, "table")
        for one in self.newest(t):
            if one.still or one.valid:
                return Reference(0.0 if one.still else one.omega, True, one.estimator)
        return None

    def overdue(self, t: float) -> bool:
        """Pulses should have come."""
        return self._slowed(t) < 1.0 or not any(t - SILENCE < p.t <= t for p in self.pulses)

    def _slowed(self, t: float) -> float:
        """At most this share of the rate is left where pulses are overdue: 0 to 1."""
        times = [p.t for p in self.pulses if p.t <= t][-6:]
        if len(times) < 2:
            return 1.0
        usual = max(b - a for a, b in zip(times, times[1:], strict=False))
        since = t - times[-1]
        return usual / since if since > OVERDUE * usual + LATE_S else 1.0

    def newest(self, t: float) -> Iterator[Estimate]:
        """The newest estimate of each estimator up to a moment, if it is fresh."""
        found: dict[str, Estimate] = {}
        for one in self.estimates:
            if t - FRESH < one.t <= t + 1e-9:
                found[one.estimator] = one
        return iter([found[name] for name in sorted(found)])

    def vibration(self, t: float, reference: Reference | None) -> float | None:
        """RMS over the axes, m/s^2, of what is neither slow nor once a revolution."""
        window = self._window(t)
        if window is None:
            return None
        times, rows = window
        return shaking(times - t, rows, 0.0 if reference is None else reference.omega)

    def force(self, t: float) -> Array | None:
        """Mean specific force, (3,) m/s^2 in b; None where the axes' directions are not known."""
        window = self._window(t)
        if window is None:
            return None
        mean = window[1].mean(axis=0)
        if not self.own_axes:
            return mean
        axes = self.axes(t)
        if axes is None or len(axes.direction_b) != len(mean):
            return None
        return np.linalg.lstsq(axes.direction_b, mean, rcond=None)[0]

    def _window(self, t: float) -> tuple[Array, Array] | None:
        if not self.samples:
            return None
        width = self.samples[-1][1].shape[1]
        if any(rows.shape[1] != width for _, rows in self.samples):
            return None
        times = np.concatenate([part for part, _ in self.samples])
        at = (times > t - WINDOW) & (times <= t + 1e-9)
        if at.sum() < 10 or times[at][-1] - times[at][0] < 0.6 * WINDOW:
            return None
        return times[at], np.concatenate([rows for _, rows in self.samples])[at]


def shaking(t: Array, rows: Array, omega: float) -> float:
    """RMS over the axes of readings (n, k), m/s^2 at times (n,) s, without what is slow, and
    without gravity as it goes round on a tilted table that turns at omega, rad/s.
    """
    columns = [np.ones_like(t), t, t**2]
    if abs(omega) > 10.0 * DEG:  # slower ones are in the parabola
        columns += [np.cos(omega * t), np.sin(omega * t)]
    design = np.column_stack(columns)
    rest = rows - design @ np.linalg.lstsq(design, rows, rcond=None)[0]
    return float(np.sqrt((rest**2).sum() / max(1, len(t) - len(columns)) / rows.shape[1]))
