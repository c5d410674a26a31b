"""What a products filter says of one sample, read from its row when somebody asks: most of it is
published as it is.
"""

import math

import numpy as np
from numpy.typing import NDArray

from inertial.rate import products_track as track
from inertial.rate import sight

Array = NDArray[np.float64]

KEEP_STILL, WAITING = "finding biases: keep still", "no standstill yet: keep still"
TWO_SIGNS = "turning, sign of the rate unknown"


NEEDED = (track.NIS, track.STILL, track.STARTED, track.TWO, track.SIGN, track.BOUND)
TOLD = np.array([*NEEDED, *range(track.SIGHT, track.WIDTH)])
"""Columns of a row that a state needs at once."""


class TrackState:
    """A RateState: its attributes, their shapes, units and meaning. Arrays are parts of one row: do
    not write them.
    """

    __slots__ = (
        "rows",
        "at",
        "nis_dof",
        "still",
        "started",
        "two",
        "bounded",
        "sight",
        "sight_reason",
        "excluded",
        "calibration",
        "aid",
    )

    def __init__(
        self, rows: Array, at: int, said: list[float], products: int, aid: str, mask: int, card: str
    ) -> None:
        """Row `at` of rows (n, WIDTH); said: its columns TOLD; products: how many of them the
        layout sees.
        """
        nis, still, started, two, sign, bound, *sights = said
        self.rows, self.at = rows, at
        self.still, self.started, self.two, self.bounded = (
            still > 0.0,
            started > 0.0,
            two > 0.0,
            bound > 0.0,
        )
        self.nis_dof = products if self.started and nis != 0.0 else 0
        self.excluded, self.calibration, self.aid = mask, card, aid
        self.sight, self.sight_reason = sight.ALL_BLIND, WAITING
        if self.started:
            self.sight, self.sight_reason = sight.ALL_VALID, ""
            if any(sights):
                self.sight = tuple(map(int, sights))
                variances = rows[at, track.P : track.P + 9 : 4]
                size = math.hypot(
                    *rows[at, track.OMEGA : track.OMEGA + 3], math.sqrt(variances.sum())
                )
                self.sight_reason = sight.reason(self.sight, variances, sign, self.two, size)

    def __repr__(self) -> str:
        return f"TrackState({self.phase}, omega_b={self.omega_b.tolist()})"

    def _part(self, first: int, size: int) -> Array:
        return self.rows[self.at, first : first + size]

    @property
    def omega_b(self) -> Array:
        return self._part(track.OMEGA, 3)

    @property
    def P(self) -> Array:
        return self._part(track.P, 9).reshape(3, 3)

    @property
    def alpha_b(self) -> Array:
        return self._part(track.ALPHA, 3)

    @property
    def f_b(self) -> Array:
        return self._part(track.F, 3)

    @property
    def q_nb(self) -> Array:
        return self._part(track.Q_NB, 4)

    @property
    def angle_z(self) -> float:
        return float(self.rows[self.at, track.ANGLE])

    @property
    def innovation(self) -> Array:
        return self._part(track.INNOVATION, self.nis_dof)

    @property
    def innovation_sigma(self) -> Array:
        return self._part(track.SIGMA, self.nis_dof)

    @property
    def innovation_unit(self) -> str:
        return "(rad/s)^2"

    @property
    def nis(self) -> float:
        return float(self.rows[self.at, track.NIS]) if self.nis_dof else 0.0

    @property
    def p_n(self) -> Array:
        return self._part(track.P_N, 3)

    @property
    def v_n(self) -> Array:
        return self._part(track.V_N, 3)

    @property
    def bias(self) -> Array:
        return self._part(track.BIAS, 12)

    @property
    def bound_sigma(self) -> Array | None:
        return self._part(track.BOUND, 3) if self.bounded else None

    @property
    def phase(self) -> str:
        phase = (
            KEEP_STILL
            if not self.started
            else TWO_SIGNS
            if self.two
            else "still"
            if self.still
            else "turning"
        )
        return f"{phase}, aided by the tachometer" if self.aid else phase
