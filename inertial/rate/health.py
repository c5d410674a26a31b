"""Which accelerometer axis can be believed: faults named, excluded, and taken back when the axis is
good again.

HealthMonitor takes the samples of one board. Single axes give themselves away sample by sample
(axis_samples.py); for the rest a rigid-body filter (parity.py) runs on blocks of samples, and when
its NIS stays beyond its gate, the newest blocks are run again from a state before that under every
hypothesis about one axis or two: offset, mirrored, swapped, or not to be used at all. The likeliest
names the fault, if it fits and no other axis explains it as well.
Deterministic: no time of day, no random. docs/equations-layouts.md, H-1 to H-10.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inertial.layouts.layout import Layout
from inertial.rate import axis_samples, parity
from inertial.rate.axis_belief import Belief
from inertial.rate.axis_fault import AxisState
from inertial.rate.axis_verdicts import Verdicts, mute
from inertial.rate.health_config import STANDSTILL, Config, Counts, Newest, Part
from inertial.rate.hypotheses import Finding, History, Known, explain, start
from inertial.rate.samples import BRIDGED

Array = NDArray[np.float64]


# Faults that the others give away. Of more than a sixth of the axes, who are the others?
BY_OTHERS = (AxisState.SWAPPED, AxisState.FLIPPED, AxisState.BIASED)

# Blocks from one question to the next, and once readings could not be explained time and again.
ASK, ASK_LESS = 3, 12


class HealthMonitor:
    """Health of every axis of one board."""

    def __init__(self, layout: Layout, period_s: float = 0.01, config: Config = Config()) -> None:
        """period_s: of the samples. Layouts of fewer than seven axes are watched axis by axis
        only.
        """
        self.layout, self.config, self.period_s = layout, config, period_s
        n = layout.axes
        self.per_block = max(1, round(config.block_s / period_s))
        self.counts = Counts()
        self.verdicts = Verdicts(layout, config, self.counts)
        self.faults, self.used = self.verdicts.faults, self.verdicts.used
        self.newest = Newest(np.zeros(n), np.ones(n))
        self.message = ""
        self._mask = 0
        self._beyond_belief = False
        self._sees = bool(np.isfinite(layout.gdop))
        self.belief = Belief(layout, config, self.per_block)
        self._near = np.zeros((axis_samples.KEPT, n))
        self._marks = np.zeros(axis_samples.MARKS, dtype=np.int64)
        self._count = axis_samples.counters(n)
        self._whose = np.zeros((3, n), dtype=bool)  # stuck, at the end of its range, spiking
        self._forget_samples()
        self.history = History(n)
        self._x: Array | None = None
        self._P = np.eye(parity.STATES)
        self._sum, self._doubted = 0.0, False  # of NIS beyond the gate; it is so much
        self._asked = 0
        self._t = 0.0
        self._gap_s = 0.0
        self._quiet = 0
        self._clean_blocks = 0

    # --- what others ask

    @property
    def mask(self) -> int:
        """Bit k: axis k is excluded; all of them where so many do not fit that none is believed."""
        return (1 << self.layout.axes) - 1 if self._beyond_belief else self._mask

    @property
    def doubted(self) -> bool:
        """Readings do not fit one motion: nothing that is made of them is valid (H-15)."""
        return self._doubted or self._clean_blocks > self.counts.blocks

    def _known(self) -> Known:
        belief = self.belief
        return Known(
            self.layout, self.used, belief.learned, belief.constants(), belief.tuning(), belief
        )

    # --- samples

    def step(self, t_s: float, f_axis: Array, stale: int = 0) -> None:
        """One sample: t_s (s, board's clock), readings (N,) m/s^2, bit k of `stale`: axis k was not
        fresh.
        """
        self.feed(np.array([t_s]), np.asarray(f_axis)[None], stale)

    def feed(self, t_s: Array, f_axis: Array, stale: int = 0) -> list[Part]:
        """Samples at t_s (n,), s, board's clock, readings (n, N) m/s^2; how they are batched
        changes nothing.

        Returns the batch cut where the mask or the doubt changed. A change holds from the very
        sample that made it.
        """
        f, row, parts = np.ascontiguousarray(f_axis, dtype=np.float64), 0, []
        said = self.mask, self.doubted
        near, marks = self._near, self._marks
        while row < len(f):
            row = axis_samples.gather(
                f,
                row,
                self.per_block,
                near,
                marks,
                self.belief.noise,
                self.belief.limits,
                self.belief.free,
                self._count,
            )
            self._stale |= stale
            filled = int(marks[axis_samples.FILLED])
            if filled < self.per_block:
                break
            self._t, block = float(t_s[row - 1]), near[axis_samples.SUM] / filled
            dt, self._gap_s = filled * self.period_s + self._gap_s, 0.0
            marks[axis_samples.FILLED], self._last = 0, f[row - 1]
            near[axis_samples.SUM] = 0.0
            self._block(block, dt)
            self._stale = 0
            if said != (now := (self.mask, self.doubted)):
                parts.append(Part(row - 1, *said))
                said = now
        return [*(part for part in parts if part.end > 0), Part(len(f), *said)]

    def skip(self, samples: int) -> None:
        """Samples are missing before the next one."""
        self._gap_s += samples * self.period_s
        if samples <= BRIDGED:
            return
        self._forget_samples()
        if self._x is not None:
            self._P[parity.MOTION, parity.MOTION] += np.diag(
                [(10.0 * self._gap_s) ** 2] * 3 + [100.0**2] * 3
            )
            self.history.clear()
            self._sum = 0.0

    def _forget_samples(self) -> None:
        self._near[: axis_samples.USUAL] = 0.0
        self._marks[: axis_samples.HEARD] = 0
        self._last = np.zeros(self.layout.axes)
        self._stale = 0
        self._count[axis_samples.SAME] = 0

    # --- blocks

    def _block(self, block: Array, dt: float) -> None:
        self.counts.blocks += 1
        ratio = axis_samples.measured_noise(self._near, self._marks, self.belief.free)
        self.belief.hear(ratio, axis_samples.resolution(self._near, self.belief.noise))
        self._single_axes()
        if self._sees and np.count_nonzero(self.used) > 6:
            self._check(block, dt)
        self._mask = self.verdicts.mask
        if self._mask:
            still_mute = mute(self._whose, self._count, self._stale)
            about = (self._t, block, self.per_block * self.period_s, self.newest, still_mute)
            if self.verdicts.returns(*about, self.belief):
                self.history.clear()
            self._mask = self.verdicts.mask
        doubted = sum(fault.excluded and fault.state in BY_OTHERS for fault in self.faults)
        self._beyond_belief = doubted > self.layout.axes // 6
        if self._mask:
            none = "none is believed: check wiring and layout" if self._beyond_belief else ""
            parts = f"axes: {self.verdicts.text}", none, self.belief.width.text
            self.message = "; ".join(filter(None, parts))
        elif self.counts.blocks - self._clean_blocks > 0:
            self.message = self.belief.width.text

    def _single_axes(self) -> None:
        """Stuck, saturated, spiking, stale: seen without a model."""
        c, count = self.config, self._count
        fewest = (
            round(c.stuck_s / self.period_s),
            max(3, round(c.limit_s / self.period_s)),
            c.spikes,
        )
        coarse = self.belief.rounded > 0.0
        if not axis_samples.flags(count, *fewest, coarse, self._whose) and not self._stale:
            return
        stuck, limit, spiking = self._whose
        for i in range(len(self.faults)):
            if limit[i]:
                self._name(
                    i, AxisState.SATURATED, f"at the end of its range, {self._last[i]:+.1f} m/s²"
                )
            elif stuck[i]:
                self._name(
                    i,
                    AxisState.STUCK,
                    f"reads exactly {self._last[i]:.3f} m/s² for {c.stuck_s:g} s and more",
                )
            elif spiking[i]:
                self._name(
                    i, AxisState.SPIKING, f"{count[axis_samples.SPIKES, i]} single samples far off"
                )
            elif self._stale >> i & 1:
                self._name(i, AxisState.STALE, "the board says it was not fresh")

    def _check(self, block: Array, dt: float) -> None:
        c = self.config
        known = self._known()
        if self._x is None:
            self._x, self._P = start(known, block)
        before = (self._x, self._P)
        x, P, nis, _, residual, sigma = parity.step(
            *before, block, dt, known.used, known.learned, known.constants, known.tuning
        )
        if not math.isfinite(nis):
            return self._restart()
        self._x, self._P = x, P
        degrees = np.count_nonzero(self.used)
        self.newest = Newest(residual, sigma, nis, degrees, True)
        expected = c.gate * (degrees - 6) + 6.0
        self._sum = max(0.0, self._sum + min(nis, 4.0 * degrees) - expected)
        self.history.add(block, dt, *before, self._sum == 0.0)
        self._doubted = bool(self._sum > c.doubt * degrees)
        if self._sum == 0.0:
            self._asked = 0
            self.verdicts.clear_suspects(self._t)
            self._learn(self.history.all_well(STANDSTILL))
        elif self._at_first_rest():  # offsets larger than expected are learned, not blamed
            self._doubted = False
            self._learn(True)
        elif self._sum > c.alarm * degrees:
            self._asked += 1
            if self._asked % (ASK if self.counts.restarts < 3 else ASK_LESS) == 1:
                self._ask()

    def _ask(self) -> None:
        """The readings do not fit: which axis, and what is wrong with it?"""
        c = self.config
        late = self.history.since_onset() * self.per_block * self.period_s >= c.decide_s
        finding = explain(self.history, self._known(), late)
        if finding is None:
            if late:
                self._restart()
            return
        if finding.axes and not finding.sure:
            self.verdicts.suspect(finding.axes)
            return
        self._adopt(finding)

    def _adopt(self, finding: Finding) -> None:
        self._x, self._P, self._sum, self._asked = finding.x, finding.P, 0.0, 0
        self._doubted = False
        self.history.clear()
        if finding.width is not None:
            self.belief.width = finding.width
            self.counts.widened += 1
            self.verdicts.clear_suspects(self._t)
            return
        if not finding.axes:
            self.counts.explained_by_start += 1
            return
        for i in finding.axes:
            state, text = finding.state, finding.text
            if self._count[axis_samples.SAME, i] >= 8:
                state, text = AxisState.STUCK, "reads exactly the same again and again"
            elif self._count[axis_samples.LIMIT_AGE, i] < 0.2 / self.period_s:
                state, text = AxisState.SATURATED, "at the end of its range"
            partner = next((k for k in finding.axes if k != i), -1)
            self._name(i, AxisState(state), text, finding.kind, partner, finding.offset)

    def _name(self, i: int, state: AxisState, text: str, *about: Any) -> None:
        if self.verdicts.name(i, self._t, state, text, *about):
            self._forget_fault_in_state()

    def _forget_fault_in_state(self) -> None:
        """The filter believed the axis until now: run the newest blocks again without it."""
        again = self.history.replay_without(self._known())
        if again is not None:
            (self._x, self._P), self._sum, self._doubted = again, 0.0, False

    def _restart(self) -> None:
        self.counts.restarts += 1
        self.message = (
            "readings do not fit the motion of one rigid body, and no single axis explains it"
        )
        self._clean_blocks = self.counts.blocks + 25
        self._x, self._sum, self._asked, self._doubted = None, 0.0, 0, False
        self.history.clear()
        self.verdicts.clear_suspects(self._t)

    # --- standstill

    def _learn(self, ready: bool) -> None:
        """Offsets of the axes in use from two seconds of standstill; what is along p stays p's."""
        full = len(self.history.blocks) >= STANDSTILL
        self._quiet = self._quiet + 1 if full and ready else 0
        if self._quiet % 10 != 1:
            return
        mean = self.belief.standing(self.history.blocks, self.used)
        if mean is None:
            return
        if not self.belief.learned.any():
            self._leave_out_far_off(mean)
        if not self.belief.learn(mean, self.used):
            return
        self.history.clear()  # states of before belong to other offsets
        if self._sum > 0.0:  # it believed in a motion that there is not
            self._x, self._P = start(self._known(), mean)
            self._sum, self._asked = 0.0, 0
            self.verdicts.clear_suspects(self._t)
        self._quiet = 0
        omega = parity.OMEGA
        self._x[omega], self._P[omega, :], self._P[:, omega] = 0.0, 0.0, 0.0
        self._P[omega, omega] = 0.1**2 * np.eye(3)

    def _leave_out_far_off(self, mean: Array) -> None:
        """Axes that the first standstill shows to be far off."""
        for i, off in self.belief.far_off(mean, self.used).items():
            text = f"at rest {off:+.2f} m/s² off the others: calibrate it"
            self._name(i, AxisState.BIASED, text, parity.OFFSET_OF, -1, off)

    def _at_first_rest(self) -> bool:
        """No standstill was learned yet, and so far the readings are those of one."""
        if self.belief.learned.any():
            return False
        mean = self.belief.standing(self.history.blocks, self.used)
        return mean is not None and self.belief.credible(mean, self.used)
