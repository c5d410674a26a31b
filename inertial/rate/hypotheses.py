"""What could explain readings that do not fit: a memory of blocks, and the likeliest hypothesis
about the axes.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inertial.layouts.layout import Layout
from inertial.rate import parity
from inertial.rate.axis_belief import WIDER, Belief, Width
from inertial.rate.axis_fault import AxisState

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
# -2 log likelihood a block by which a fault must beat "all axes are less exact than expected": one
# that leaves no more than good readings do, and for what it leaves beyond. A block, not all: an
# error that lasts speaks once, however many blocks it lasts.
BLAME, BLAME_UNCLEAN, NOISE = 7.5, 12.0, 0.1
FIT = 2.5  # NIS per degree of freedom that an explanation may leave

GOOD, SWAPPED, FLIPPED, BIASED, SUSPECT = (
    AxisState.GOOD,
    AxisState.SWAPPED,
    AxisState.FLIPPED,
    AxisState.BIASED,
    AxisState.SUSPECT,
)


class Known(NamedTuple):
    """What the monitor knows of the axes when it asks."""

    layout: Layout
    used: NDArray[np.bool_]  # (N,)
    learned: NDArray[np.bool_]  # (N,), offsets are known from a standstill
    constants: parity.Constants
    tuning: parity.Tuning
    belief: Belief

    def wider(self, width: Width) -> "Known":
        """The same of axes that are less exact."""
        return self._replace(
            constants=self.belief.constants(width), tuning=self.belief.tuning(width)
        )


@dataclass(frozen=True)
class Finding:
    """The best explanation. Without axes: the state was wrong, no axis is."""

    axes: tuple[int, ...]
    kind: parity.Kind
    state: AxisState
    text: str
    offset: float
    sure: bool
    x: Array
    P: Array
    width: Width | None = None  # no axis is at fault: all are less exact than expected


class History:
    """The newest blocks, the filter's state before each, and whether all was well then."""

    def __init__(self, axes: int) -> None:
        self.blocks: list[Array] = []
        self.dt: list[float] = []
        self.states: list[tuple[Array, Array]] = []
        self.well: list[bool] = []

    def add(self, block: Array, dt: float, x: Array, P: Array, well: bool) -> None:
        """One block; (x, P) before it."""
        self.blocks.append(block)
        self.dt.append(dt)
        self.states.append((x, P))
        self.well.append(well)
        if len(self.well) > KEPT:
            for column in (self.blocks, self.dt, self.states, self.well):
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

    def replay_without(self, known: Known) -> tuple[Array, Array] | None:
        """State now, had only the axes in use been used since the oldest block that is kept, at
        most a second back.
        """
        n = min(len(self.blocks), 25)
        if n == 0:
            return None
        nothing = (parity.NONE, 0, -1, -1)
        blocks, dt = np.array(self.blocks[-n:]), np.array(self.dt[-n:])
        *_, x, P = parity.replay(
            *self.states[-n], blocks, dt, known.used, nothing, known.constants, known.tuning
        )
        self.clear()
        return x, P


def start(known: Known, block: Array) -> tuple[Array, Array]:
    """First state from one block (N,) (H-7)."""
    c = known.constants
    unknown = float(c.offset.max()) ** 0.5
    plain = known.layout.rank == 12
    return parity.start(c, block - c.bias, known.used, unknown, plain)


class Tried(NamedTuple):
    """A hypothesis and how well it explains the blocks."""

    score: float  # -2 log likelihood
    left: float  # NIS per degree of freedom
    axes: tuple[int, ...]
    kind: parity.Kind
    since: int
    x: Array
    P: Array


class Trial:
    """The blocks since the onset, run again under one hypothesis after the other."""

    def __init__(self, known: Known, onset: int, found: tuple[Array, Array, Array, Array]) -> None:
        """found: as History.from_onset gives it; onset: the block in which it began."""
        self.known, self._onset = known, onset
        self._first, (self._blocks, self._dt) = found[:2], found[2:]

    def run(
        self,
        kind: parity.Kind,
        i: int = 0,
        j: int = -1,
        since: int = -1,
        first: tuple[Array, Array] | None = None,
    ) -> Tried:
        """One hypothesis; `first`: another state to begin with."""
        k = self.known
        score, nis, degrees, x, P = parity.replay(
            *(first or self._first),
            self._blocks,
            self._dt,
            k.used,
            (kind, i, j, since),
            k.constants,
            k.tuning,
        )
        who = () if kind == parity.NONE else (i,) if j < 0 else (i, j)
        return Tried(score, nis / max(degrees, 1), who, kind, since, x, P)

    def other_starts(self) -> list[Tried]:
        """No axis is wrong, the state was: as the first block says it, and turning the other
        way.
        """
        x, P = start(self.known, self._blocks[0])
        mirrored = x.copy()
        mirrored[parity.OMEGA] = -x[parity.OMEGA]
        return [self.run(parity.NONE, first=first) for first in ((x, P), (mirrored, P))]

    def of_axes(self) -> list[Tried]:
        """Every fault of one axis and of two, from the start and from the onset."""
        k, tried = self.known, []
        axes = np.nonzero(k.used)[0].tolist()
        for since in (-1, self._onset) if self._onset >= 0 else (-1,):
            for i in axes:
                kinds = [parity.OFFSET_OF, parity.IGNORE, parity.MIRROR_ZERO]
                kinds += [parity.MIRROR_REFERENCE] if k.learned[i] else []
                tried += [self.run(kind, i, -1, since) for kind in kinds]
            for a, i in enumerate(axes):
                for j in axes[a + 1 :]:
                    tried.append(self.run(parity.SWAP, i, j, since))
                    if k.learned[i] and k.learned[j]:
                        tried.append(self.run(parity.SWAP_CHANGES, i, j, since))
        return tried


def explain(history: History, known: Known, late: bool) -> Finding | None:
    """The likeliest explanation of the blocks since the onset (H-8); None when none fits or it is
    too early.
    """
    found = history.from_onset()
    if found is None or (len(found[2]) < FEWEST and not late):
        return None
    trial = Trial(known, len(found[2]) - history.since_onset(), found)
    nothing = trial.run(parity.NONE)
    tried = sorted([*trial.other_starts(), *trial.of_axes()], key=lambda item: item.score)
    best = tried[0]
    fits = best.left < FIT and nothing.score - best.score >= BETTER
    if not fits or best.axes:
        width, wide = widened(history, known, len(found[2]) - history.since_onset(), found)
        explains = wide.left < FIT and nothing.score - wide.score >= BETTER
        if explains and (not fits or not _blames(best, wide, len(found[2]))):
            # nobody is blamed for what all axes do a little
            text = GOOD, "", 0.0, late
            return Finding((), parity.NONE, *text, wide.x, wide.P, width) if late else None
    if not fits:
        return None
    # a swap that does not explain all: one of its axes may do as well
    half = len(best.axes) == 2 and best.left > CLEAN
    one = [
        t for t in tried if half and len(t.axes) == 1 and t.axes[0] in best.axes and t.left < ALONE
    ]
    pair, best = (best, one[0]) if one else (None, best)
    others = [t for t in tried if not set(t.axes) & set(best.axes)]
    kinds = [t for t in tried if t.axes == best.axes and _state(t.kind) != _state(best.kind)]
    kinds += [pair] if pair else []
    sure = late or not others or others[0].score - best.score > SURE
    told_apart = not kinds or kinds[0].score - best.score > KIND_SURE
    sure &= told_apart or history.since_onset() >= KIND_BLOCKS
    finding = _finding(trial, best, sure)
    if pair:
        finding = replace(finding, text=f"{finding.text}, or {_swapped(known.layout, pair.axes)}")
    return finding


def _blames(best: Tried, wide: Tried, blocks: int) -> bool:
    """Does the fault explain so much more than wider beliefs do that an axis may be blamed?"""
    return wide.score - best.score > blocks * (BLAME + BLAME_UNCLEAN * max(0.0, best.left - NOISE))


def widened(
    history: History, known: Known, onset: int, found: tuple[Array, Array, Array, Array]
) -> tuple[Width, Tried]:
    """No axis is at fault, all are less exact than expected: the likeliest width."""
    tried = []
    for width in WIDER:
        if width.beyond(known.belief.width):
            trial = Trial(known.wider(width), onset, found)
            tried += [(width, t) for t in (trial.run(parity.NONE), *trial.other_starts())]
    if not tried:
        return known.belief.width, Trial(known, onset, found).run(parity.NONE)
    return min(tried, key=lambda item: item[1].score)


def _finding(trial: Trial, best: Tried, sure: bool) -> Finding:
    offset = float(best.x[parity.OFFSET]) if best.kind == parity.OFFSET_OF else 0.0
    now = best
    if best.axes:  # go on with the state of those who never used the axes
        i, j = best.axes if len(best.axes) > 1 else (*best.axes, -1)
        now = trial.run(parity.IGNORE, i, j, best.since)
    swapped = _swapped(trial.known.layout, best.axes)
    text = {
        parity.NONE: "",
        parity.OFFSET_OF: f"off by {offset:+.2f} m/s²",
        parity.IGNORE: "does not fit the motion that the others feel",
        parity.MIRROR_ZERO: "has the wrong sign",
        parity.MIRROR_REFERENCE: "changes with the wrong sign",
        parity.SWAP: swapped,
        parity.SWAP_CHANGES: swapped,
    }[best.kind]
    return Finding(best.axes, best.kind, _state(best.kind), text, offset, sure, now.x, now.P)


def _swapped(layout: Layout, who: tuple[int, ...]) -> str:
    return "swapped: " + " and ".join(layout.axis_names[i] for i in who)


def _state(kind: parity.Kind) -> AxisState:
    if kind in (parity.MIRROR_ZERO, parity.MIRROR_REFERENCE):
        return FLIPPED
    if kind in (parity.SWAP, parity.SWAP_CHANGES):
        return SWAPPED
    return {parity.NONE: AxisState.GOOD, parity.OFFSET_OF: BIASED, parity.IGNORE: SUSPECT}[kind]
