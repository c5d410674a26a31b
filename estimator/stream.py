"""Sample index bookkeeping: is this batch the next one, after a gap, or of another boot?"""

import math
from dataclasses import dataclass

FARTHEST = 10_000_000  # samples; a longer gap is a new beginning: a day at 100 Hz


@dataclass(frozen=True)
class Admission:
    """How a batch follows the one before it."""

    restart: bool  # the estimators must start anew
    missing: int  # samples between the last batch and this one
    reason: str = ""  # why restart, in words; empty for the first batch


class Stream:
    """Counts the samples of one board by boot counter and sample index."""

    def __init__(self) -> None:
        self.samples = 0  # accepted since the last restart
        self.gaps = 0
        self.missing = 0
        self._epoch: int | None = None
        self._next = 0

    def admit(self, epoch: int, first_index: int, count: int) -> Admission:
        """Account for a batch of `count` samples from `first_index` of boot `epoch`."""
        admission = self._judge(epoch, first_index)
        if admission.restart:
            self.samples = self.gaps = self.missing = 0
        if admission.missing:
            self.gaps += 1
            self.missing += admission.missing
        self._epoch = epoch
        self._next = first_index + count
        self.samples += count
        return admission

    def _judge(self, epoch: int, first_index: int) -> Admission:
        if self._epoch is None:
            return Admission(True, 0)
        if epoch != self._epoch:
            return Admission(True, 0, f"board restarted (boot {self._epoch} -> {epoch})")
        if first_index < self._next:
            return Admission(True, 0, f"sample index went back from {self._next} to {first_index}")
        missing = first_index - self._next
        if missing > FARTHEST:
            return Admission(True, 0, f"sample index went from {self._next} to {first_index}")
        return Admission(False, missing)


def every(period_s: float, limit_hz: float) -> int:
    """k such that each k-th sample of a stream of this period gives at most limit_hz outputs."""
    if not period_s > 0.0:
        return 1
    return max(
        1, math.ceil(1.0 / (period_s * limit_hz) - 1e-6)
    )  # 100 Hz in 10 ms steps: 1, not 2 by rounding


def worth_a_line(count: int) -> bool:
    """True for the 1st, 2nd, 4th, 8th ... event of a kind: a flood of them stays readable in the
    log.
    """
    return count > 0 and count & (count - 1) == 0
