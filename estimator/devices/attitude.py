"""All attitude filters of one six-axis board, side by side on the same samples."""

import logging
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimator.stream import Stream, every, worth_a_line
from inertial.attitude.filters import ATTITUDES, AttitudeFilter, AttitudeState

log = logging.getLogger(__name__)

Array = NDArray[np.float64]

BRIDGED = (
    0.3  # s without samples over which the last one is held; after more the filters start anew
)


@dataclass(frozen=True)
class AttitudeOutput:
    """State of one filter after the sample of this index."""

    row: int  # of the batch
    index: int
    estimator: str
    state: AttitudeState


class AttitudeBoard:
    """Feeds batches to every filter; holds the last sample over short gaps, starts anew after long
    ones.
    """

    def __init__(self, device: str, names: list[str], limit_hz: float) -> None:
        """Names are keys of ATTITUDES."""
        self.device = device
        self.stream = Stream()
        self.filters: dict[str, AttitudeFilter] = {}
        self._names = names
        self.limit_hz = limit_hz  # of what is told; may be changed
        self._period = 0.0
        self._last: tuple[Array, Array] | None = None

    def feed(
        self, epoch: int, first_index: int, period_s: float, f_b: Array, omega_b: Array
    ) -> list[AttitudeOutput]:
        """Step through a batch: force and rate (n, 3) in m/s^2 and rad/s, period_s apart."""
        admission = self.stream.admit(epoch, first_index, len(f_b))
        gap = admission.missing * period_s
        changed = abs(period_s - self._period) > 1e-3 * period_s
        if admission.restart or changed or gap > BRIDGED or self._last is None:
            reason = admission.reason or (f"{gap:.2f} s without samples" if gap > BRIDGED else "")
            if reason and worth_a_line(max(1, self.stream.gaps)):
                log.warning("%s: %s: attitude filters start anew", self.device, reason)
            self.filters = {name: ATTITUDES[name](period_s) for name in self._names}
            self._period = period_s
        else:
            for _ in range(admission.missing):
                for attitude in self.filters.values():
                    attitude.step(*self._last)
        self._last = f_b[-1].copy(), omega_b[-1].copy()
        return self._step(first_index, every(period_s, self.limit_hz), f_b, omega_b)

    def _step(
        self, first_index: int, step: int, f_b: Array, omega_b: Array
    ) -> list[AttitudeOutput]:
        out = []
        for row in range(len(f_b)):
            index = first_index + row
            for name, attitude in self.filters.items():
                state = attitude.step(f_b[row], omega_b[row])
                if index % step == step - 1:
                    out.append(AttitudeOutput(row, index, name, state))
        return out
