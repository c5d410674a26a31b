"""A guided calibration, sample by sample: which pose next, is the body still, is it good enough.
Pure; no time of day.

WAITING for a pose the session has not seen; TAKING it while the body stands still; TURNING while a
tachometer says that the table turns; FITTED after the person asked for the last fit. Motion ends a
pose that is being taken, nothing else is lost. Deterministic: the same samples and orders give the
same card.
"""

from collections import deque
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from inertial.calibration.card import Card, make_card
from inertial.calibration.fit import CalibrationError, Fit, fit
from inertial.calibration.model import Poses, Steps
from inertial.calibration.poses import SAME, describe, next_pose
from inertial.calibration.steps import TURNING, blocks
from inertial.core import native
from inertial.elementary import applied, dot, norm, product
from inertial.layouts.layout import Layout

Array = NDArray[np.float64]

IDLE, WAITING, TAKING, TURNING_TABLE, FITTED, SAVED, FAILED = range(7)  # as CalibrationStatus.State


@dataclass(frozen=True)
class Rules:
    """When a pose counts, and when the calibration is good enough."""

    window_s: float = 0.4  # s, of the still test
    quiet: float = 2.0  # mean square scatter of a window over the sensors' noise
    pose_s: float = 3.0  # s of standstill per pose
    fewest_poses: int = 9
    bias_sigma: float = 0.01  # m/s^2, 1 mg
    scale_sigma: float = 0.001
    misalignment_sigma: float = 0.002  # rad
    chi2: float = 4.0
    stopped_s: float = 1.5  # s that the table must stand before its run counts
    longest_run_s: float = 120.0
    tacho_sigma: float = 0.02  # rad/s, of the rate between two reports of the gateway


@dataclass
class _Run:
    """A run on the table while it is being collected."""

    t_s: list[float] = field(default_factory=list)
    f_axis: list[Array] = field(default_factory=list)
    stopped_at: float | None = None


class GuidedCalibration:
    """The state machine; feed() and tacho() take data, the properties say where it stands."""

    def __init__(self, layout: Layout, rules: Rules = Rules()) -> None:
        """layout: the nominal one of the device."""
        self.layout, self.rules = layout, rules
        self.state = WAITING
        self.message = ""
        self.progress = 0.0
        self.fit: Fit | None = None
        self._noise2 = float(np.mean(np.square(layout.noise)))
        theta_b = layout.theta_b
        self._inverse = native.solve_positive(
            product(theta_b.T, theta_b), np.ascontiguousarray(theta_b.T)
        )
        self._window: deque[Array] = deque()
        self._taking: list[Array] = []
        self._poses: list[tuple[Array, int, float]] = []
        self._steps: list[Steps] = []
        self._tacho: list[tuple[float, float]] = []  # s, rad/s
        self._run: _Run | None = None
        self._spoilt = False

    # --- data

    def feed(self, t_s: Array, f_axis: Array) -> None:
        """Samples: times (n,) s, axis readings (n, N) m/s^2 at nominal scale, in order."""
        period = float(t_s[1] - t_s[0]) if len(t_s) > 1 else 0.01
        for t, f in zip(t_s.tolist(), f_axis, strict=True):
            self._sample(t, f, period)

    def tacho(self, t_s: float, omega: float) -> None:
        """A report of the tachometer: rate (rad/s) up to its newest pulse at t_s."""
        if self._tacho and t_s <= self._tacho[-1][0]:
            return
        before = self._tacho[-1][0] if self._tacho else t_s
        # a report is the mean since the one before; its moment is the middle, unless the table
        # stood in between
        middle = 0.5 * (before + t_s) if t_s - before < 0.3 else t_s
        if not self._tacho or middle > self._tacho[-1][0]:
            self._tacho.append((middle, omega))
        if self._run is None:
            self._tacho = self._tacho[-200:]
            if abs(omega) > TURNING and self.state != FAILED:
                self._run, self.state = _Run(), TURNING_TABLE
                self._taking.clear()
        elif abs(omega) <= TURNING and self._run.stopped_at is None:
            self._run.stopped_at = t_s
        elif abs(omega) > TURNING:
            self._run.stopped_at = None

    def gap(self) -> None:
        """Samples are missing: what is being taken is not whole."""
        self._window.clear()
        self._taking.clear()
        self._run = None
        if self.state in (TAKING, TURNING_TABLE):
            self.state, self.message = WAITING, "samples were lost: take this one again"

    # --- orders

    def solve(self) -> Fit:
        """Fit everything collected; raises CalibrationError when there is too little of it."""
        if len(self._poses) < 4:
            raise CalibrationError(
                f"{len(self._poses)} poses taken, want at least 4 for a first fit"
            )
        noise = np.full(
            self.layout.axes, np.sqrt(np.mean([scatter**2 for _, _, scatter in self._poses]))
        )
        self.fit = fit(self.layout, self._means(), self._steps, noise=noise)
        self.state, self.progress = FITTED, 1.0
        return self.fit

    def card(self, device: str, date: str) -> Card:
        """The card of the last fit, after a new one if poses came since; raises
        CalibrationError.
        """
        solved = self.solve()
        return make_card(
            solved,
            self.layout,
            self.layout.axis_names,
            device=device,
            date=date,
            poses=len(self._poses),
            steps=len(self._steps),
        )

    # --- where it stands

    @property
    def poses(self) -> list[tuple[Array, int, float]]:
        """Direction up (3,), samples and scatter (m/s^2) of every pose taken."""
        return [(self._up(mean), samples, scatter) for mean, samples, scatter in self._poses]

    @property
    def steps(self) -> int:
        """Runs on the table that count."""
        return len(self._steps)

    @property
    def next_up(self) -> Array | None:
        """Direction that should point up next; None when all have been taken."""
        return next_pose(np.array([up for up, _, _ in self.poses]).reshape(-1, 3))

    @property
    def good_enough(self) -> bool:
        """Would a card of what is there keep its promises?"""
        f, r = self.fit, self.rules
        return bool(
            f is not None
            and len(self._poses) >= r.fewest_poses
            and f.bias_sigma.max() < r.bias_sigma
            and f.scale_sigma.max() < r.scale_sigma
            and f.misalignment_sigma.max() < r.misalignment_sigma
            and f.chi2 < r.chi2
        )

    @property
    def instruction(self) -> str:
        """What the person does next."""
        up = self.next_up
        pose = "every pose is taken" if up is None else f"{describe(up)}, then let go"
        if self.state == TAKING:
            return "hold still: this pose is being taken"
        if self.state == TURNING_TABLE:
            return "let the table stop to end this run"
        if self.state in (FITTED, SAVED):
            return "save the card, or take more poses"
        if self.good_enough:
            return f"good enough: fit and save, or go on with {pose}"
        return pose

    # --- inside

    def _sample(self, t: float, f: Array, period: float) -> None:
        if self._run is not None:
            self._turning(t, f, period)
            return
        n = max(4, round(self.rules.window_s / period))
        self._window.append(f)
        if len(self._window) > n:
            self._window.popleft()
        window = np.array(self._window)
        still = (
            len(window) == n and window.var(axis=0, ddof=1).mean() < self.rules.quiet * self._noise2
        )
        if self.state == TAKING:
            self._take(f, still, period)
        elif still and self.state in (WAITING, FITTED, SAVED):
            self._begin(window.mean(axis=0))
        elif not still and len(window) == n:
            self._spoilt = False
            self.message = ""

    def _begin(self, mean: Array) -> None:
        up = self._up(mean)
        known = [taken for taken, _, _ in self.poses]
        if any(dot(up, one) > SAME for one in known):
            if not self._spoilt and known and self.state == WAITING:
                self.message = "this pose is taken already"
            return
        self.state, self.progress, self.message = TAKING, 0.0, ""
        self._taking = []

    def _take(self, f: Array, still: bool, period: float) -> None:
        if not still:
            # the newest window already moved: what is left counts if it is long enough, else not
            self.state, self.progress, self._spoilt = WAITING, 0.0, True
            self.message = "it moved: set it down again"
            self._taking = []
            return
        self._taking.append(f)
        wanted = round(self.rules.pose_s / period)
        self.progress = min(1.0, len(self._taking) / wanted)
        if len(self._taking) < wanted:
            return
        part = np.array(self._taking)
        scatter = float(np.sqrt(part.var(axis=0, ddof=1).mean()))
        self._poses.append((part.mean(axis=0), len(part), scatter))
        self._taking, self.state, self.progress, self._spoilt = [], WAITING, 0.0, True
        self.message = f"pose {len(self._poses)} taken"
        self._refit()

    def _refit(self) -> None:
        """The poses alone: quick enough for the live path; table runs join when the person asks for
        the fit.
        """
        if len(self._poses) < 4:
            return
        noise = np.full(
            self.layout.axes, np.sqrt(np.mean([scatter**2 for _, _, scatter in self._poses]))
        )
        try:
            self.fit = fit(self.layout, self._means(), noise=noise)
        except CalibrationError as error:
            self.fit, self.message = None, str(error)

    def _turning(self, t: float, f: Array, period: float) -> None:
        run = self._run
        run.t_s.append(t)
        run.f_axis.append(f)
        ended = run.stopped_at is not None and t - run.stopped_at > self.rules.stopped_s
        if not ended and t - run.t_s[0] < self.rules.longest_run_s:
            return
        self._run, self.state = None, WAITING
        at, rate = np.array(self._tacho).T
        t_s = np.array(run.t_s)
        try:
            one = blocks(
                t_s, np.array(run.f_axis), np.interp(t_s, at, rate), period, self.rules.tacho_sigma
            )
        except CalibrationError as error:
            self.message = str(error)
            return
        self._steps.append(one)
        self.message = (
            f"run {len(self._steps)} on the table taken; mount the body on another face for the"
            " next"
        )

    def _means(self) -> Poses:
        mean, samples, scatter = zip(*self._poses, strict=True)
        return Poses(np.array(mean), np.array(samples), np.array(scatter))

    def _up(self, mean: Array) -> Array:
        f = applied(self._inverse, mean)
        return f / max(float(norm(f)), 1e-9)
