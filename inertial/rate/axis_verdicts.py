"""What has been found of every axis of a board: faults named, axes left out and taken back."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from inertial.layouts.layout import RANK_TOLERANCE, Layout
from inertial.rate import axis_samples, parity
from inertial.rate.axis_belief import Belief
from inertial.rate.axis_fault import AxisState, Fault
from inertial.rate.health_config import Config, Counts, Newest

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


def good_of(states: Mapping[str, str]) -> str:
    """How many axes are good and what the others are, for people; states by axis name."""
    bad = [f"{name} {state}" for name, state in states.items() if state != "good"]
    return ", ".join([f"{len(states) - len(bad)} of {len(states)} good", *bad])


class Verdicts:
    """Faults of the axes, and which axes are used."""

    def __init__(self, layout: Layout, config: Config, counts: Counts) -> None:
        self.layout, self._config, self._counts = layout, config, counts
        self.faults = [Fault() for _ in range(layout.axes)]
        self.used = np.ones(layout.axes, dtype=bool)

    @property
    def mask(self) -> int:
        """Bit k: axis k is excluded."""
        return sum([1 << k for k, fault in enumerate(self.faults) if fault.excluded])

    @property
    def text(self) -> str:
        """For people: how many are good, and what the others are."""
        names = self.layout.axis_names
        return good_of({n: f.word for n, f in zip(names, self.faults, strict=True)})

    def name(
        self,
        i: int,
        t_s: float,
        state: AxisState,
        text: str,
        kind: int = parity.IGNORE,
        partner: int = -1,
        offset: float = 0.0,
    ) -> bool:
        """Axis i has this fault since t_s; True when it was used until now."""
        fault = self.faults[i]
        if fault.excluded and (
            state == fault.state or fault.state not in (AxisState.SUSPECT, AxisState.BIASED)
        ):
            if state == fault.state:
                fault.fits, fault.evidence = 0, 0.0
            return False
        relapse = t_s - fault.ended_s < self._config.relapse_s
        if not relapse:
            fault.relapses = 0
        elif not fault.excluded:
            fault.relapses += 1
        if fault.state in (AxisState.GOOD, AxisState.SUSPECT) and not fault.excluded:
            self._counts.named += 1
        fault.state, fault.text, fault.since_s = state, text, t_s
        fault.kind, fault.partner, fault.offset = kind, partner, offset
        fault.evidence, fault.fits = 0.0, 0
        fault.excluded = fault.excluded or self._spare(i)
        if not (fault.excluded and self.used[i]):
            return False
        self.used[i] = False
        return True

    def _spare(self, i: int) -> bool:
        """True when the others still see omega' and p."""
        rest = self.used.copy()
        rest[i] = False
        J = self.layout._scaled(self.layout.J[rest])
        return len(J) >= 6 and int(np.linalg.matrix_rank(J, rtol=RANK_TOLERANCE)) == 6

    def suspect(self, axes: tuple[int, ...]) -> None:
        """These are looked into."""
        for i in axes:
            if not self.faults[i].excluded:
                self.faults[i].state = AxisState.SUSPECT
                self.faults[i].text = "inconsistent, looked into"

    def clear_suspects(self, t_s: float) -> None:
        """All is well."""
        for fault in self.faults:
            if fault.state == AxisState.SUSPECT and not fault.excluded:
                fault.state, fault.text, fault.since_s = AxisState.GOOD, "", t_s

    def returns(
        self, t_s: float, block: Array, dt: float, newest: Newest, mute: Mask, belief: Belief
    ) -> bool:
        """One block (N,) of dt s on the way back, `mute` (N,): axes that give themselves away;
        True when an axis was taken back (H-10).
        """
        c, taken = self._config, False
        for i, fault in enumerate(self.faults):
            if not fault.excluded:
                continue
            residual, sigma = float(newest.residual[i]), float(newest.sigma[i])
            if not mute[i] and abs(residual) < 4.0 * sigma and newest.filled:
                fault.fits += 1
                fault.evidence += fault.favours_good(
                    i, block, belief.bias, belief.reference, residual, sigma
                )
            else:
                fault.fits, fault.evidence = 0, 0.0
            seconds = min(c.good_s * 2.0**fault.relapses, c.longest_good_s)
            enough = fault.fits * dt >= seconds and fault.evidence > c.evidence
            partner = self.faults[fault.partner] if fault.partner >= 0 else None
            if enough and (
                partner is None or not partner.excluded or partner.evidence > c.evidence
            ):
                self.used[i] = taken = True
                fault.state, fault.excluded, fault.text = AxisState.GOOD, False, ""
                fault.since_s = fault.ended_s = t_s
                self._counts.returned += 1
        return taken


def mute(whose: NDArray[np.bool_], count: axis_samples.Integers, stale: int) -> Mask:
    """(N,), axes that say of themselves that they cannot be believed."""
    said = whose.any(axis=0) | (count[axis_samples.SAME] >= 8)
    return said | np.array([bool(stale >> i & 1) for i in range(len(said))])
