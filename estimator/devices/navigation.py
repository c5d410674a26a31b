"""All navigation filters of one six-axis board, side by side on the same samples and fixes."""

import logging
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimator.stream import Stream, every, worth_a_line
from inertial.navigation.fix import Fix
from inertial.navigation.mute import Mute, Mutes, order_for
from inertial.navigation.navigation import NAVIGATORS, Correction, NavigatorConfig, Solution

log = logging.getLogger(__name__)

AHEAD_S = 600.0  # a fix further ahead of all else says nothing of the time

Array = NDArray[np.float64]


@dataclass(frozen=True)
class NavOutput:
    """What one filter has to say after the sample of this index."""

    row: int  # of the batch
    index: int
    estimator: str
    what: Solution | Correction


class NavBoard:
    """Feeds batches and fixes to every filter; starts them anew after a reboot."""

    def __init__(
        self, device: str, config: NavigatorConfig, names: list[str], limit_hz: float
    ) -> None:
        """Names are keys of NAVIGATORS."""
        self.device = device
        self.stream = Stream()
        self.navigators: dict[str, Any] = {}
        self.config, self._names = (
            config,
            names,
        )  # no closures: a process that goes on after a crash pickles this
        self.limit_hz = limit_hz  # of what is told; may be changed
        self.mutes = Mutes()
        self._newest = -math.inf  # s, time of the newest sample or fix
        self._epoch = 0

    def make(self, name: str) -> Any:
        """A new navigator of one of the names."""
        return NAVIGATORS[name](self.config)

    def feed(
        self, epoch: int, first_index: int, period_s: float, t_s: Array, f_b: Array, omega_b: Array
    ) -> list[NavOutput]:
        """Step through a batch: times (n,) in s of the board's clock, force and rate (n, 3) in
        m/s^2 and rad/s.
        """
        admission = self.stream.admit(epoch, first_index, len(t_s))
        if admission.restart or not self.navigators:
            if admission.reason:
                log.warning("%s: %s: navigation starts anew", self.device, admission.reason)
            self.navigators = {name: self.make(name) for name in self._names}
        elif admission.missing and worth_a_line(self.stream.gaps):
            log.warning(
                "%s: %d samples missing before %d (gap %d)",
                self.device,
                admission.missing,
                first_index,
                self.stream.gaps,
            )
        step = every(period_s, self.limit_hz)
        self._newest = float(t_s[-1]) if epoch != self._epoch else max(self._newest, float(t_s[-1]))
        self._epoch = epoch
        imu = np.column_stack([t_s, f_b, omega_b])
        spoken = [k for k in range(len(t_s)) if (first_index + k) % step == step - 1]
        said = [
            (row, place, what)
            for place, navigator in enumerate(self.navigators.values())
            for row, what in self._run(navigator, imu, spoken)
        ]
        said.sort(key=lambda one: one[:2])  # in the samples' order, filters in theirs
        names = list(self.navigators)
        for _, place, what in said:
            self._tell(names[place], what)
        return [NavOutput(row, first_index + row, names[place], what) for row, place, what in said]

    @staticmethod
    def _run(
        navigator: Any, imu: Array, spoken: list[int]
    ) -> Iterator[tuple[int, Solution | Correction]]:
        """What one filter says over a batch, and after which row; a solution after those of
        `spoken`.
        """
        done = 0
        for end in sorted({*(row + 1 for row in spoken), len(imu)}):
            for row, correction in navigator.feed(imu[done:end]):
                yield done + row, correction
            if end - 1 in spoken:
                yield end - 1, navigator.solution()
            done = end

    def _tell(self, name: str, what: Solution | Correction) -> None:
        """A line for the log about a fix that was refused."""
        if isinstance(what, Correction) and what.reason and not what.fix.withheld:
            if not what.accepted:
                log.info("%s: %s: fix refused: %s", self.device, name, what.reason)

    def fix(self, fix: Fix) -> None:
        """Hand a fix to every filter; one that comes before the first sample has nothing to
        correct.
        """
        known = self._newest > -math.inf
        if not known or fix.t < self._newest + AHEAD_S:  # an order to mute goes by this time
            self._newest = max(self._newest, fix.t)
        if self.muted(fix.t):
            fix = replace(fix, withheld=True, muted=True)
        for navigator in self.navigators.values():
            navigator.fix(fix)

    def muted(self, t: float) -> bool:
        """Whether fixes of time t, s, are held back."""
        return self.mutes.held(self._epoch, t)

    def mute(self, seconds: float) -> Mute:
        """Hold the fixes of the next seconds back, to see how the filters do without; 0 ends it.
        Gives the order.

        The filters are still scored on them. Raises ValueError for a length that makes no sense.
        """
        order = order_for(seconds, self._epoch, self._newest)
        self.mutes.add(order)
        return order
