"""What could explain readings that do not fit: a memory of blocks, and the likeliest hypothesis
about the axes.
"""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from inertial.layouts.layout import Layout
from inertial.rate import parity
from inertial.rate.axis_fault import AxisState

if TYPE_CHECKING:
    from inertial.rate.health import HealthMonitor

Array = NDArray[np.float64]

KEPT = 64  # blocks
BEFORE = 3  # blocks before the onset from which hypotheses run: the gate opens a little late
FEWEST = 5  # blocks after the onset
SURE = 12.0  # -2 log likelihood by which the best must beat every explanation by another axis
BETTER = 25.0  # and by which it must beat "nothing is wrong"
KIND_SURE = 22.0  # by which it must beat another fault of the same axis ...
KIND_BLOCKS = 15  # ... until so many blocks after the onset
# NIS per degree of freedom that the right explanation leaves at most; good readings leave 0.1
CLEAN = 0.3
# NIS per degree of freedom of a fault of one axis that is preferred to a swap which leaves more
# than CLEAN
ALONE = 1.0
FIT = 2.5  # NIS per degree of freedom that an explanation may leave

SWAPPED, FLIPPED, BIASED, SUSPECT = (
    AxisState.SWAPPED,
    AxisState.FLIPPED,
    AxisState.BIASED,
    AxisState.SUSPECT,
)


@dataclass(frozen=True)
class Finding:
    """The best explanation. Without axes: the state was wrong, no axis is."""

    axes: tuple[int, ...]
    kind: int
    state: AxisState
    text: str
    offset: float
    sure: bool
    x: Array
    P: Array


class History:
    """The newest blocks, the filter's state before each, and whether all was well then."""

    def __init__(self, axes: int) -> None:
        self.blocks: list[Array] = []
        self.dt: list[float] = []
        self.states: list[tuple[Array, Array]] = []
        self.well: list[bool] = []

    def add(self, block: Array, dt: float, x: Array, P: Array, well: bool) -> None:
        """One block; (x, P) before it."""
        for column, value in (
            (self.blocks, block),
            (self.dt, dt),
            (self.states, (x, P)),
            (self.well, well),
        ):
            column.append(value)
            if len(column) > KEPT:
                column.pop(0)

    def clear(self) -> None:
        """What was is of no use any more."""
        for column in (self.blocks, self.dt, self.states, self.well):
            column.clear()

    def since_onset(self) -> int:
        """Blocks since all was well."""
        for back, well in enumerate(reversed(self.well)):
            if well:
                return back
        return len(self.well)

    def all_well(self, blocks: int) -> bool:
        """Was all well in the newest blocks, that many?"""
        return len(self.well) >= blocks and all(self.well[-blocks:])

    def from_onset(self) -> tuple[Array, Array, Array, Array] | None:
        """State before the onset, then blocks (n, N) and their dt (n,) up to now."""
        n = min(len(self.blocks), self.since_onset() + BEFORE)
        if n == 0:
            return None
        x, P = self.states[-n]
        return x, P, np.array(self.blocks[-n:]), np.array(self.dt[-n:])

    def replay_without(self, monitor: "HealthMonitor", i: int) -> tuple[Array, Array] | None:
        """State now, had axis i not been used since the oldest block that is kept, at most a second
        back.
        """
        n = min(len(self.blocks), 25)
        if n == 0:
            return None
        used = monitor.used.copy()
        x, P = self.states[-n]
        *_, x, P = parity.replay(
            x,
            P,
            np.array(self.blocks[-n:]),
            np.array(self.dt[-n:]),
            used,
            parity.NONE,
            0,
            -1,
            -1,
            monitor.constants,
            monitor.tuning,
        )
        self.clear()
        return x, P


def start(layout: Layout, f: Array, used: Array, unknown: float) -> tuple[Array, Array]:
    """First state from one block f (N,): omega from the products where they are plain, else about
    zero (H-7).
    """
    x, P = np.zeros(parity.STATES), np.zeros((parity.STATES, parity.STATES))
    x[3:9] = np.linalg.lstsq(layout.J[used], f[used], rcond=None)[0]
    sigma = 1.0
    if used.all() and layout.rank == 12:
        z = (layout.field_inverse @ f)[6:]
        noise = unknown * float(np.linalg.norm(layout.field_inverse[6:], axis=1).max())
        outer = np.zeros((3, 3))
        outer[np.triu_indices(3)] = z
        values, vectors = np.linalg.eigh(outer + np.triu(outer, 1).T)
        if values[-1] > 3.0 * noise:
            x[:3] = np.sqrt(values[-1]) * vectors[:, -1]
            sigma = max(0.1, noise / (2.0 * np.sqrt(values[-1])))
    diagonal = [sigma**2] * 3 + [(200.0) ** 2] * 3 + [(20.0) ** 2] * 3 + [0.0]
    P[np.diag_indices(parity.STATES)] = diagonal
    return x, P


def explain(monitor: "HealthMonitor", late: bool) -> Finding | None:
    """The likeliest explanation of the blocks since the onset (H-8); None when none fits or it is
    too early.
    """
    found = monitor.history.from_onset()
    if found is None or (len(found[2]) < FEWEST and not late):
        return None
    x0, P0, blocks, dt = found
    axes = [i for i in range(monitor.layout.axes) if monitor.used[i]]

    def run(
        kind: int, i: int = 0, j: int = -1, since: int = -1, first: tuple[Array, Array] = (x0, P0)
    ) -> tuple:
        score, nis, degrees, x, P = parity.replay(
            *first, blocks, dt, monitor.used, kind, i, j, since, monitor.constants, monitor.tuning
        )
        who = () if kind == parity.NONE else (i,) if j < 0 else (i, j)
        return score, nis / max(degrees, 1), who, kind, since, x, P

    nothing = run(parity.NONE)
    tried = []
    unknown = float(monitor.offset.max()) ** 0.5
    x, P = start(monitor.layout, blocks[0] - monitor.bias, monitor.used, unknown)
    mirrored = x.copy()
    mirrored[:3] = -x[:3]
    tried += [run(parity.NONE, first=(x, P)), run(parity.NONE, first=(mirrored, P))]
    onset = len(blocks) - monitor.history.since_onset()
    for since in (-1, onset) if onset >= 0 else (-1,):
        for i in axes:
            tried += [
                run(kind, i, -1, since)
                for kind in (parity.OFFSET_OF, parity.IGNORE, parity.MIRROR_ZERO)
            ]
            if monitor.learned[i]:
                tried.append(run(parity.MIRROR_REFERENCE, i, -1, since))
        for a, i in enumerate(axes):
            for j in axes[a + 1 :]:
                tried.append(run(parity.SWAP, i, j, since))
                if monitor.learned[i] and monitor.learned[j]:
                    tried.append(run(parity.SWAP_CHANGES, i, j, since))
    tried.sort(key=lambda item: item[0])
    best = tried[0]
    if not best[1] < FIT or nothing[0] - best[0] < BETTER:
        return None
    half = (
        len(best[2]) == 2 and best[1] > CLEAN
    )  # a swap that does not explain all: one of its axes may do as well
    one = [t for t in tried if half and len(t[2]) == 1 and t[2][0] in best[2] and t[1] < ALONE]
    pair, best = (best, one[0]) if one else (None, best)
    others = [t for t in tried if not set(t[2]) & set(best[2])]
    kinds = [t for t in tried if t[2] == best[2] and _state(t[3]) != _state(best[3])] + (
        [pair] if pair else []
    )
    sure = late or not others or others[0][0] - best[0] > SURE
    told_apart = not kinds or kinds[0][0] - best[0] > KIND_SURE
    sure &= told_apart or monitor.history.since_onset() >= KIND_BLOCKS
    finding = _finding(monitor, best, sure, run)
    if pair:
        finding = replace(finding, text=f"{finding.text}, or {_swapped(monitor, pair[2])}")
    return finding


def _finding(monitor: "HealthMonitor", best: tuple, sure: bool, run) -> Finding:
    _, _, who, kind, since, x, P = best
    offset = float(x[parity.OFFSET]) if kind == parity.OFFSET_OF else 0.0
    if who:  # go on with the state of those who never used the axes
        *_, x, P = run(parity.IGNORE, who[0], who[1] if len(who) > 1 else -1, since)
    swapped = _swapped(monitor, who)
    text = {
        parity.NONE: "",
        parity.OFFSET_OF: f"off by {offset:+.2f} m/s²",
        parity.IGNORE: "does not fit the motion that the others feel",
        parity.MIRROR_ZERO: "has the wrong sign",
        parity.MIRROR_REFERENCE: "changes with the wrong sign",
        parity.SWAP: swapped,
        parity.SWAP_CHANGES: swapped,
    }[kind]
    return Finding(who, kind, _state(kind), text, offset, sure, x, P)


def _swapped(monitor: "HealthMonitor", who: tuple[int, ...]) -> str:
    return "swapped: " + " and ".join(monitor.layout.axis_names[i] for i in who)


def _state(kind: int) -> AxisState:
    if kind in (parity.MIRROR_ZERO, parity.MIRROR_REFERENCE):
        return FLIPPED
    if kind in (parity.SWAP, parity.SWAP_CHANGES):
        return SWAPPED
    return {parity.NONE: AxisState.GOOD, parity.OFFSET_OF: BIASED, parity.IGNORE: SUSPECT}[kind]
