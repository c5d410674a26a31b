"""Axes of a cube that are swapped, turned or of the wrong sign, found in the data: which wiring
would make them a rigid body?

At rest all sensors read one gravity; at a steady rate they read, over their rest, what one vector
omega makes of their places (E-4), with the same push for all where the body is off the axis:

    d = Q products(omega) + Theta p

and over a ramp from rest they integrate to what turns about the same axis n make of them:

    int d dt = (r x theta) n a + Q products(n) b + Theta p

Sizes are free in all three, so that neither the half side nor the scale matters. That leaves of a
cube's twelve readings nine residuals at rest, six at a rate, seven over a ramp. Where they are
large, every way to rewire one sensor's axes, to exchange two axes or two sensors is tried; one is
named only if it explains everything.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations, permutations, product

import numpy as np
from numpy.typing import NDArray

from inertial.constants import GRAVITY
from inertial.layouts.layout import PRODUCTS, Layout
from inertial.plausible import Doubt

Array = NDArray[np.float64]

# Shares of the readings that are left unexplained at rest, at a rate, over a ramp: far beyond what
# 20 mg, 2 %, 10 mrad make, and at most, of a wiring that is named.
WRONG = (0.14, 0.22, 0.5)
RIGHT = (0.07, 0.09, 0.3)
MOST_NAMED = 2
TURNED = "axes exchanged or turned, or of the other sign"
ENOUGH = 6  # steady windows
FASTEST = 4  # steady vectors that are looked at: the strongest


@dataclass(frozen=True)
class Wiring:
    """Axis k truly reads sign[k] times column source[k]."""

    text: str
    effort: int  # how many things must have gone wrong
    source: tuple[int, ...]
    sign: tuple[int, ...]

    def read(self, f_axis: Array) -> Array:
        """Readings (N,) as they would be with this wiring."""
        return f_axis[list(self.source)] * np.array(self.sign)


@dataclass(frozen=True, eq=False)
class Evidence:
    """Readings (N,) of one kind each."""

    rest: Array
    steady: Sequence[Array]  # over those at rest
    ramps: Sequence[tuple[Array, Array]]  # integrated over a ramp, and its plateau; over rest

    def read(self, wiring: "Wiring") -> "Evidence":
        """The same, had the axes been wired so."""
        return Evidence(
            wiring.read(self.rest),
            [wiring.read(d) for d in self.steady],
            [(wiring.read(turned), wiring.read(d)) for turned, d in self.ramps],
        )


def doubt_of_axes(
    layout: Layout,
    rest: Array,
    steady: Sequence[Array],
    ramps: Sequence[tuple[Array, Array]],
) -> Doubt | None:
    """rest (N,), m/s^2: readings at rest; steady: those at a steady rate, over rest; ramps: as in
    Evidence, newest last.
    """
    if not triads(layout) or layout.rank < 12:
        return None
    strong = sorted(steady, key=lambda d: -float(np.linalg.norm(d)))
    turning = len(steady) >= ENOUGH
    seen = Evidence(rest, strong[:FASTEST] if turning else [], list(ramps)[-FASTEST:])
    body = RigidBody(layout)
    if body.explains(seen, WRONG):
        return None
    fits = [w for w in wirings(layout) if body.explains(seen.read(w), RIGHT)]
    return _said(layout, fits, turning)


def _said(layout: Layout, fits: list[Wiring], turning: bool) -> Doubt | None:
    if not fits:
        return None
    least = min(wiring.effort for wiring in fits)
    simple = [wiring for wiring in fits if wiring.effort == least]
    text = " or ".join(wiring.text for wiring in simple[:MOST_NAMED])
    if turning and len(simple) <= MOST_NAMED:
        return Doubt("axes", f"the axes do not fit one rigid body: {text} would fit")
    more = "" if turning else "; turn the table, then it is said which"
    moved = [frozenset(_moved(wiring)) for wiring in fits]
    for axes in triads(layout):
        if all(of <= frozenset(axes) for of in moved):
            names = " ".join(layout.axis_names[k] for k in axes)
            return Doubt("axes", f"{names} read another gravity than the others: {TURNED}{more}")
    return Doubt("axes", f"the axes do not fit one rigid body: {TURNED}, like {text}{more}")


def _moved(wiring: Wiring) -> list[int]:
    return [
        k
        for k, (s, sign) in enumerate(zip(wiring.source, wiring.sign, strict=True))
        if s != k or sign < 0
    ]


def triads(layout: Layout) -> list[tuple[int, ...]]:
    """Axes of each sensor: three at one place; empty where a layout is not made of such."""
    places: dict[tuple[float, ...], list[int]] = {}
    for k, r in enumerate(np.round(layout.r_b, 6).tolist()):
        places.setdefault(tuple(r), []).append(k)
    found = [tuple(axes) for axes in places.values()]
    return found if all(len(axes) == 3 for axes in found) else []


def agree_on_gravity(layout: Layout, rest: Array) -> bool:
    """Whether all readings at rest (N,) are parts of one vector, whatever its size."""
    return RigidBody(layout).at_rest(rest)[0] < WRONG[0]


class RigidBody:
    """What a layout's axes would read, and how much of what they do read that leaves."""

    def __init__(self, layout: Layout) -> None:
        self._theta, self._Q = layout.theta_b, layout.Q
        self._turns = layout.J[:, :3]  # of omega'
        self._push = np.linalg.pinv(self._theta)
        both = np.hstack([self._Q, self._theta])
        self._products = np.linalg.pinv(both)[:6]

    def explains(self, seen: Evidence, most: tuple[float, float, float]) -> bool:
        """Whether less than `most` is left at rest, of each steady window, of each ramp."""
        apart, size = self.at_rest(seen.rest)
        return (
            max(apart, abs(size / GRAVITY - 1.0)) < most[0]
            and all(self.steady(d)[1] < most[1] for d in seen.steady)
            and all(self.ramp(turned, d) < most[2] for turned, d in seen.ramps)
        )

    def at_rest(self, rest: Array) -> tuple[float, float]:
        """Share of the readings (N,) that no gravity explains, and its size, m/s^2."""
        f_b = self._push @ rest
        size = max(float(np.linalg.norm(rest)), 1e-9)
        return float(np.linalg.norm(rest - self._theta @ f_b)) / size, float(np.linalg.norm(f_b))

    def steady(self, d: Array) -> tuple[Array, float]:
        """The axis n_b (3,) that a steady rate is about, and the share of d (N,) it leaves."""
        square = np.zeros((3, 3))
        square[PRODUCTS] = self._products @ d
        values, vectors = np.linalg.eigh(square + np.triu(square, 1).T)
        n_b = vectors[:, -1]
        left = d - self._of(n_b) * max(float(values[-1]), 0.0)
        left = left - self._theta @ (self._push @ left)
        return n_b, float(np.linalg.norm(left) / max(float(np.linalg.norm(d)), 1e-9))

    def ramp(self, turned: Array, steady: Array) -> float:
        """Share of the integral `turned` (N,) that a turn about the plateau's axis leaves."""
        n_b = self.steady(steady)[0]
        basis = np.column_stack([self._turns @ n_b, self._of(n_b), self._theta])
        solved = np.linalg.lstsq(basis, turned, rcond=None)[0]
        rotation = turned - self._theta @ solved[2:]
        size = max(float(np.linalg.norm(rotation)), 1e-9)
        return float(np.linalg.norm(turned - basis @ solved)) / size

    def _of(self, n_b: Array) -> Array:
        """What a rate of 1 rad/s about n_b makes of every axis, m/s^2."""
        return self._Q @ np.outer(n_b, n_b)[PRODUCTS]


def wirings(layout: Layout) -> list[Wiring]:
    """All that are tried, the likeliest first."""
    return _wirings(layout.axis_names, tuple(triads(layout)))


@lru_cache(maxsize=8)
def _wirings(names: tuple[str, ...], sensors: tuple[tuple[int, ...], ...]) -> list[Wiring]:
    straight = tuple(range(len(names)))
    found = [
        *_within(names, sensors, straight),
        *_across(names, sensors, straight),
    ]
    return sorted(found, key=lambda wiring: wiring.effort)


def _within(
    names: tuple[str, ...], sensors: tuple[tuple[int, ...], ...], straight: tuple[int, ...]
) -> Iterator[Wiring]:
    """One sensor's axes in another order, of other signs."""
    for axes in sensors:
        for order, signs in product(permutations(axes), product((1, -1), repeat=3)):
            moved = sum(a != b for a, b in zip(order, axes, strict=True))
            flipped = [k for k, s in zip(axes, signs, strict=True) if s < 0]
            if not moved and not flipped:
                continue
            source, sign = list(straight), [1] * len(straight)
            for k, from_, s in zip(axes, order, signs, strict=True):
                source[k], sign[k] = from_, s
            yield Wiring(
                _named(names, axes, order, flipped),
                (moved + 1) // 2 + len(flipped),
                tuple(source),
                tuple(sign),
            )


def _named(
    names: tuple[str, ...], axes: tuple[int, ...], order: tuple[int, ...], flipped: list[int]
) -> str:
    parts = [f"{names[a]} read from {names[b]}" for a, b in zip(axes, order, strict=True) if a != b]
    if len(parts) == 2:
        a, b = (k for k, other in zip(axes, order, strict=True) if k != other)
        parts = [f"{names[a]} and {names[b]} exchanged"]
    parts += [f"{names[k]} with the other sign" for k in flipped]
    return ", ".join(parts)


def _across(
    names: tuple[str, ...], sensors: tuple[tuple[int, ...], ...], straight: tuple[int, ...]
) -> Iterator[Wiring]:
    """Two axes of different sensors exchanged, or two whole sensors."""
    ones = (1,) * len(straight)
    for first, second in combinations(sensors, 2):
        whole = list(straight)
        for a, b in zip(first, second, strict=True):
            whole[a], whole[b] = b, a
        text = f"sensors {names[first[0]]}.. and {names[second[0]]}.. exchanged"
        yield Wiring(text, 1, tuple(whole), ones)
        for a, b in product(first, second):
            source = list(straight)
            source[a], source[b] = b, a
            yield Wiring(f"{names[a]} and {names[b]} exchanged", 1, tuple(source), ones)
