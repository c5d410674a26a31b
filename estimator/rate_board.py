"""All gyro-free rate estimators of one accelerometer board, side by side on the same samples."""

import logging
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimator.stream import Stream, every

log = logging.getLogger(__name__)

Array = NDArray[np.float64]


@dataclass(frozen=True)
class RateOutput:
    """State of one estimator after the sample of this index."""

    row: int  # of the batch
    index: int
    estimator: str
    state: Any  # estimator.rate.RateState


class RateBoard:
    """Feeds batches to every estimator; tells them of gaps, starts them anew after a reboot."""

    def __init__(self, device: str, layout: Any, names: list[str], rate_limit_hz: float) -> None:
        """Names are keys of estimator.rate.ESTIMATORS; KeyError with the known ones for another name."""
        from estimator.rate import ESTIMATORS  # here: compiled functions, seconds of import

        unknown = sorted(set(names) - set(ESTIMATORS))
        if unknown:
            raise KeyError(f"[estimator] rate: no estimator {unknown[0]!r}; want some of {', '.join(ESTIMATORS)}")
        self.device = device
        self.layout = layout
        self.stream = Stream()
        self.last: dict[str, Any] = {}  # newest RateState by estimator
        self._make = {name: ESTIMATORS[name] for name in names}
        self._limit = rate_limit_hz
        self._estimators: dict[str, Any] = {}

    def feed(self, epoch: int, first_index: int, period_s: float, t_s: Array, f_axis: Array) -> list[RateOutput]:
        """Step through a batch: times (n,) in s of the board's clock, axis readings (n, axes) in m/s^2."""
        admission = self.stream.admit(epoch, first_index, len(t_s))
        if admission.restart or not self._estimators:
            if admission.reason:
                log.warning("%s: %s: rate estimators start anew", self.device, admission.reason)
            self._estimators = {name: make(self.layout) for name, make in self._make.items()}
        elif admission.missing:
            log.warning("%s: %d samples missing before %d", self.device, admission.missing, first_index)
            for estimator in self._estimators.values():
                estimator.skip(admission.missing)
        step = every(period_s, self._limit)
        out = []
        for row in range(len(t_s)):
            index = first_index + row
            for name, estimator in self._estimators.items():
                state = self.last[name] = estimator.step(index, float(t_s[row]), f_axis[row])
                if index % step == step - 1:
                    out.append(RateOutput(row, index, name, state))
        return out
