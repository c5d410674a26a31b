"""Accelerometer layouts: where the axes sit, what they see, how good a layout is.

An axis at r_b with sensing direction theta_b reads

    a = theta . (p + omega' x r + omega x (omega x r))                                       (E-1)

which is linear in omega', p and the six products w_i w_j. Units: m, m/s^2, rad/s. Body frame b.
Source: Hoseini and Moradi 2017, (20)-(24); docs/equations.md, E-1 to E-5.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from inertial.constants import GRAVITY, MILLI_G
from inertial.core import native
from inertial.elementary import applied

Array = NDArray[np.float64]

PRODUCTS = np.triu_indices(3)  # xx xy xz yy yz zz: order of the products everywhere
# of the largest singular value, lengths in units of the layout's scale: directions to 4 digits
RANK_TOLERANCE = 1e-4


class GeometryError(ValueError):
    """The accelerometer layout cannot observe the motion it is asked for."""


def products(omega_b: Array) -> Array:
    """The six distinct w_i w_j, (6,), (rad/s)^2, in the order of PRODUCTS (E-2)."""
    return np.outer(omega_b, omega_b)[PRODUCTS]


def products_matrix(r_b: Array, theta_b: Array) -> Array:
    """Q with q(omega) = Q @ products(omega), (N, 6), m: the quadratic part of every axis (E-2)."""
    rows, columns = PRODUCTS
    along = r_b[:, rows] * theta_b[:, columns]
    across = r_b[:, columns] * theta_b[:, rows]
    diagonal = rows == columns
    # theta . (omega (omega . r) - |omega|^2 r)
    return np.where(diagonal, along - np.sum(r_b * theta_b, axis=1)[:, None], along + across)


@dataclass(frozen=True)
class Sensor:
    """What one accelerometer axis is expected to do; sigmas, m/s^2 where not said."""

    name: str
    noise: float  # of one sample at the board's usual rate, counts included
    bias: float  # of one axis before calibration
    scale_error: float  # of 1, before calibration
    limit: float  # largest reading


SENSORS = {
    # 4 mg noise and 3.9 mg counts; offset and sensitivity as in the published test; 13 bit at +-16
    # g
    "adxl345": Sensor("adxl345", 4.16 * MILLI_G, 20 * MILLI_G, 0.005, 4095 * 3.9 * MILLI_G),
    # measured at rest in accelerometer_array, 62.5 Hz; offset and sensitivity from the data sheet
    "mpu9150": Sensor("mpu9150", 0.045, 60 * MILLI_G, 0.015, 16.0 * GRAVITY),
}


@dataclass(frozen=True, eq=False)
class Layout:
    """N accelerometer axes on a rigid body; raises GeometryError for arrays that cannot be axes."""

    name: str
    r_b: Array  # m, (N, 3), from the body's centre
    theta_b: Array  # unit vectors, (N, 3)
    scale_m: float = (
        1.0  # m, the length that counts as 1 in kappa and gdop; half the side for a cube
    )
    axis_names: tuple[str, ...] = ()  # empty: a11 a12 a13 a21 ... for 12 axes, else a1 a2 ...
    channels: tuple[
        int, ...
    ] = ()  # column of the board's samples that each axis is; empty: the same order
    gain: tuple[float, ...] = ()  # true m/s^2 per m/s^2 of the board's nominal scale; empty: 1
    sensors: tuple[Sensor, ...] = ()  # model of each axis; empty: ADXL345
    text: str = ""  # for people

    def __post_init__(self) -> None:
        object.__setattr__(self, "r_b", np.array(self.r_b, dtype=np.float64))
        object.__setattr__(self, "theta_b", np.array(self.theta_b, dtype=np.float64))
        shape = self.theta_b.shape
        if self.r_b.shape != shape or len(shape) != 2 or shape[1] != 3:
            raise GeometryError(
                f"layout {self.name}: positions {self.r_b.shape} and directions {shape}, want both"
                " (axes, 3)"
            )
        if not (np.isfinite(self.r_b).all() and np.isfinite(self.theta_b).all()):
            raise GeometryError(
                f"layout {self.name}: positions or directions are not all finite numbers"
            )
        length = np.linalg.norm(self.theta_b, axis=1)
        if np.abs(length - 1.0).max(initial=0.0) > 1e-6:
            axis = int(np.abs(length - 1.0).argmax())
            raise GeometryError(
                f"layout {self.name}: direction of axis {axis + 1} has length {length[axis]:.6g},"
                " want 1: normalise it"
            )
        if not self.scale_m > 0.0:
            raise GeometryError(f"layout {self.name}: scale {self.scale_m} m, want more than 0")
        self._fill(len(self.r_b))
        self.r_b.setflags(write=False)
        self.theta_b.setflags(write=False)

    def _fill(self, n: int) -> None:
        triads = tuple(f"a{i // 3 + 1}{i % 3 + 1}" for i in range(n))
        default = {
            "axis_names": triads if n == 12 else tuple(f"a{i + 1}" for i in range(n)),
            "channels": tuple(range(n)),
            "gain": (1.0,) * n,
            "sensors": (SENSORS["adxl345"],) * n,
        }
        for name, value in default.items():
            given = getattr(self, name)
            if given and len(given) != n:
                raise GeometryError(f"layout {self.name}: {len(given)} {name} for {n} axes")
            object.__setattr__(self, name, tuple(given) or value)

    @property
    def axes(self) -> int:
        """Number of axes N."""
        return len(self.r_b)

    @property
    def columns(self) -> int:
        """How many columns a board's samples must have at least."""
        return max(self.channels) + 1

    def read(self, board: Array) -> Array:
        """Axis readings (n, N), m/s^2, of a board's samples (n, columns) at nominal scale: its
        channels, by gain.
        """
        if self._straight:
            return board
        return board[:, list(self.channels)] * np.array(self.gain)

    @cached_property
    def _straight(self) -> bool:
        return self.channels == tuple(range(self.axes)) and set(self.gain) == {1.0}

    @property
    def noise(self) -> Array:
        """Noise of one sample of each axis, m/s^2, (N,), sigma."""
        return np.array([sensor.noise for sensor in self.sensors])

    @cached_property
    def J(self) -> Array:
        """Design matrix of [omega'; p], (N, 6) (E-3, the paper's (21))."""
        return np.hstack([np.cross(self.r_b, self.theta_b), self.theta_b])

    @cached_property
    def Q(self) -> Array:
        """Matrix of the six products, (N, 6), m (E-2)."""
        return products_matrix(self.r_b, self.theta_b)

    @cached_property
    def S(self) -> Array:
        """Least squares [omega'; p] = S (a - q(omega)), (6, N) (E-3, (22)); raises GeometryError
        below rank 6.
        """
        return self._pseudo_inverse(self.J, "angular acceleration 3, specific force 3")

    @cached_property
    def field_matrix(self) -> Array:
        """F of a = F @ [omega'; p; products], (N, 12) (E-4)."""
        return np.hstack([self.J, self.Q])

    @cached_property
    def field_inverse(self) -> Array:
        """[omega'; p; products] = field_inverse @ a, (12, N) (E-4); raises GeometryError below rank
        12.
        """
        return self._pseudo_inverse(
            self.field_matrix, "angular acceleration 3, specific force 3, products of the rate 6"
        )

    @property
    def rank(self) -> int:
        """How many of the twelve unknowns of the field the axes see."""
        return self._rank(self.field_matrix)

    @property
    def kappa(self) -> float:
        """Condition number of J with lengths in scale_m (23)."""
        sigma = np.linalg.svd(self._scaled(self.J), compute_uv=False)
        return (
            float(sigma[0] / sigma[-1]) if sigma[-1] > RANK_TOLERANCE * sigma[0] else float("inf")
        )

    @property
    def gdop(self) -> float:
        """sqrt(trace((J^T J)^-1)) with lengths in scale_m (24)."""
        if self._rank(self.J) < 6:
            return float("inf")
        J = self._scaled(self.J)
        return float(np.sqrt(np.trace(np.linalg.inv(J.T @ J))))

    def quadratic(self, omega_b: Array) -> Array:
        """q(omega), (N,), m/s^2: what the rate omega_b (3,) adds to every axis (E-2)."""
        return applied(self.Q, products(omega_b))

    def _scaled(self, matrix: Array) -> Array:
        length = np.ones(matrix.shape[1])
        length[:3] = self.scale_m
        length[6:] = self.scale_m
        return matrix / length

    def _rank(self, matrix: Array) -> int:
        return int(np.linalg.matrix_rank(self._scaled(matrix), tol=None, rtol=RANK_TOLERANCE))

    def _pseudo_inverse(self, matrix: Array, unknowns: str) -> Array:
        rank, wanted = self._rank(matrix), matrix.shape[1]
        if rank < wanted:
            raise GeometryError(
                f"layout {self.name}: {self.axes} accelerometer axes observe only {rank} of the"
                f" {wanted} unknowns ({unknowns}): place axes off one plane and one line, four"
                " triads at corners that span a tetrahedron see everything"
            )
        # by the core, not by LAPACK: every estimate is made with it
        return native.solve_positive(native.product(matrix.T, matrix), matrix.T)


CORNERS = np.array(
    [[1, -1, 1], [-1, 1, 1], [-1, -1, -1], [1, 1, -1]], dtype=np.float64
)  # of the cube, L/2 = 1
WIRING = (
    np.array(  # triad, sensor axis -> body direction; recovered from the paper's (25), (26) and J
        [
            [[0, 1, 0], [-1, 0, 0], [0, 0, 1]],
            [[0, -1, 0], [1, 0, 0], [0, 0, 1]],
            [[0, 1, 0], [1, 0, 0], [0, 0, -1]],
            [[0, -1, 0], [-1, 0, 0], [0, 0, -1]],
        ],
        dtype=np.float64,
    )
)
