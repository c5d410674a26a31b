"""Parity of accelerometer axes by the structure of the field: a small filter that believes in rigid
bodies only.

    x = [omega (3) | omega' (3) | p (3) | offset of one axis]                                (H-1)

Axis readings must be J [omega'; p] + Q z(omega), E-3: N equations, omega' and p free at every step,
omega tied by its own integral. So N - 6 conditions stay; the innovation of the filter is their
residual, its NIS the chi-square. Runs on means of a few samples (blocks). The equations stand in
core/rate/parity.cpp, H-1 to H-8 of docs/equations-layouts.md.
"""

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inertial.core import native

Array = NDArray[np.float64]

STATES = 10
OMEGA, MOTION, OFFSET = slice(0, 3), slice(0, 6), 9  # segments: omega; omega and omega'; offset


class Kind(IntEnum):
    """Hypotheses about axes (H-6)."""

    NONE = 0
    OFFSET_OF = 1
    IGNORE = 2
    MIRROR_ZERO = 3
    MIRROR_REFERENCE = 4
    SWAP = 5
    SWAP_CHANGES = 6


NONE, OFFSET_OF, IGNORE, MIRROR_ZERO, MIRROR_REFERENCE, SWAP, SWAP_CHANGES = Kind


class Constants(NamedTuple):
    """What is known of the N axes; variances of one block's mean, (m/s^2)^2."""

    J: Array  # (N, 6)
    Q: Array  # (N, 6), m
    bias: Array  # (N,), m/s^2
    reference: Array  # (N,), m/s^2, readings at the last standstill
    white: Array  # (N,)
    offset: Array  # (N,)


class Tuning(NamedTuple):
    """How freely a body moves, and how wrong an axis that is still good may be."""

    sigma_alpha: float  # rad/s^2 per root s
    sigma_force: float  # m/s^2 per root s
    scale: float  # of 1
    cross: float  # of 1, of the RMS axis


step = native.health.step
"""x, P, NIS, log determinant, residual (N,), sigma (N,) after one block, dt (s) after the last (H-2
to H-5): the residual of every axis against all others, of one that is not used against the
prediction."""
replay = native.health.replay
"""Score (-2 log likelihood), NIS, its degrees, x and P of blocks (n, N) under the hypothesis (kind,
i, j, since); it holds after block `since`, in which its axes are not used; -1: always (H-8)."""
start = native.health.start
"""First x and P from one block: omega from the products where they are plain, else about zero
(H-7)."""
altered = native.health.altered
"""Readings without bias as they were if a hypothesis about axes i and j holds (H-6)."""
offsets_at_rest = native.health.offsets_at_rest
"""Mean readings (N,) without the specific force that the used axes see."""
