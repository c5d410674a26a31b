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

import numpy as np
from numpy.typing import NDArray

from inertial.layouts.layout import RANK_TOLERANCE, Layout
from inertial.rate import axis_samples, parity
from inertial.rate.axis_fault import AxisState, Fault
from inertial.rate.health_config import STANDSTILL, Config, Counts, Newest
from inertial.rate.hypotheses import Finding, History, Known, explain, start
from inertial.rate.samples import BRIDGED

Array = NDArray[np.float64]


class HealthMonitor:
    """Health of every axis of one board."""

    def __init__(self, layout: Layout, period_s: float = 0.01, config: Config = Config()) -> None:
        """period_s: of the samples. Layouts of fewer than seven axes are watched axis by axis
        only.
        """
        self.layout, self.config, self.period_s = layout, config, period_s
        n = layout.axes
        self.per_block = max(1, round(config.block_s / period_s))
        self.faults = [Fault() for _ in range(n)]
        self.counts = Counts()
        self.newest = Newest(np.zeros(n), np.ones(n))
        self.message = ""
        self._mask = 0
        self._limits = np.array([s.limit for s in layout.sensors])
        self._J, self._Q = np.ascontiguousarray(layout.J), np.ascontiguousarray(layout.Q)
        self._noise = layout.noise
        self._sees = bool(np.isfinite(layout.gdop))
        self.white = self._noise**2 / self.per_block
        self.bias, self.reference = np.zeros(n), np.zeros(n)
        self.offset = (config.offset_sigmas * np.array([s.bias for s in layout.sensors])) ** 2
        self.learned = np.zeros(n, dtype=bool)
        self._count = axis_samples.counters(n)
        self._whose = np.zeros((3, n), dtype=bool)  # stuck, at the end of its range, spiking
        self._forget_samples()
        self.used = np.ones(n, dtype=bool)
        self.history = History(n)
        self._x: Array | None = None
        self._P = np.eye(parity.STATES)
        self._sum = 0.0  # of NIS beyond the gate
        self._asked = 0
        self._t = 0.0
        self._gap_s = 0.0
        self._quiet = 0
        self._clean_blocks = 0

    # --- what others ask

    @property
    def mask(self) -> int:
        """Bit k: axis k is excluded."""
        return self._mask

    def _excluded(self) -> int:
        return sum([1 << k for k, fault in enumerate(self.faults) if fault.excluded])

    def _known(self) -> Known:
        c = self.config
        constants = parity.Constants(
            self._J, self._Q, self.bias, self.reference, self.white, self.offset
        )
        tuning = parity.Tuning(c.sigma_alpha, c.sigma_force, c.scale)
        return Known(self.layout, self.used, self.learned, constants, tuning)

    # --- samples

    def step(self, t_s: float, f_axis: Array, stale: int = 0) -> None:
        """One sample: t_s (s, board's clock), readings (N,) m/s^2, bit k of `stale`: axis k was not
        fresh.
        """
        self.feed(np.array([t_s]), np.asarray(f_axis)[None], stale)

    def feed(self, t_s: Array, f_axis: Array, stale: int = 0) -> list[tuple[int, int]]:
        """Samples at t_s (n,), s, board's clock, readings (n, N) m/s^2; how they are batched
        changes nothing.

        Returns the batch cut where the mask changed: (end, mask) of each part. A change holds from
        the very sample that made it.
        """
        f, row, parts, mask = np.ascontiguousarray(f_axis, dtype=np.float64), 0, [], self.mask
        near, marks = self._near, self._marks
        while row < len(f):
            row = axis_samples.gather(
                f, row, self.per_block, near, marks, self._noise, self._limits, self._count
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
            if self.mask != mask:
                parts.append((row - 1, mask))
                mask = self.mask
        return [*(part for part in parts if part[0] > 0), (len(f), mask)]

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
        n = self.layout.axes
        self._near, self._marks, self._last = (
            np.zeros((3, n)),
            np.zeros(2, dtype=np.int64),
            np.zeros(n),
        )
        self._stale = 0
        self._count[axis_samples.SAME] = 0

    # --- blocks

    def _block(self, block: Array, dt: float) -> None:
        self.counts.blocks += 1
        self._single_axes()
        if self._sees and np.count_nonzero(self.used) > 6:
            self._check(block, dt)
        self._mask = self._excluded()
        if self._mask:
            self._returns(block)
            self._mask = self._excluded()
        if self._mask:
            bad = [
                name
                for name, fault in zip(self.layout.axis_names, self.faults, strict=True)
                if fault.excluded
            ]
            self.message = f"not used: {', '.join(bad)}"
        elif self.counts.blocks - self._clean_blocks > 0:
            self.message = ""

    def _single_axes(self) -> None:
        """Stuck, saturated, spiking, stale: seen without a model."""
        c, count = self.config, self._count
        fewest = (
            round(c.stuck_s / self.period_s),
            max(3, round(c.limit_s / self.period_s)),
            c.spikes,
        )
        if not axis_samples.flags(count, *fewest, self._whose) and not self._stale:
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
        if self._sum == 0.0:
            self._asked = 0
            self._clear_suspects()
            self._learn(block)
        elif self._sum > c.alarm * degrees:
            self._asked += 1
            if self._asked % 3 == 1:
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
            for i in finding.axes:
                if not self.faults[i].excluded:
                    self.faults[i].state, self.faults[i].text = (
                        AxisState.SUSPECT,
                        "inconsistent, looked into",
                    )
            return
        self._adopt(finding)

    def _adopt(self, finding: Finding) -> None:
        self._x, self._P, self._sum, self._asked = finding.x, finding.P, 0.0, 0
        self.history.clear()
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

    def _name(
        self,
        i: int,
        state: AxisState,
        text: str,
        kind: int = parity.IGNORE,
        partner: int = -1,
        offset: float = 0.0,
    ) -> None:
        fault = self.faults[i]
        if fault.excluded and (
            state == fault.state or fault.state not in (AxisState.SUSPECT, AxisState.BIASED)
        ):
            if state == fault.state:
                fault.fits, fault.evidence = 0, 0.0
            return
        relapse = self._t - fault.ended_s < self.config.relapse_s
        fault.relapses = (
            fault.relapses + 1
            if relapse and not fault.excluded
            else fault.relapses
            if relapse
            else 0
        )
        if fault.state in (AxisState.GOOD, AxisState.SUSPECT) and not fault.excluded:
            self.counts.named += 1
        fault.state, fault.text, fault.since_s = state, text, self._t
        fault.kind, fault.partner, fault.offset, fault.evidence, fault.fits = (
            kind,
            partner,
            offset,
            0.0,
            0,
        )
        fault.excluded = fault.excluded or self._spare(i)
        if fault.excluded and self.used[i]:
            self.used[i] = False
            self._forget_fault_in_state()

    def _spare(self, i: int) -> bool:
        """True when the others still see omega' and p."""
        rest = self.used.copy()
        rest[i] = False
        J = self.layout._scaled(self.layout.J[rest])
        return len(J) >= 6 and int(np.linalg.matrix_rank(J, rtol=RANK_TOLERANCE)) == 6

    def _forget_fault_in_state(self) -> None:
        """The filter believed the axis until now: run the newest blocks again without it."""
        again = self.history.replay_without(self._known())
        if again is not None:
            self._x, self._P = again
            self._sum = 0.0

    def _restart(self) -> None:
        self.counts.restarts += 1
        self.message = (
            "readings do not fit the motion of one rigid body, and no single axis explains it"
        )
        self._clean_blocks = self.counts.blocks + 25
        self._x, self._sum, self._asked = None, 0.0, 0
        self.history.clear()
        self._clear_suspects()

    def _clear_suspects(self) -> None:
        for fault in self.faults:
            if fault.state == AxisState.SUSPECT and not fault.excluded:
                fault.state, fault.text, fault.since_s = AxisState.GOOD, "", self._t

    # --- standstill

    def _learn(self, block: Array) -> None:
        """Offsets of the axes in use from two seconds of standstill; what is along p stays p's."""
        self._quiet = self._quiet + 1 if self.history.all_well(STANDSTILL) else 0
        if self._quiet % 10 != 1:
            return
        window = np.array(self.history.blocks[-STANDSTILL:])
        mean, used = window.mean(axis=0), self.used
        scatter = np.mean((window - mean)[:, used] ** 2 / self.white[used])
        trend = np.abs(
            window[: STANDSTILL // 2].mean(axis=0) - window[STANDSTILL // 2 :].mean(axis=0)
        )
        if scatter > 1.5 or np.any(
            trend[used] > 6.0 * np.sqrt(4.0 * self.white[used] / STANDSTILL)
        ):
            return
        off = parity.offsets_at_rest(self.layout.theta_b, mean, used)
        allowed = self.offset + self.white + (self.config.scale * 9.8) ** 2 * 0.1
        if np.any((off - self.bias)[used] ** 2 > 20.0 * allowed[used]):
            return
        self.bias = np.where(used, off, self.bias)
        self.reference = np.where(used, mean, self.reference)
        self.offset = np.where(used, self.config.offset_left**2, self.offset)
        self.learned = self.learned | used
        self.history.clear()  # states of before belong to other offsets
        self._quiet = 0
        omega = parity.OMEGA
        self._x[omega], self._P[omega, :], self._P[:, omega] = 0.0, 0.0, 0.0
        self._P[omega, omega] = 0.1**2 * np.eye(3)

    # --- the way back

    def _returns(self, block: Array) -> None:
        c = self.config
        for i, fault in enumerate(self.faults):
            if not fault.excluded:
                continue
            residual, sigma = float(self.newest.residual[i]), float(self.newest.sigma[i])
            speaks = not any(flags[i] for flags in self._whose) and not self._stale >> i & 1
            calm = self._count[axis_samples.SAME, i] < 8
            fits = speaks and calm and abs(residual) < 4.0 * sigma and self.newest.filled
            fault.fits = fault.fits + 1 if fits else 0
            fault.evidence = (
                fault.evidence
                + fault.favours_good(i, block, self.bias, self.reference, residual, sigma)
                if fits
                else 0.0
            )
            seconds = min(c.good_s * 2.0**fault.relapses, c.longest_good_s)
            enough = (
                fault.fits * self.per_block * self.period_s >= seconds
                and fault.evidence > c.evidence
            )
            partner = self.faults[fault.partner] if fault.partner >= 0 else None
            if enough and (
                partner is None or not partner.excluded or partner.evidence > c.evidence
            ):
                self.used[i] = True
                fault.state, fault.excluded, fault.text = AxisState.GOOD, False, ""
                fault.since_s = fault.ended_s = self._t
                self.counts.returned += 1
                self.history.clear()
