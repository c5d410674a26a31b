"""Faults of single accelerometer axes, put into simulated counts: so that a person and a test can
see them named.

a21:stuck@12                 from 12 s of the profile on, in each run of it
a21:biased@12-20             until 20 s
a21:biased=0.8@12            off by 0.8 m/s^2
a13:swapped=a21@12           exchanged with a21
a21:flipped@0  a21:saturated@12  a21:spiking@12
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from inertial.simulation.table import COUNT, COUNTS, Block

KINDS = ("stuck", "saturated", "swapped", "flipped", "spiking", "biased")
BIAS = 1.0  # m/s^2, where none is said
SPIKE = 20.0  # m/s^2
SPIKES_PER_SAMPLE = 0.05

_FORM = re.compile(r"([\w-]+):(\w+)(?:=([\w.+-]+?))?@([\d.]+)(?:-([\d.]+))?")


class FaultError(ValueError):
    """A fault that cannot be put into the axes."""


@dataclass(frozen=True)
class AxisFault:
    """One fault, from start_s up to end_s of the profile."""

    axis: int
    kind: str
    start_s: float
    end_s: float = float("inf")
    partner: int = -1  # of a swap
    bias: float = BIAS  # m/s^2

    def apply(
        self, t_s: NDArray[np.float64], counts: NDArray[np.int64], held: int | None
    ) -> NDArray[np.int64]:
        """Counts (n, N) with the fault at the profile's times t_s (n,); `held`: what a stuck axis
        reads.
        """
        on = (t_s >= self.start_s) & (t_s < self.end_s)
        if not on.any():
            return counts
        out, i = counts.copy(), self.axis
        match self.kind:
            case "stuck":
                out[on, i] = counts[np.argmax(on), i] if held is None else held
            case "saturated":
                out[on, i] = COUNTS[1]
            case "swapped":
                out[on, i], out[on, self.partner] = counts[on, self.partner], counts[on, i]
            case "flipped":
                out[on, i] = -counts[on, i]
            case "biased":
                out[on, i] = np.clip(counts[on, i] + round(self.bias / COUNT), *COUNTS)
            case "spiking":
                draw = np.random.default_rng([7, i, int(round(float(t_s[0]) * 1e3))])
                hit = on & (draw.random(len(t_s)) < SPIKES_PER_SAMPLE)
                sign = draw.choice([-1, 1], len(t_s))
                out[hit, i] = np.clip(counts[hit, i] + sign[hit] * round(SPIKE / COUNT), *COUNTS)
        return out


def parse(text: str, names: Sequence[str]) -> AxisFault:
    """A fault as people write it, see above; `names` are the layout's axes. Raises FaultError."""
    match = _FORM.fullmatch(text.strip())
    if match is None:
        raise FaultError(
            f"fault {text!r}: want AXIS:KIND@SECONDS, as a21:stuck@12 or a13:swapped=a21@12-20"
        )
    axis, kind, value, start, end = match.groups()
    if kind not in KINDS:
        raise FaultError(f"fault {text!r}: kind {kind!r}, want one of {', '.join(KINDS)}")
    for name in (axis, value) if kind == "swapped" else (axis,):
        if name not in names:
            raise FaultError(f"fault {text!r}: no axis {name!r}, want one of {', '.join(names)}")
    fault = AxisFault(
        names.index(axis), kind, _seconds(text, start), _seconds(text, end) if end else float("inf")
    )
    if fault.end_s <= fault.start_s:
        raise FaultError(
            f"fault {text!r}: ends at {fault.end_s:g} s, want later than {fault.start_s:g} s"
        )
    if kind == "swapped":
        return replace(fault, partner=names.index(value))
    if kind == "biased" and value is not None:
        try:
            return replace(fault, bias=float(value))
        except ValueError:
            raise FaultError(f"fault {text!r}: offset {value!r}, want a number in m/s²") from None
    if value is not None:
        raise FaultError(f"fault {text!r}: {kind} takes no value")
    return fault


def when(fault: AxisFault, run_s: float) -> str:
    """When a fault comes to a table whose runs take run_s, in words."""
    if fault.start_s >= run_s:
        return f"never comes: a run of the table takes {run_s:g} s, and each begins anew at 0 s"
    return f"comes {fault.start_s:g} s after the beginning of each run, which takes {run_s:g} s"


def _seconds(text: str, value: str) -> float:
    try:
        return float(value)
    except ValueError:
        raise FaultError(f"fault {text!r}: time {value!r}, want seconds of the profile") from None


class Faults:
    """Puts faults into consecutive blocks of one simulated table."""

    def __init__(self, faults: Sequence[AxisFault]) -> None:
        self._faults = list(faults)
        self._held: dict[int, int] = {}  # by place in the list: what a stuck axis reads

    def into(self, block: Block) -> Block:
        """The block with every fault in its counts and readings."""
        counts = block.counts
        for k, fault in enumerate(self._faults):
            on = (block.profile_time_s >= fault.start_s) & (block.profile_time_s < fault.end_s)
            if fault.kind == "stuck" and on.any() and k not in self._held:
                self._held[k] = int(counts[np.argmax(on), fault.axis])
            counts = fault.apply(block.profile_time_s, counts, self._held.get(k))
        return replace(block, counts=counts, readings=counts * COUNT)
