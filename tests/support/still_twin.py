"""The zero-velocity detector by its definitions: means and sums over slices of all that was read.

Twin of inertial/core/rate/still.cpp, which keeps running sums. What is asked, and why:
inertial/rate/still.py (E-20 to E-25).
"""

import numpy as np

LENGTHS = (4, 8, 16, 32, 64, 128)  # samples over which omega' is summed
DEPTH = 128


class StillTwin:
    """Sample by sample, of a sensor (observed.sensor) with limits (still.Config)."""

    def __init__(self, s, c):
        self.s, self.c = s, c
        self.y = np.zeros((0, 12))
        self.still_for = self.quiet_for = self.slow_for = self.hold = 0
        self.reference, self.learnt, self.learning = np.zeros(12), 0, 0
        self.rows, self.settled, self.walk, self.known, self.dt = [], 0, 0.0, 0.0, 0.01

    def step(self, a, omega, P, dt):
        """One sample (n,), the caller's rate and its covariance: still, depth."""
        self.y = np.vstack([self.y, self.s.W @ a])
        standing, still = self.still_for > 0, self._stands(omega, P, dt)
        depth = self._began() if standing else 0
        if still and not depth:
            self._learn()
            return True, 0
        if standing and not depth:
            depth = min(2 * self.c.window, self.still_for, DEPTH - 8)
        self.still_for = self.learning = 0
        if standing:
            self.quiet_for, self.hold = 0, self.c.hold
        return False, depth

    def _stands(self, omega, P, dt):
        c = self.c
        self.hold = max(0, self.hold - 1)
        quiet, slow = self.quiet_for, self.slow_for
        self.quiet_for = self.slow_for = 0
        if (
            len(self.y) < c.window
            or self._scatter() > 1.0 + (c.spread_limit - 1.0) * np.sqrt(12.0 / (6 + self.s.m))
            or self.hold
        ):
            return False
        told = omega @ np.linalg.solve(P + c.rate_slack**2 * np.eye(3), omega)
        if not self._settled(omega, P, told):
            return False
        windows = (c.window, c.short_window)
        if not self.learnt or all(self._moved(n) <= c.quiet_limit for n in windows):
            self.quiet_for = quiet + 1
            return told < c.rate_limit or self.quiet_for * dt >= c.patience_s
        self.slow_for = slow + 1 if told < c.rate_limit else 0
        return self.slow_for * dt >= 2.0 * c.patience_s

    def _scatter(self):
        """Mean square of y about its mean over the window, over its noise (E-20)."""
        seen = 6 + self.s.m  # omega', c of m numbers, p
        R = np.concatenate([np.diag(self.s.R_alpha), np.diag(self.s.R_c), np.diag(self.s.R_p)])
        return np.sum(self.y[-self.c.window :].var(axis=0, ddof=1) / R) / seen

    def _moved(self, window):
        """Chi-square of the mean [omega', c] against the reference (E-21)."""
        d = (self.y[-window:].mean(axis=0) - self.reference)[:9]
        d[3 + self.s.m :] = 0.0
        seconds = (len(self.y) - self.settled) * self.dt
        leant = self._leant(self.y[-window:].mean(axis=0) - self.reference)
        walked = (leant + self.walk * seconds**2) / self._axis_noise()
        share = 1.0 / window + 1.0 / self.learnt + walked
        variance = self.s.spread * share + self.c.drift**2
        return np.sum((self.s.basis @ d) ** 2 / variance)

    def _settled(self, omega, P, told):
        """Has gravity kept its direction for as long as the rate leaves in doubt (E-25)?"""
        c, most = self.c, np.linalg.norm(omega) + 2.0 * np.sqrt(np.diag(P).max())
        if self.learnt and most < c.sure_rate:
            return True
        span = c.brief_span if self.learnt and most <= c.likely_rate else c.steady_span
        if len(self.y) < span + c.window:
            return False
        before = self.y[-c.window - span : -span, 9:].mean(axis=0)
        d = self.y[-c.window :, 9:].mean(axis=0) - before
        swung = np.sum(d**2 / (np.diag(self.s.R_p) * 2.0 / c.window + c.drift_steady**2))
        return swung <= c.steady_limit and (told >= c.rate_limit or told + swung < c.begin_limit)

    def _began(self):
        """How many samples ago a standing body began to move; 0 while it stands (E-23, E-24)."""
        c, worst, depth = self.c, 1.0, 0
        if self.learning < c.window:
            return 0
        for length in LENGTHS:
            if length >= min(self.still_for, len(self.y) - 1):
                break
            d = self.y[-length:, :3].sum(axis=0) - length * self.reference[:3]
            noise = np.diag(self.s.R_alpha) * length * (1.0 + length / self.learnt)
            late = (0.5 * self.learnt + length) * self.dt
            lag = c.drift_now**2 + late**2 * self.walk * np.diag(self.s.drift)[:3]
            ratio = np.sum(d**2 / (noise + length**2 * lag)) / c.turn_limit
            if ratio > worst:
                worst, depth = ratio, length + length // 2
        d = self.y[-c.window :, 9:].mean(axis=0) - self.reference[9:]
        noise = np.diag(self.s.R_p) * (1.0 / c.window + 1.0 / self.learnt)
        if not depth and np.sum(d**2 / (noise + c.drift_tilt**2)) > c.tilt_limit:
            depth = c.guard
        return min(depth, DEPTH - 8)

    def _learn(self):
        """All of this standstill but the newest `guard` samples becomes the reference."""
        now, c = len(self.y), self.c
        self.still_for += 1
        if self.still_for == 1:
            before = c.window if self.learnt else c.steady_span
            self.rows = list(range(now - 1 - before, now - 1))
        self.learning = max(0, self.still_for - c.guard)
        if not self.learning:
            return
        self.rows.append(now - 1 - c.guard)
        if len(self.rows) >= 100 and len(self.rows) % 8 == 0:
            self._slope()
        if self.learning < c.window:
            return
        end = now - c.guard
        mean = self.y[end - self.learning : end].mean(axis=0)
        if self.learning == c.window and self.learnt:
            self._stepped(mean - self.reference, (now - self.settled) * self.dt)
        self.learnt, self.settled, self.reference = self.learning, now, mean

    def _axis_noise(self):
        return self.s.R_alpha[0, 0] / self.s.drift[0, 0]

    def _leant(self, d):
        """Variance of an axis by scale errors, of a body that stands another way up (E-21)."""
        return self.c.scale**2 * np.sum(d[9:] ** 2)

    def _of_one_axis(self, d):
        seen = 3 + self.s.m
        return np.mean(d[:seen] ** 2 / np.diag(self.s.drift)[:seen])

    def _slope(self):
        """Drift by the slope of this standstill (E-54)."""
        t = np.array(self.rows) * self.dt
        t -= t.mean()
        slope, noise = t @ self.y[self.rows] / (t @ t), self._axis_noise() / (t @ t)
        if not self.known or noise < self.known:
            self.walk, self.known = max(0.0, self._of_one_axis(slope) - 1.5 * noise), noise

    def _stepped(self, d, seconds):
        """Drift by what two standstills differ (E-54)."""
        noise = self._axis_noise() * (1.0 / self.learning + 1.0 / self.learnt) + self._leant(d)
        told = noise / seconds**2
        if not self.known or told <= self.known:
            self.walk = max(0.0, self._of_one_axis(d) / seconds**2 - 1.5 * told)
            self.known = told
