"""All gyro-free rate estimators of one accelerometer board, side by side on the same samples."""

import logging
import math
import time
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimator.stream import Stream, every, worth_a_line
from inertial.doubts.watch import SettingsWatch
from inertial.rate.batch import RateColumns, RateState
from inertial.rate.beliefs import Beliefs, make

log = logging.getLogger(__name__)

Array = NDArray[np.float64]

DOUBT_S = 2.0  # of data, between two looks at the settings


class WrongAxes(ValueError):
    """Batches that the layout of their device does not describe."""


class RateOutput(NamedTuple):
    """What one estimator says of a part of a batch in which it used the same axes."""

    row: int  # of the batch: the first sample that is told
    index: int  # sample index of it
    step: int  # each step-th sample is told
    estimator: str
    columns: RateColumns  # of the samples that are told


def thinned(said: RateOutput, period_s: float, limit_hz: float) -> RateOutput | None:
    """What is left of an output when at most limit_hz of its samples are told; period_s: of the
    board. None when nothing is.
    """
    fewer = math.ceil(every(period_s, limit_hz) / said.step)
    if fewer == 1:
        return said
    step = fewer * said.step
    first = (step - 1 - said.index) % step // said.step
    if first >= len(said.columns):
        return None
    ahead = first * said.step
    rows = said.columns.part(slice(first, None, fewer))
    return RateOutput(said.row + ahead, said.index + ahead, step, said.estimator, rows)


class RateBoard:
    """Feeds batches to every estimator; tells them of gaps, starts them anew after a reboot."""

    def __init__(
        self,
        device: str,
        layout: Any,
        names: list[str],
        rate_limit_hz: float,
        card: Any | None = None,
        beliefs: Beliefs = Beliefs(),
    ) -> None:
        """Names are keys of inertial.rate.estimators.VARIANTS; card: calibration file of the
        device, or None.

        Raises CardError for the card of another layout.
        """
        from inertial.rate.estimators import VARIANTS  # here: loads only where accelerometers are

        self.device = device
        self.card, self._beliefs = card, beliefs
        self.wiring = layout  # which column of the board is which axis
        self.layout = layout if card is None else card.layout(layout)
        self.stream = Stream()
        self._last: dict[str, RateColumns] = {}  # newest by estimator
        self._make = {name: VARIANTS[name] for name in names}
        self.cost_ns = dict.fromkeys(names, 0)  # spent in each estimator, and for how many samples
        self.cost_samples = dict.fromkeys(names, 0)
        self._limit = rate_limit_hz
        self._estimators: dict[str, Any] = {}
        self._last_t: float | None = None
        self._period_s = 0.01
        self.health: Any = None  # inertial.rate.health.HealthMonitor
        self._left_out = 0  # axes that the estimators were told to leave out
        self._watch = SettingsWatch(self.layout)
        self._doubts, self._doubted_s = "", 0.0
        self.began_utc_ns = 0  # the caller's, of the batch that the estimators began with

    def _start(self, reason: str) -> None:
        from inertial.rate.health import HealthMonitor  # here: loads only where it is needed

        if reason:
            log.warning("%s: %s: rate estimators start anew", self.device, reason)
        self.began_utc_ns = 0
        self._estimators = {
            name: make(kind, self.layout, self.card, self._beliefs)
            for name, kind in self._make.items()
        }
        self.health, self._left_out = HealthMonitor(self.layout, self._period_s), 0

    def feed(
        self,
        epoch: int,
        first_index: int,
        period_s: float,
        t_s: Array,
        f_axis: Array,
        stale: int = 0,
    ) -> list[RateOutput]:
        """Step through a batch: times (n,) in s of the board's clock, its columns (n, columns) in
        m/s^2.

        Bit k of `stale`: column k was not fresh. Raises WrongAxes.
        """
        axes = self.wiring.columns
        if f_axis.shape[1] != axes:
            raise WrongAxes(
                f"{self.device}: batches of {f_axis.shape[1]} axes, layout {self.layout.name} has"
                f" {axes}: name the right one in [estimator] layouts"
            )
        f_axis = self.wiring.read(f_axis)
        stale = (
            sum((stale >> column & 1) << k for k, column in enumerate(self.wiring.channels))
            if stale
            else 0
        )
        if self.card is not None:
            f_axis = self.card.correct(f_axis)
        self._period_s = period_s
        admission = self.stream.admit(epoch, first_index, len(t_s))
        if admission.restart or not self._estimators:
            self._start(admission.reason)
            self._last_t = None
        elif admission.missing:
            if worth_a_line(self.stream.gaps):
                log.warning(
                    "%s: %d samples missing before %d (gap %d)",
                    self.device,
                    admission.missing,
                    first_index,
                    self.stream.gaps,
                )
            for estimator in self._estimators.values():
                estimator.skip(admission.missing)
            self.health.skip(admission.missing)
        if self._last_t is not None and not t_s[0] > self._last_t:
            self._start(f"board clock went from {self._last_t:.6f} s to {t_s[0]:.6f} s")
        self._last_t = float(t_s[-1])
        self._watch.feed(t_s, f_axis)
        f_axis = np.ascontiguousarray(f_axis, dtype=np.float64)
        out, begin = [], 0
        for end, mask, doubted in self.health.feed(t_s, f_axis, stale):
            self._tell(mask)
            for estimator in self._estimators.values():
                estimator.doubt(doubted)
            out += self._run(
                first_index, begin, t_s[begin:end], f_axis[begin:end], every(period_s, self._limit)
            )
            begin = end
        return out

    def _run(
        self, first_index: int, begin: int, t_s: Array, f_axis: Array, step: int
    ) -> list[RateOutput]:
        """Every estimator over one part of a batch; each step-th sample is told."""
        first = first_index + begin
        told = slice((step - 1 - first) % step, len(t_s), step)
        out = []
        for name, estimator in self._estimators.items():
            began = time.perf_counter_ns()  # told by EstimatorStatus, touches no estimate
            columns = self._last[name] = estimator.feed(t_s, f_axis)
            self.cost_ns[name] += time.perf_counter_ns() - began
            self.cost_samples[name] += len(t_s)
            if told.start < len(t_s):
                rows = columns if step == 1 else columns.part(told)
                out.append(RateOutput(begin + told.start, first + told.start, step, name, rows))
        return out

    def newest(self, name: str) -> RateState:
        """What an estimator said last."""
        columns = self._last[name]
        return columns.state(len(columns) - 1)

    def tacho(self, t_s: float, rate: float, sigma: float, signed: bool) -> None:
        """A tachometer's report to all estimators (RateEstimator.tacho)."""
        for estimator in self._estimators.values():
            estimator.tacho(t_s, rate, sigma, signed)

    def heard_tacho(self, t_s: float, rate: float, pulses: int) -> None:
        """A tachometer's report to what watches the settings, rad/s, with pulses since boot."""
        self._watch.tacho(t_s, rate, pulses)

    def doubts(self, t_s: float) -> str:
        """What the data say of wrong settings, looked at every DOUBT_S of data; empty for none."""
        if abs(t_s - self._doubted_s) >= DOUBT_S:
            self._doubted_s, before = t_s, self._doubts
            found = self._watch.doubts(spoilt=self._left_out != 0)
            self._doubts = "; ".join(doubt.text for doubt in found)
            if self._doubts and not before:
                log.warning("%s: is a setting wrong? %s", self.device, self._doubts)
        return self._doubts

    def cost_us(self, name: str) -> float:
        """Time of one sample in this estimator, us, since it was last asked for."""
        cost = self.cost_ns[name] / max(1, self.cost_samples[name]) / 1000.0
        self.cost_ns[name] = self.cost_samples[name] = 0
        return cost

    def _tell(self, mask: int) -> None:
        """Tell the estimators when the axes they may use have changed; one that cannot do without
        says so itself.
        """
        from inertial.rate.estimators import leave_out  # here: loads only where it is needed

        if mask == self._left_out:
            return
        self._say_left_out(mask)
        self._left_out = mask
        for estimator in self._estimators.values():
            if (error := leave_out(estimator, mask)) is not None:
                log.warning(
                    "%s: %s knows nothing until axes are good again: %s",
                    self.device,
                    estimator.name,
                    error,
                )

    def _say_left_out(self, mask: int) -> None:
        names = [name for k, name in enumerate(self.wiring.axis_names) if mask >> k & 1]
        log.warning(
            "%s: axes not used: %s", self.device, ", ".join(names) or "none, all are good again"
        )
