"""The last seconds of a filter: its samples and snapshots, so that a late fix is applied at its own time."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from estimator.ins import ekf as ins_ekf

Array = NDArray[np.float64]

CAPACITY = 4096  # samples; at 1 kHz about 4 s
KEEP = 2048  # samples kept when the buffer is full
SNAPSHOTS = 20  # of 0.1 s each: fixes may be 2 s late


class History:
    """Samples in arrays (compiled loops read them), snapshots in a list; positions count from the oldest kept."""

    def __init__(self) -> None:
        self._t = np.empty(CAPACITY)
        self._f = np.empty((CAPACITY, 3))
        self._w = np.empty((CAPACITY, 3))
        self._count = 0
        self._next = 0  # first sample the newest state has not used
        self._snapshots: list[tuple[int, ins_ekf.InsState]] = []

    @property
    def newest(self) -> float | None:
        """Time of the newest sample, s."""
        return float(self._t[self._count - 1]) if self._count else None

    def append(self, t: float, f: Array, w: Array) -> None:
        """Keep a sample; the oldest go when the buffer is full."""
        if self._count == CAPACITY:
            self._drop(CAPACITY - KEEP)
        self._t[self._count] = t
        self._f[self._count] = f
        self._w[self._count] = w
        self._count += 1

    def clear(self) -> None:
        """Forget everything."""
        self._count = self._next = 0
        self._snapshots = []

    def restart(self, state: ins_ekf.InsState, k: int) -> None:
        """The past of a filter begins at this state, which needs sample k next."""
        self._snapshots = [(k, state.copy())]
        self._next = k

    def advance(self, state: ins_ekf.InsState, until: float, work: ins_ekf.Workspace) -> None:
        """Bring the newest state forward over samples not used yet, keeping snapshots."""
        while self._next < self._count:
            k = ins_ekf.advance_state(state, self._t, self._f, self._w, self._next, self._count, until, work)
            self._next = k
            if state.acc[ins_ekf.ACC_LENGTH] == 0.0:
                self._snapshots.append((k, state.copy()))
                del self._snapshots[: -SNAPSHOTS - 1]

    def state_at(self, t: float, work: ins_ekf.Workspace) -> tuple[ins_ekf.InsState, int] | None:
        """The state at time t as a copy, and the sample it needs next; None when t is before the snapshots."""
        for k, snapshot in reversed(self._snapshots):
            if snapshot.t <= t:
                state = snapshot.copy()
                while k < self._count and state.t < t:
                    k = ins_ekf.advance_state(state, self._t, self._f, self._w, k, self._count, t, work)
                return state, k
        return None

    def rate(self, k: int) -> Array:
        """Measured rate (3,) of the sample that acts at position k."""
        return self._w[min(k, self._count - 1)]

    def first_after(self, t: float) -> int | None:
        """Position of the first sample later than t; None when the buffer does not reach back to t."""
        if not self._count or self._t[0] > t:
            return None
        return int(np.searchsorted(self._t[: self._count], t, side="right"))

    def back_to(self, t: float, k: int) -> Iterator[tuple[float, Array]]:
        """Duration and rate of each sample from the newest back to time t, k being the first later than t."""
        for i in range(self._count - 1, k - 1, -1):
            start = max(t, self._t[i - 1]) if i else t
            yield self._t[i] - start, self._w[i]

    def _drop(self, n: int) -> None:
        for a in (self._t, self._f, self._w):
            a[: CAPACITY - n] = a[n:].copy()
        self._count -= n
        self._next = max(0, self._next - n)
        self._snapshots = [(k - n, s) for k, s in self._snapshots if k >= n]
